// Shows models/hatching.glb or models/metal.glb, in the light of a lamp that the sliders move.
//
// ?model=metal chooses the model, ?azimuth=40&elevation=20 place the lamp, and ?still hides the controls.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { hatchingMaterial } from "./hatching_material.js";

const query = new URLSearchParams(location.search);
const controls = document.getElementById("controls");
const input = Object.fromEntries(
  ["model", "azimuth", "elevation"].map((id) => [id, document.getElementById(id)]),
);
const renderer = new THREE.WebGLRenderer({ antialias: true });
document.body.append(renderer.domElement);

let scene, camera, orbit, lamp;

/** Load a model, and place the sliders where its lamp is. */
async function show(name) {
  const model = await new GLTFLoader().loadAsync(`models/${name}.glb`);
  scene = new THREE.Scene();
  scene.background = new THREE.Color("white");
  scene.add(model.scene);
  camera = model.cameras[0];
  model.scene.traverse((node) => {
    if (node.isDirectionalLight) lamp = node;
  });
  model.scene.traverse(useHatching);
  if (name === "metal" && !query.has("still")) {
    const environment = new THREE.PMREMGenerator(renderer).fromScene(new RoomEnvironment());
    scene.environment = environment.texture;
    scene.environmentIntensity = 0.6;
  }
  orbit?.dispose();
  const view = camera.quaternion.clone();
  orbit = new OrbitControls(camera, renderer.domElement);
  // The point of the line of sight that is nearest to the origin.
  const sight = new THREE.Vector3(0, 0, -1).applyQuaternion(view);
  orbit.target.copy(camera.position).addScaledVector(sight, -camera.position.dot(sight));
  orbit.update();
  orbit.addEventListener("change", draw);
  const direction = lamp.getWorldDirection(new THREE.Vector3());
  const place = new THREE.Spherical().setFromVector3(direction);
  input.azimuth.value = query.get("azimuth") ?? THREE.MathUtils.radToDeg(place.theta);
  input.elevation.value = query.get("elevation") ?? 90 - THREE.MathUtils.radToDeg(place.phi);
  resize();
}

/** Give a mesh whose material has thresholds of ink the material that draws them. */
function useHatching(node) {
  const settings = node.isMesh && node.material.userData.rosy_hatching;
  if (settings) node.material = hatchingMaterial(node.material.emissiveMap, JSON.parse(settings));
}

/** Turn the lamp to the direction of the sliders. */
function moveLamp() {
  const [azimuth, elevation] = [input.azimuth, input.elevation].map((slider) =>
    THREE.MathUtils.degToRad(slider.value),
  );
  const direction = new THREE.Vector3().setFromSphericalCoords(1, Math.PI / 2 - elevation, azimuth);
  lamp.parent.worldToLocal(lamp.position.copy(direction));
  lamp.parent.worldToLocal(lamp.target.position.set(0, 0, 0));
  lamp.parent.add(lamp.target);
  scene.traverse((node) => {
    const uniforms = node.isMesh && node.material.uniforms;
    if (!uniforms) return;
    uniforms.lightDirection.value.copy(direction);
    uniforms.lightStrength.value = lamp.intensity / Math.PI;
  });
  draw();
}

function resize() {
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
  moveLamp();
}

function draw() {
  renderer.render(scene, camera);
}

controls.hidden = query.has("still");
input.model.value = query.get("model") ?? "hatching";
input.model.addEventListener("change", () => show(input.model.value));
input.azimuth.addEventListener("input", moveLamp);
input.elevation.addEventListener("input", moveLamp);
await show(input.model.value);
document.body.dataset.ready = "";
addEventListener("resize", resize);
