// A material of three.js that draws the hatching of a texture of thresholds, as RoSy's node group does.

import * as THREE from "three";

const VERTEX = /* glsl */ `
varying vec2 vUv;
varying vec3 vNormal;

void main() {
  vUv = uv;
  vNormal = mat3(modelMatrix) * normal;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const FRAGMENT = /* glsl */ `
#include <common>

uniform sampler2D thresholds;
uniform vec3 lightDirection;  // to the lamp, in world space
uniform float lightStrength;
uniform float shading, black, white, gamma, layers, layering, crispness, highlights;
uniform vec3 inks[3], highlightColor, paper;
varying vec2 vUv;
varying vec3 vNormal;

bool isLightInk() { return luminance(inks[0]) > luminance(paper); }

float complementIfLight(float value) { return isLightInk() ? 1.0 - value : value; }

float transmittance(vec3 ink) {
  return complementIfLight(luminance(ink)) / max(complementIfLight(luminance(paper)), 1e-3);
}

void main() {
  vec3 normal = normalize(gl_FrontFacing ? vNormal : -vNormal);
  float lambert = max(dot(normal, lightDirection), 0.0) * lightStrength;
  float range = abs(white - black) > 1e-3 ? white - black : 1e-3;
  float tone = (mix(1.0, lambert, shading) - black) / range;
  tone = min(pow(max(tone, 0.0), 1.0 / gamma), 1.0);

  // How much of each line has begun, and what it would leave of the light.
  float solid = max(max(transmittance(inks[0]), transmittance(inks[1])), transmittance(inks[2]));
  float required = solid + complementIfLight(tone) * (1.0 - solid);
  vec3 ink[3];
  float left[3], begun[3];
  float total = 0.0;
  for (int line = 0; line < 3; line++) {
    ink[line] = mix(inks[line], highlightColor, highlights * tone);
    float darkest = max(1.0 - transmittance(ink[line]), 1e-3);
    left[line] = 1.0 - min((1.0 - required) / darkest, 1.0);
    float onset = layering * float(line);
    begun[line] = smoothstep(onset - 0.15, onset + 0.35, 1.0 - left[0]);
    if (float(line) > layers - 0.5) begun[line] = 0.0;
    total += begun[line];
  }

  // Mip levels hold the mean of thresholds; alpha tells how far they are spread.
  vec4 texel = texture2D(thresholds, vUv);
  vec3 centered = 2.0 * texel.rgb - 1.0;
  float spread = max(texel.a - dot(centered, centered) / 3.0 - 0.001, 0.0);
  float filteredEdge = sqrt(0.75 * spread);
  float evenness = min(3.0 * spread, 1.0);
  float correction = 3.0 * evenness * evenness * (1.0 - evenness);
  float edgeFactor = 1.6 * 1.6 * pow(0.125, crispness);

  vec3 color = paper;
  // The lines that come first are on top of the others.
  for (int line = 2; line >= 0; line--) {
    float share = begun[line] / max(total, 1e-6);
    float coverage = 1.0 - pow(max(left[line], 1e-3), share);
    float room = min(coverage, 1.0 - coverage), inner = coverage * (1.0 - coverage);
    float edge = max(max(min(edgeFactor * inner, room), filteredEdge), 0.002);
    float corrected = coverage + correction * inner * (1.0 - 2.0 * coverage);
    float covered = (corrected - texel[line]) / (2.0 * edge) + 0.5;
    // What is narrower than the edge covers no point of it entirely, be it ink or paper.
    float missed = 1.0 - min(room / edge, 1.0), isDark = step(0.5, coverage);
    covered = clamp(covered, isDark * missed, 1.0 - (1.0 - isDark) * missed);
    // No ink at all, and nothing but ink, are exact.
    covered = mix(isDark, covered, min(room / 0.02, 1.0));
    color = mix(color, ink[line], covered);
  }
  gl_FragColor = vec4(color, 1.0);
  #include <colorspace_fragment>
}`;

/**
 * Return the material.
 *
 * @param {THREE.Texture} thresholds  From RoSy; its values are data, and its alpha is no opacity.
 * @param {object} settings  The inputs of the node group by name, such as "Crispness"; linear colors.
 */
export function hatchingMaterial(thresholds, settings) {
  thresholds.colorSpace = THREE.NoColorSpace;
  thresholds.needsUpdate = true;
  const color = (name) => new THREE.Vector3(...settings[name]);
  return new THREE.ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: THREE.DoubleSide,
    uniforms: {
      thresholds: { value: thresholds },
      lightDirection: { value: new THREE.Vector3(0, 1, 0) },
      lightStrength: { value: 1 },
      shading: { value: settings.Shading },
      black: { value: settings.Black },
      white: { value: settings.White },
      gamma: { value: settings.Gamma },
      layers: { value: settings.Layers },
      layering: { value: settings.Layering },
      crispness: { value: settings.Crispness },
      highlights: { value: settings.Highlights },
      inks: { value: ["Ink", "Second Ink", "Third Ink"].map(color) },
      highlightColor: { value: color("Highlight Color") },
      paper: { value: color("Paper") },
    },
  });
}
