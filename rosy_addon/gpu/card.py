"""Bodies and a camera to a picture, on the graphics card: project, compose.

The stages and what flows between them are those of the numpy rooms, on images instead of lists of
pixels. Streamlines are followed from every pixel and line through it: a card has the arithmetic for
that which a processor lacks, so no averages are shared between neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..compositor.anchored import LOWEST, OCTAVES, SIDE, TAPS, identities, lattice_axes
from ..compositor.colour import colour_stops
from ..compositor.compose import noise_of
from ..compositor.contour import IN_FRONT
from ..compositor.contrast import averaging_gain, expected_deviation, streaks_of
from ..compositor.hatching import (
    EARLY,
    JOINING,
    LEAST,
    SWELL,
    Statistics,
    has_pieces,
    has_tooth,
    piece_length,
    runs_on,
    softness,
    statistics_of,
)
from ..compositor.hues import PALETTE, SHARPNESS
from ..compositor.inks import INKS, inks_of
from ..compositor.kernel import whole_samples
from ..compositor.look import Look
from ..compositor.noise import BLUR, DEVIATION, blur_reach, image_noise, streak_statistics
from ..compositor.paper import TEETH, TOOTH, paper_tooth, stretch, surface_tooth
from ..compositor.scale import measured_look, scaled_look, unit_of
from ..compositor.shading import Light, lights_of
from ..compositor.tone import Rendered, curve_of
from ..compositor.waver import EVENED, SWAY, WAVELENGTH, WAVES, wave_table, wavers
from ..errors import RosyError
from ..field.rosy_field import RosyField
from ..progress import Progress, Work, drain, part
from ..projection.camera import Camera
from ..projection.carried import Trait
from ..projection.gbuffer import Body
from ..projection.rest import growth
from ..projection.shadows import OFFSET, WIDTH, light_cameras
from ..projection.steps import OBLIQUE_TOLERANCE, STEEPEST, TOLERANCE
from ..projection.tone import EDGEWISE, Pyramid
from . import passes
from .device import Device
from .passes import GROUP
from .shapes import ROW_BITS, Shape, atlas_of, placement, shape_of, shifting, traits_of

#: The noise is made for whole tiles of so many pixels, so that a frame may grow a little.
TILE = 256

#: Steps of all streamlines that one run of the shader may take: drivers give up on long ones.
MOST_STEPS = 1 << 29

#: So many times may bodies be placed, for all views together, before images that nobody draws in are
#: given up, and shapes that nobody shows: those of an animation are others in every frame.
IMAGES_LAST, SHAPES_LAST = 32, 2

#: How the magnitude of the field drives a look, for the shader.
DRIVES = {"none": 0, "colour": 1, "length": 2, "both": 3}

#: Where tones come from, for the shader.
TONES = {"light": 0, "attribute": 1, "image": 2, "picture": 3}

#: What gives light, for the shader.
SUN, POINT, EYE = 0, 1, 2

#: The longest side of an image that tones are taken from, texels: a tone wants no more.
LARGEST_IMAGE = 2048

#: How much nearer to the eye than the surface its picture is shown, in normalised depth.
NEARER = 2e-5

#: Planes that clip nothing.
NO_PLANES = np.tile([0.0, 0.0, 0.0, 1.0], (6, 1))


@dataclass(frozen=True, eq=False)
class Placed:
    """A body as it is on the card."""

    shape: _OnCard
    field: RosyField | None
    moving: np.ndarray
    grown: float
    kind: Kind | None
    body: Body | None = None


@dataclass(eq=False)
class _OnCard:
    """A shape on the card, and what keeps its key its own."""

    shape: Shape
    batch: Any
    records: Any
    owners: tuple[Any, ...]
    image: Atlas | None = None
    used: int = 0


@dataclass(frozen=True, eq=False)
class Atlas:
    """An image of all sizes on the card (`shapes.atlas_of`).

    Attributes
    ----------
    texture
    size : (int, int)
        Of the largest.
    halved : int
        How often that is halved.
    left_out : int
        How many larger ones there were.
    """

    texture: Any
    size: tuple[int, int]
    halved: int
    left_out: int


@dataclass(frozen=True)
class Kind:
    """Fields of one degree: N, its covering, and what they have besides the representation."""

    degree: int
    layers: tuple[Trait, ...]
    is_paired: bool

    @property
    def deviations(self) -> list[int]:
        """j of the harmonics, which are the first layers; some of them may be 0 all over."""
        return [number for kind, number in self.layers if kind == "deviation"]

    @property
    def lines(self) -> int:
        """M, as `Flow.lines`."""
        return self.degree // 2 if self.is_paired else self.degree

    @property
    def around(self) -> int:
        """Sheets of a full turn, as `covering.sheets_around`."""
        unpaired = self.deviations and self.lines == self.degree
        return self.degree if unpaired else 2 * self.lines

    @property
    def families(self) -> int:
        """How many, and 1 if lines are not told apart."""
        return self.layers[-1][1] if self.layers and self.layers[-1][0] == "family" else 1


def kinds_of(fields: Iterable[RosyField]) -> dict[int, Kind]:
    """The kinds of some fields, by degree."""
    traits: dict[int, list[Trait]] = {}
    for field in fields:
        traits.setdefault(field.degree, []).extend(traits_of(field))
    return {degree: _kind(degree, found) for degree, found in sorted(traits.items())}


def _kind(degree: int, found: Sequence[Trait]) -> Kind:
    """Deviations without a gap, then one trait of families: the first, as in `hues`."""
    orders = [number for kind, number in found if kind == "deviation"]
    layers: list[Trait] = []
    if orders:
        layers = [("deviation", j) for j in range(min(orders), max(orders) + 1)]
    layers += [trait for trait in found if trait[0] == "family"][:1]
    # Of what is there: odd orders that only fill a gap do not part a direction and its opposite.
    return Kind(degree, tuple(layers), degree % 2 == 0 and not any(j % 2 for j in orders))


class Card:
    """What is kept on a device from picture to picture.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    coarseness : (int, int)
        Pixels of a view for one of its picture, each way: while things move, and when they rest.
    sees_others : bool
        Whether it has to be given what hides the fields: a view's depth does that.
    """

    coarseness = 2, 1
    sees_others = False

    def __init__(self, device: Device) -> None:
        self.device = device
        self._shapes: dict[tuple, _OnCard] = {}
        self._images: dict[tuple, Any] = {}
        self._used: dict[tuple, int] = {}
        self._tables: dict[str, tuple[Any, Any]] = {}
        self._drawn = 0

    @property
    def textures(self) -> int:
        """How many are kept."""
        records = sum(entry.records is not None for entry in self._shapes.values())
        images = sum(entry.image is not None for entry in self._shapes.values())
        return records + images + len(self._images) + len(self._tables)

    def release(self) -> None:
        """Let go of everything."""
        for kept in (self._shapes, self._images, self._used, self._tables):
            kept.clear()

    def place(self, bodies: Sequence[Body], display: str) -> list[Placed]:
        """Bring bodies to the card, but for shapes that are there.

        Parameters
        ----------
        bodies : sequence of Body
        display : {"smooth", "flat"}
        """
        self._drawn += 1
        self._forget_unused()
        kinds = kinds_of(body.field for body in bodies if body.field is not None)
        placed = [self._placed(body, display, kinds) for body in bodies]
        unused = self._drawn - SHAPES_LAST
        for key in [key for key, entry in self._shapes.items() if entry.used < unused]:
            del self._shapes[key]
        return placed

    def _placed(self, body: Body, display: str, kinds: dict[int, Kind]) -> Placed:
        linear, moving = placement(body.matrix)
        kind = None if body.field is None else kinds[body.field.degree]
        layers = () if kind is None else kind.layers
        key = id(body.surface), id(body.field), id(body.tone), linear.tobytes(), display, layers
        if key not in self._shapes:
            self._shapes[key] = self._brought(body, linear, display, layers)
        entry = self._shapes[key]
        entry.used = self._drawn
        moving = moving @ shifting(entry.shape.centre)
        return Placed(entry, body.field, moving, growth(body.matrix), kind, body)

    def _brought(
        self, body: Body, linear: np.ndarray, display: str, layers: Sequence[Trait]
    ) -> _OnCard:
        surface, field, tone = body.surface, body.field, body.tone
        shape = shape_of(surface, linear, field, display, layers, tone)
        records = None
        if shape.records is not None:
            height, width = shape.records.shape[:2]
            if height > self.device.largest:
                raise RosyError(
                    f"{surface.name}: {len(surface.triangles)} triangles are too many for this "
                    "graphics card"
                )
            records = self.device.texture(width, height, "RGBA32F", data=shape.records)
        image = self._atlas(tone.pyramid) if shape.toned and tone.image is not None else None
        batch = self.device.batch(shape.corners)
        return _OnCard(shape, batch, records, (surface, field, tone), image)

    def _atlas(self, pyramid: Pyramid) -> Atlas:
        most = min(LARGEST_IMAGE, self.device.largest // 2)
        texels, size, halved = atlas_of(pyramid, most)
        height, width = texels.shape[:2]
        texture = self.device.texture(width, height, "RGBA16F", data=texels)
        return Atlas(texture, size, halved, len(pyramid.levels) - 1 - halved)

    def covered(self, placed: Sequence[Placed], camera: Camera) -> int:
        """How many pixels are looked at to draw bodies, at most."""
        left, bottom, right, top = _around([_window(entry, camera) for entry in placed])
        return (right - left) * (top - bottom)

    def drawing(
        self,
        placed: Sequence[Placed],
        camera: Camera,
        look: Look,
        lights: Sequence[Light] = (),
        planes: np.ndarray | None = None,
        name: Hashable = None,
        rendered: Rendered | None = None,
    ) -> Work[Any]:
        """A picture of bodies, in steps after each of which something else may be drawn.

        Parameters
        ----------
        placed : sequence of Placed
            From `place`, with the look's display.
        camera : Camera
            Of `look.supersampling` times the size of the picture each way.
        look : Look
            Its method does not count: the covering's streamlines are followed.
        lights : sequence of Light
        planes : (6, 4) ndarray, optional
            World space; what is on their negative side is cut away.
        name : hashable
            Pictures of one name and size are drawn over each other.
        rendered : Rendered, optional
            For a look whose tone is that of a picture.

        Returns
        -------
        texture
            (H, W, 4) linear, as `Picture.rgba`. Kept by the card for a while.
        """
        if max(camera.width, camera.height) > self.device.largest:
            raise RosyError(
                f"a picture of {camera.width} x {camera.height} pixels, subpixels counted, is too "
                f"large for this graphics card, which draws up to {self.device.largest}"
            )
        yield Progress(0.0, "finding what is seen")
        look = measured_look(look, camera, [entry.body for entry in placed])
        gbuffer = self._project(placed, camera, NO_PLANES if planes is None else planes)
        whole = look.supersampling == 1
        fine = self._image(("picture", name if whole else None), camera.width, camera.height)
        self.device.clear(fine)
        kinds = sorted({entry.kind for entry in placed} - {None}, key=lambda kind: kind.degree)
        finer = scaled_look(look)
        if look.anchor == "surface":
            noise = self._anchored(placed, camera, noise_of(finer) | unit_of(finer), "noise")
        else:
            noise = self._noise(camera.width, camera.height, look)
        tooth = None
        if has_tooth(look) and look.anchor == "surface":
            wanted = surface_tooth(finer) | unit_of(finer)
            tooth = self._anchored(placed, camera, wanted, "tooth")
        gbuffer["wavering"] = self._wavering(placed, camera, look)
        gbuffer["tones"] = self._tones(placed, camera, look, lights, rendered)
        for number, kind in enumerate(kinds):
            around = _around([_window(entry, camera) for entry in placed if entry.kind == kind])
            if _is_empty(around):
                continue
            work = self._composing(kind, around, camera, look, gbuffer, noise, tooth, fine)
            start, stop = number / len(kinds), (number + 1) / len(kinds)
            yield from part(work, 0.2 + 0.8 * start, 0.2 + 0.8 * stop)
        if whole:
            return fine
        return self._averaged(fine, camera, look.supersampling, name)

    def draw(
        self,
        placed: Sequence[Placed],
        camera: Camera,
        look: Look,
        lights: Sequence[Light] = (),
        planes: np.ndarray | None = None,
        name: Hashable = None,
        rendered: Rendered | None = None,
    ) -> Any:
        """`drawing`, run to its end."""
        return drain(self.drawing(placed, camera, look, lights, planes, name, rendered))

    def show(
        self,
        picture: Any,
        placed: Sequence[Placed],
        camera: Camera,
        planes: np.ndarray | None = None,
        opacity: float = 1.0,
    ) -> None:
        """Draw the surfaces with a picture on them into the view that is being drawn.

        Parameters
        ----------
        picture : texture
            From `drawing`, of any size.
        placed, camera, planes
            As it was drawn with.
        opacity : float
        """
        left, bottom, width, height = self.device.viewport()
        planes = NO_PLANES if planes is None else planes
        constants = {
            "nearer": NEARER,
            "origin": (float(left), float(bottom)),
            "pixels": (picture.width / width, picture.height / height),
            "opacity": opacity,
        }
        batches = [
            (entry.shape.batch, on_clip(entry, camera, planes))
            for entry in placed
            if entry.field is not None
        ]
        self.device.draw_over(passes.SHOW, batches, {"picture": picture}, constants)

    def wait(self) -> None:
        """Until all that was asked for is done."""
        self.device.read(self._palette(), len(PALETTE), 1)

    def read(self, picture: Any, width: int, height: int) -> np.ndarray:
        """(H, W, 4) float32: what `draw` has drawn."""
        return self.device.read(picture, width, height)

    def gbuffer(self, camera: Camera) -> dict[str, np.ndarray]:
        """The G-buffer of what was drawn last, by the names of its images."""
        size = camera.width, camera.height
        return {
            name: self.device.read(self._image(name, *size), *size)
            for name in ("seen", "normals", "values_seen")
        }

    def _project(
        self, placed: Sequence[Placed], camera: Camera, planes: np.ndarray
    ) -> dict[str, Any]:
        """The images of the G-buffer, by their names."""
        width, height = camera.width, camera.height
        seen, depth = self._image("seen", width, height), self._depth(width, height)
        batches = [
            (entry.shape.batch, {"body": float(number), **on_clip(entry, camera, planes)})
            for number, entry in enumerate(placed)
        ]
        shader = passes.SEEN if np.array_equal(planes, NO_PLANES) else passes.SEEN_CUT
        self.device.draw(shader, batches, (seen, depth), {})
        values = self._image("values_seen", width, height)
        self.device.clear(values)
        layers = max((entry.shape.shape.traits for entry in placed), default=0)
        traits = (width, height) if layers else (1, 1)
        images = {
            "normals": self._image("normals", width, height),
            "values_seen": values,
            "slopes": self._image("slopes", width, height),
            "traits_seen": self._image("traits_seen", *traits, layers=max(layers, 1)),
        }
        shared = {
            **_camera_constants(camera),
            "pixels_per_unit": camera.pixels_per_unit,
            "STEEPEST": STEEPEST,
            "TOLERANCE": TOLERANCE,
            "OBLIQUE_TOLERANCE": OBLIQUE_TOLERANCE,
        }
        for number, entry in enumerate(placed):
            if entry.field is None:
                continue
            left, bottom, right, top = box = _window(entry, camera)
            if _is_empty(box):
                continue
            constants = {
                **shared,
                **_body_constants(number, entry, camera),
                "corner": (left, bottom),
                "traits": entry.shape.shape.traits,
                "scale": _scale(entry.moving),
            }
            self.device.compute(
                passes.RESOLVE,
                (right - left, top - bottom),
                {"seen": seen, "triangles": entry.shape.records},
                images,
                constants,
            )
        return images

    def _anchored(
        self, placed: Sequence[Placed], camera: Camera, wanted: dict[str, Any], name: str
    ) -> Any:
        """Noise that stays with the surfaces, as `anchored.surface_noise`; the image of a name."""
        density = wanted["density"]
        width, height = camera.width, camera.height
        raw = self._image("raw_noise", width, height)
        self.device.clear(raw)
        lattice = lattice_axes()
        spread = DEVIATION / np.sqrt(density * (1 - density)) / len(TAPS)
        shared = {
            **_camera_constants(camera),
            **{f"lattice_{axis}": (*row, 0.0) for axis, row in zip("xyz", lattice, strict=True)},
            "amplitude": spread,
            "density": density,
            "bright_below": round(density * 2**24),
            "channels": wanted["channels"],
            "seed": wanted["seed"],
            "least_growth": wanted["smallest"] / wanted["grain"],
            "LOWEST": LOWEST,
            "OCTAVES": OCTAVES,
        }
        names = identities([entry.shape.owners[0].name for entry in placed]).view(np.int32)
        for number, entry in enumerate(placed):
            left, bottom, right, top = box = _window(entry, camera)
            if entry.field is None or _is_empty(box):
                continue
            constants = {
                **shared,
                **_body_constants(number, entry, camera),
                "corner": (left, bottom),
                "unit_of_pixel": wanted["grain"] * SIDE / (camera.pixels_per_unit * entry.grown),
                "unit_of_cell": wanted["grain"] * SIDE * wanted["pixel"] / entry.grown,
                "identity": int(names[number]),
            }
            self.device.compute(
                passes.ANCHORED,
                (right - left, top - bottom),
                {"seen": self._image("seen", width, height), "triangles": entry.shape.records},
                {"raw_noise": raw},
                constants,
            )
        return self._without_clouds(raw, camera, wanted["high_pass"], name)

    def _wavering(self, placed: Sequence[Placed], camera: Camera, look: Look) -> Any:
        """How a hand wavers at each pixel, as `waver.waver`."""
        if not wavers(look):
            return self._palette()
        width, height = camera.width, camera.height
        wavering = self._image("wavering", width, height)
        waves = self._values("waves", None, lambda: wave_table()[None])
        finer = scaled_look(look)
        length, unit = finer.grain * WAVELENGTH, unit_of(finer)
        on_surface = look.anchor == "surface"
        for number, entry in enumerate(placed):
            left, bottom, right, top = box = _window(entry, camera)
            if entry.field is None or _is_empty(box):
                continue
            growing = camera.pixels_per_unit * entry.grown if on_surface else 1.0
            constants = {
                **_camera_constants(camera),
                **_body_constants(number, entry, camera),
                "corner": (left, bottom),
                "on_surface": int(on_surface),
                "unit_of_pixel": length / growing,
                "unit_of_cell": length * unit["pixel"] * on_surface / entry.grown,
                "least_growth": unit["smallest"] / finer.grain,
                "wave_count": WAVES,
                "evened": EVENED * SWAY,
            }
            self.device.compute(
                passes.WAVER,
                (right - left, top - bottom),
                {
                    "seen": self._image("seen", width, height),
                    "triangles": entry.shape.records,
                    "waves": waves,
                },
                {"wavering": wavering},
                constants,
            )
        return wavering

    def _without_clouds(self, raw: Any, camera: Camera, high_pass: float, name: str) -> Any:
        """Noise around its mean, and nothing broad in it: `anchored._broad`."""
        size = camera.width, camera.height
        smooth = raw
        if high_pass:
            reach = blur_reach(BLUR * high_pass)
            for number, along in enumerate(((1, 0), (0, 1)) * 3):
                smoother = self._image(f"smooth {number % 2}", *size)
                self.device.compute(
                    passes.SMOOTH,
                    size,
                    {"rough": smooth},
                    {"smoother": smoother},
                    {"along": along, "reach": reach},
                )
                smooth = smoother
        noise = self._image(name, *size)
        self.device.compute(
            passes.SETTLE,
            size,
            {"raw_noise": raw, "smooth_noise": smooth},
            {"noise": noise},
            {"high_passed": int(high_pass > 0)},
        )
        return noise

    def _composing(
        self,
        kind: Kind,
        window: tuple[int, int, int, int],
        camera: Camera,
        look: Look,
        gbuffer: dict[str, Any],
        noise: Any,
        tooth: Any,
        picture: Any,
    ) -> Work[None]:
        """Draw the fields of one kind into the picture."""
        width, height = camera.width, camera.height
        left, bottom, right, top = window
        size = right - left, top - bottom
        covering = {
            **_camera_constants(camera),
            "corner": (left, bottom),
            "degree": kind.degree,
            "lines": kind.lines,
            "around": kind.around,
            "guiding_angle": look.guiding_angle,
        }
        cells = self._image("cells", width, height)
        ways = self._image("ways", width, height, "RGBA16F", kind.lines)
        turning = self._image("turning", width, height, "RGBA16F", kind.lines)
        deviations = kind.deviations
        self.device.compute(
            passes.FLOW,
            size,
            {**gbuffer, "noise": noise},
            {"cells": cells, "ways": ways},
            {
                **covering,
                "to_pixels": _to_pixels(camera),
                "aligned": -2.0 if look.cross_creases else float(np.cos(look.crease_angle)),
                "foreshorten": int(look.foreshorten),
                "harmonics": len(deviations),
                "lowest": deviations[0] if deviations else 0,
                "wobble": look.wobble if wavers(look) else 0.0,
            },
        )
        read = {"cells": cells, "ways": ways}
        self.device.compute(
            passes.TURNING, (*size, kind.lines), read, {"turning": turning}, covering
        )
        drives = DRIVES[look.magnitude]
        textures = {
            **gbuffer,
            "cells": cells,
            "turning": turning,
            "largest": self._largest(gbuffer["values_seen"], width, height, kind.degree)
            if drives and not look.magnitude_range
            else cells,
            "colours": self._table(
                "colours", look.colour_map, lambda: colour_stops(look.colour_map)
            ),
            "palette": self._palette(),
            "thresholds": self._thresholds(scaled_look(look)),
            "inks": self._inks(kind, look),
            "tooth": self._tooth(width, height, look, kind.lines) if tooth is None else tooth,
        }
        constants = {**covering, **_look_constants(kind, look)}
        steps = size[0] * kind.lines * 2 * constants["walk_length"]
        # Whole groups: the last one of any other number would reach past what was prepared here.
        rows = max(MOST_STEPS // max(steps, 1) // GROUP[1], 1) * GROUP[1]
        for start in range(bottom, top, rows):
            constants["corner"] = (left, start)
            band = size[0], min(rows, top - start)
            self.device.compute(passes.WALK, band, textures, {"picture": picture}, constants)
            yield Progress((start + rows - bottom) / (top - bottom), "following streamlines")

    def _tones(
        self,
        placed: Sequence[Placed],
        camera: Camera,
        look: Look,
        lights: Sequence[Light],
        rendered: Rendered | None,
    ) -> Any:
        """How light each pixel is to be: `tone.tone_of`."""
        width, height = camera.width, camera.height
        tones = self._image("tones", width, height)
        shared = {
            **_camera_constants(camera),
            **_tone_constants(look, camera, rendered),
        }
        taken = None if rendered is None else self._taken(rendered)
        lit = self._lit(placed, camera, look, lights)
        for number, entry in enumerate(placed):
            left, bottom, right, top = box = _window(entry, camera)
            if entry.field is None or _is_empty(box):
                continue
            atlas = entry.shape.image if look.tone == "image" else taken
            own = look.tone == "picture" or entry.shape.shape.toned
            level = 0
            if atlas is not None:
                level = atlas.halved
                if look.tone == "picture":
                    wanted = round(rendered.level_for(camera)) - atlas.left_out
                    level = min(max(wanted, 0), atlas.halved)
            constants = {
                **shared,
                **_body_constants(number, entry, camera),
                "corner": (left, bottom),
                "origin_of_tone": TONES[look.tone] if own else 0,
                "image_size": (1, 1) if atlas is None else atlas.size,
                "image_level": level,
            }
            textures = {
                "seen": self._image("seen", width, height),
                "normals": self._image("normals", width, height),
                "triangles": entry.shape.records,
                "lit": lit,
                "shown": lit if atlas is None else atlas.texture,
            }
            size = right - left, top - bottom
            self.device.compute(passes.TONE, size, textures, {"tones": tones}, constants)
        return tones

    def _taken(self, rendered: Rendered) -> Atlas:
        """A picture on the card."""
        kept = self._tables.get("rendered")
        if kept is None or kept[0] is not rendered:
            kept = self._tables["rendered"] = rendered, self._atlas(rendered.pyramid)
        return kept[1]

    def _lit(
        self,
        placed: Sequence[Placed],
        camera: Camera,
        look: Look,
        lights: Sequence[Light],
    ) -> Any:
        """The light of all lamps together: `shading.diffuse`, in full."""
        width, height = camera.width, camera.height
        around = _around([_window(entry, camera) for entry in placed if entry.field is not None])
        left, bottom, right, top = around
        size = right - left, top - bottom
        images = [self._image(f"lit {number}", width, height) for number in range(2)]
        normals = self._image("normals", width, height)
        shared = {**_camera_constants(camera), "corner": (left, bottom)}
        for number, light in enumerate(_light_constants(look, lights)):
            if _is_empty(around):
                break
            reach = normals
            if look.shadows and light["kind"] != EYE:
                reach = self._reach(placed, camera, light, around)
            constants = {
                **shared,
                **light,
                "shadowed": int(reach is not normals),
                "first_time": int(number == 0),
            }
            textures = {"normals": normals, "reach": reach, "lit_before": images[1]}
            self.device.compute(passes.LIT, size, textures, {"lit": images[0]}, constants)
            images.reverse()
        return images[1]

    def _reach(
        self, placed: Sequence[Placed], camera: Camera, light: dict[str, Any], around: Box
    ) -> Any:
        """The share of a light that nothing keeps from the pixels: `shadows.reached`."""
        width, height = camera.width, camera.height
        left, bottom, right, top = around
        kind = "sun" if light["kind"] == SUN else "point"
        vector = np.array(light["source"][:3])
        images = [self._image(f"reach {one}", width, height, "RGBA16F") for one in range(2)]
        lamps = light_cameras([entry.body for entry in placed], camera, kind, vector)
        for number, lamp in enumerate(lamps):
            side = lamp.width
            shadow = self._image("shadow", side, side)
            batches = [(entry.shape.batch, _shadow_constants(entry, lamp)) for entry in placed]
            self.device.draw(passes.SHADOW, batches, (shadow, self._depth(side, side)), {})
            constants = {
                **_camera_constants(camera),
                **_lamp_constants(lamp, camera),
                "corner": (left, bottom),
                "first_time": int(number == 0),
            }
            textures = {
                "normals": self._image("normals", width, height),
                "shadow": shadow,
                "reach_before": images[1],
            }
            size = right - left, top - bottom
            self.device.compute(passes.REACH, size, textures, {"reach": images[0]}, constants)
            images.reverse()
        return images[1]

    def _averaged(self, fine: Any, camera: Camera, side: int, name: Hashable) -> Any:
        width, height = camera.width // side, camera.height // side
        picture = self._image(("picture", name), width, height)
        self.device.compute(
            passes.AVERAGE, (width, height), {"fine": fine}, {"picture": picture}, {"side": side}
        )
        return picture

    def _largest(self, values: Any, width: int, height: int, degree: int) -> Any:
        """A texture of one texel: the largest magnitude of the fields of a degree."""
        number, first = 0, 1
        while (width, height) != (1, 1) or first:
            width, height = -(-width // 16), -(-height // 16)
            tiles = self._image(f"tiles {number}", width, height)
            self.device.compute(
                passes.LARGEST,
                (width, height),
                {"magnitudes": values},
                {"tiles": tiles},
                {"degree": degree, "first_time": first},
            )
            values, number, first = tiles, number + 1, 0
        return values

    # --- what is kept on the device -------------------------------------------------------------

    def _image(
        self, name: Hashable, width: int, height: int, kind: str = "RGBA32F", layers: int = 0
    ) -> Any:
        """The image of a name and size."""
        key = name, width, height, kind, layers
        return self._kept(key, lambda: self.device.texture(width, height, kind, layers))

    def _depth(self, width: int, height: int) -> Any:
        return self._kept(("depth", width, height), lambda: self.device.depth(width, height))

    def _kept(self, key: tuple, make: Callable[[], Any]) -> Any:
        if key not in self._images:
            self._images[key] = make()
        self._used[key] = self._drawn
        return self._images[key]

    def _forget_unused(self) -> None:
        """Let go of images of sizes that nobody has drawn in for a while."""
        for key in [key for key, used in self._used.items() if used < self._drawn - IMAGES_LAST]:
            del self._images[key], self._used[key]

    def _palette(self) -> Any:
        """`hues.PALETTE`, which also stands where a shader looks into nothing."""
        return self._table("palette", None, lambda: PALETTE)

    def _table(self, name: str, key: Any, make: Callable[[], np.ndarray]) -> Any:
        """A row of colours as a texture, made anew if its key is another."""

        def row() -> np.ndarray:
            rgb = np.asarray(make(), dtype=np.float32)
            return np.concatenate([rgb, np.ones_like(rgb[:, :1])], axis=1)[None]

        return self._values(name, key, row)

    def _thresholds(self, look: Look) -> Any:
        """`hatching.ink_statistics` in the first channel."""
        if look.ink == "soft":
            return self._palette()
        threshold = statistics_of(look).threshold
        return self._table(
            "thresholds", threshold.tobytes(), lambda: np.repeat(threshold[:, None], 3, axis=1)
        )

    def _inks(self, kind: Kind, look: Look) -> Any:
        """`inks.Inks`: in the shadows, then between, then in the lights."""
        count = _ink_count(kind, look)
        found = inks_of(look, count)
        stops = np.concatenate([found.dark, found.middle, found.light])
        return self._table("inks", stops.tobytes(), lambda: stops)

    def _tooth(self, width: int, height: int, look: Look, lines: int) -> Any:
        """`paper.paper_tooth` in the first channel, for a frame of this size and so many lines."""
        if not has_tooth(look):
            return self._palette()
        width = width // look.supersampling + (lines - 1) * stretch(look.grain)
        width, height = (-(-length // TILE) * TILE for length in (width, height))
        key = look.grain, look.seed
        kept = self._tables.get("tooth")
        if kept is None or kept[0][0] != key or width > kept[0][1] or height > kept[0][2]:
            pixel = np.arange(width * height, dtype=np.int32)
            data = np.zeros((height, width, 4), dtype=np.float32)
            heights = paper_tooth(pixel, width, look.grain, look.seed)
            data[:, :, 0] = heights.reshape(height, width)
            texture = self.device.texture(width, height, "RGBA32F", data=data)
            kept = self._tables["tooth"] = (key, width, height), texture
        return kept[1]

    def _values(self, name: str, key: Any, make: Callable[[], np.ndarray]) -> Any:
        """(H, W, 4) numbers as a texture, made anew if its key is another."""
        if name not in self._tables or self._tables[name][0] != key:
            data = make()
            texture = self.device.texture(data.shape[1], data.shape[0], "RGBA32F", data=data)
            self._tables[name] = key, texture
        return self._tables[name][1]

    def _noise(self, width: int, height: int, look: Look) -> Any:
        """Noise for a frame of this size at least: it is the same for all of them."""
        wanted = noise_of(scaled_look(look))
        channels = wanted["channels"]
        kept = self._tables.get("noise")
        if kept is None or kept[0][0] != wanted or width > kept[0][1] or height > kept[0][2]:
            width, height = (-(-side // TILE) * TILE for side in (width, height))
            pixel = np.arange(width * height, dtype=np.int32)
            data = np.zeros((height, width, 4), dtype=np.float32)
            found = image_noise(pixel, width, **wanted)
            data[:, :, :channels] = found.reshape(height, width, channels)
            texture = self.device.texture(width, height, "RGBA32F", data=data)
            kept = self._tables["noise"] = ((wanted, width, height), texture)
        return kept[1]


def on_clip(entry: Placed, camera: Camera, planes: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Where a body's corners lie in clip space, and beside which planes, as a shader takes it."""
    clip = camera.projection @ camera.view @ entry.moving
    constants = {f"clip_{axis}": tuple(row) for axis, row in zip("xyzw", clip, strict=True)}
    own = np.asarray(planes) @ entry.moving
    constants.update({f"plane{number}": tuple(row) for number, row in enumerate(own)})
    return constants


def _camera_constants(camera: Camera) -> dict[str, Any]:
    projection = camera.projection
    shift = projection[:2, 2] if camera.is_perspective else -projection[:2, 3]
    return {
        "across": tuple(camera.across_axis.ravel()),
        "shift": tuple(shift),
        "perspective": int(camera.is_perspective),
    }


def _to_pixels(camera: Camera) -> tuple[float, ...]:
    """As in `steps.screen_axes`."""
    across = camera.projection[:2, :2] * [[camera.width], [camera.height]]
    return tuple((across / (2 * camera.pixels_per_unit)).ravel())


def _look_constants(kind: Kind, look: Look) -> dict[str, Any]:
    """What of a look is told to the shader that walks, lengths in the pixels of the fine frame."""
    finer = scaled_look(look)
    _, crossing = streak_statistics(*streaks_of(finer), kind.lines, tapered=look.taper)
    gain = averaging_gain(finer) if look.supersampling > 1 else 1.0
    inks = inks_of(look, _ink_count(kind, look))
    statistics = statistics_of(finer) if look.ink == "hatch" else None
    return {
        "walk_length": finer.length,
        "taper": int(look.taper),
        "whole_samples": whole_samples(finer),
        "step_length": finer.step,
        "grain": finer.grain,
        "crossing": crossing,
        "gain": look.gain * gain,
        "channels": noise_of(finer)["channels"],
        "families": kind.families if look.hue == "families" else 1,
        "family_layer": len(kind.layers) - 1,
        "sharpness": SHARPNESS / expected_deviation(finer),
        "magnitude_drives": DRIVES[look.magnitude],
        "largest_known": look.magnitude_range,
        "paper_light": (*inks.paper, 1.0),
        "ink_count": len(inks.dark),
        "ink_turn": inks.turn,
        "ink_floor": inks.floor,
        "hatch": int(look.ink == "hatch"),
        "light_ink": int(inks.is_light),
        "clear_paper": int(look.clear_paper),
        "layers": look.layers,
        "layering": look.layering,
        "softness": softness(look.crispness),
        "deviation": statistics.deviation if statistics else 1.0,
        "breaks": look.breaks,
        "piece_length": piece_length(finer) if has_pieces(look) else 0,
        "run_on": max(round(finer.overshoot / finer.step), 1) if runs_on(look) else 0,
        "outline": finer.outline,
        "IN_FRONT": IN_FRONT,
        "piece_samples": whole_samples(replace(finer, length=piece_length(finer))),
        "piece_deviation": statistics.piece_deviation if statistics else 1.0,
        "wobble": look.wobble if wavers(look) else 0.0,
        "SWELL": SWELL,
        "tooth_depth": _tooth_depth(look, statistics),
        "teeth": TEETH if look.anchor == "surface" else 0,
        "tooth_stretch": stretch(look.grain),
        "subpixels": look.supersampling,
        "JOINING": JOINING,
        "EARLY": EARLY,
        "LEAST": LEAST,
    }


def _tooth_depth(look: Look, statistics: Statistics | None) -> float:
    if statistics is None or not has_tooth(look):
        return 0.0
    return TOOTH * look.paper_grain / statistics.tooth_deviation


def _ink_count(kind: Kind, look: Look) -> int:
    """Of how many inks lines are drawn, as `hatching.families_of_ink`."""
    if look.ink == "soft" or look.hue == "one" or look.magnitude in ("colour", "both"):
        return 1
    return min(kind.families if kind.families > 1 else kind.lines, INKS)


def _light_constants(look: Look, lights: Sequence[Light]) -> list[dict[str, Any]]:
    """What gives light, as the shader takes it; something that gives none if nothing does."""
    if look.light == "headlight":
        return [{"kind": EYE, "source": (0.0,) * 4, "colour": (1.0,) * 4}]
    found = [
        {
            "kind": SUN if light.kind == "sun" else POINT,
            "source": (*np.asarray(light.vector, dtype=float), 0.0),
            "colour": (*np.asarray(light.colour) * light.strength, 1.0),
        }
        for light in lights_of(look, lights)
    ]
    return found or [{"kind": EYE, "source": (0.0,) * 4, "colour": (0.0,) * 4}]


def _tone_constants(look: Look, camera: Camera, rendered: Rendered | None) -> dict[str, Any]:
    """What a look says about tones, as the shader takes it."""
    scale, black = curve_of(look)
    taken = np.zeros((4, 4)) if rendered is None else rendered.between(camera)
    return {
        "pixels_per_unit": camera.pixels_per_unit,
        "shading": look.shading,
        "tone_bends_light": int(look.tone == "light"),
        "tone_lit": int(look.tone_lit),
        "curve_black": black,
        "curve_scale": scale,
        "curve_power": 1 / look.tone_gamma,
        **{f"taken_{axis}": tuple(taken[row]) for axis, row in zip("xyw", (0, 1, 3), strict=True)},
        "EDGEWISE": EDGEWISE,
    }


def _shadow_constants(entry: Placed, lamp: Camera) -> dict[str, Any]:
    """Where a body's corners lie in the view of a lamp, and how far away."""
    clip = lamp.projection @ lamp.view @ entry.moving
    constants = {f"clip_{axis}": tuple(row) for axis, row in zip("xyzw", clip, strict=True)}
    return {**constants, "ahead": tuple(-(lamp.view @ entry.moving)[2])}


def _lamp_constants(lamp: Camera, camera: Camera) -> dict[str, Any]:
    """From the space of a camera to the view of a lamp."""
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = turn.T, -turn.T @ shift
    place = lamp.view @ back
    return {
        **{f"lamp_{axis}": tuple(row) for axis, row in zip("xyz", place[:3], strict=True)},
        **{f"lens_{axis}": tuple(row) for axis, row in zip("xy", lamp.projection[:2], strict=True)},
        "lamp_perspective": int(lamp.is_perspective),
        "offset_of_pixel": OFFSET / lamp.pixels_per_unit,
        "WIDTH": WIDTH,
    }


def _body_constants(number: int, entry: Placed, camera: Camera) -> dict[str, Any]:
    """What passes over the pixels of one body are told."""
    place = camera.view @ entry.moving
    return {
        "body": float(number),
        "texels": entry.shape.shape.texels,
        "row_bits": ROW_BITS,
        **{f"place_{axis}": tuple(row) for axis, row in zip("xyz", place[:3], strict=True)},
    }


def _scale(moving: np.ndarray) -> float:
    """By how much a matrix that turns, scales and shifts scales."""
    return float(np.linalg.norm(moving[:3, 0]))


Box = tuple[int, int, int, int]


def _window(entry: Placed, camera: Camera) -> Box:
    """Left, bottom, right and top of the pixels that a body may cover."""
    points = np.concatenate([entry.shape.shape.bounds, np.ones((8, 1))], axis=1)
    clip = points @ (camera.projection @ camera.view @ entry.moving).T
    behind = clip[:, 2] < -clip[:, 3]
    if behind.all():
        return 0, 0, 0, 0
    if behind.any() or (clip[:, 3] <= 0).any():
        return 0, 0, camera.width, camera.height
    ends = clip[:, :2] / clip[:, 3:] * 0.5 + 0.5
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(ends.min(axis=0) * size), 0, size).astype(int)
    high = np.clip(np.ceil(ends.max(axis=0) * size), 0, size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _is_empty(box: Box) -> bool:
    left, bottom, right, top = box
    return left >= right or bottom >= top


def _around(boxes: Iterable[Box]) -> Box:
    """What holds some boxes; those that are empty have no say."""
    boxes = [box for box in boxes if not _is_empty(box)]
    if not boxes:
        return 0, 0, 0, 0
    left, bottom, right, top = zip(*boxes, strict=True)
    return min(left), min(bottom), max(right), max(top)
