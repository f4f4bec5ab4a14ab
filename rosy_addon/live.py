"""The live view: every redraw of a 3D view shows the fields of what is seen, nothing is baked.

A view is drawn when Blender draws it, over what Blender has drawn, where the surfaces are in front.
What is drawn is found when it is drawn: handlers only note what has changed. While things move the
picture may be coarser, as much as it takes to keep up; when they rest it is made again in full, a
slice of work a redraw.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import blf
import bpy
import numpy as np

from .bake import undefined_of
from .compositor.look import Look
from .compositor.shading import Light
from .compositor.tone import Rendered
from .errors import DeviceError, RosyError
from .gpu.card import NO_PLANES, Card
from .gpu.device import blender_device
from .gpu.processor import Processor
from .progress import Work, drain
from .projection.camera import Camera
from .scene.cameras import camera_of_view, render_camera
from .scene.following import Followed, Follower
from .scene.lights import read_lights
from .scene.looks import look_of
from .scene.tones import check_tones, file_luminance, read_rendered, rendered_path, tone_wish

#: Seconds that a redraw may take while things move, and a slice of the picture that is made after.
BUDGET, SLICE = 0.06, 0.08

#: Seconds after which things are at rest.
REST = 0.12

#: Seconds without work on it after which a picture is left to itself.
LEFT = 1.0

#: What a picture of half the size each way costs, streaks of half the length, of one in full.
COARSE_COST = 0.2

#: Seconds for which a message stands in a view.
TOLD = 10.0

#: The picture is a little transparent over what is being edited.
OPACITY, OPACITY_IN_EDIT_MODE = 1.0, 0.7

#: Methods that Blender is asked to call later.
TIMERS = ("_watch", "_wake", "_learn", "_fetch")

#: Changes of these may change a picture.
CONCERNED = ("OBJECT", "MESH", "COLLECTION", "SCENE", "LIGHT", "ARMATURE", "KEY", "IMAGE")


@dataclass(eq=False)
class _View:
    """One region of one 3D view, and what is shown there.

    Attributes
    ----------
    shown : texture or None
        The picture that is there.
    shows : hashable
        What it is a picture of.
    coarseness : int
        Pixels of the view for one of the picture, each way.
    wanted : hashable
        What was asked for last, and when.
    work : generator or None
        The picture that is being made.
    works_on, worked_at
        What it is a picture of, and when it was worked on last, in seconds.
    """

    shown: Any = None
    shows: Hashable = None
    coarseness: int = 1
    wanted: Hashable = None
    since: float = 0.0
    work: Work[Any] | None = None
    works_on: Hashable = None
    worked_at: float = 0.0

    @property
    def is_being_made(self) -> bool:
        """Whether work on what is wanted goes on: a view that is not on a screen has stopped."""
        return self.works_on == self.wanted and time.monotonic() < self.worked_at + LEFT


@dataclass(eq=False)
class _Layer:
    """A view layer of a scene: its objects as they were read last, and what was asked for then."""

    follower: Follower = field(default_factory=Follower)
    found: list[Followed] = field(default_factory=list)
    stale: bool = True
    asked: Hashable = None


class Live:
    """All live views, and all that Blender holds for them.

    Once `stop` has been called nothing of it is left: no handler, no timer, no texture.
    """

    def __init__(self, device: str = "auto") -> None:
        self.maker = _maker(device)
        self.spaces: set[int] = set()
        self.why_not: str | None = None
        self.why_slow: str | None = None
        self._told_at = 0.0
        self._views: dict[tuple[int, int], _View] = {}
        self._layers: dict[tuple[str, str], _Layer] = {}
        self._busy = False
        self._refining: _View | None = None
        #: Pictures that tones come from, or why they cannot be read, by file and its time.
        self._files: dict[Hashable, np.ndarray | RosyError | None] = {}
        self._rendered: tuple[Hashable, Rendered | None] = None, None
        #: Seconds that a million pixels take.
        self._cost = 0.0
        self._drawing = [
            bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW"),
            bpy.types.SpaceView3D.draw_handler_add(self._draw_text, (), "WINDOW", "POST_PIXEL"),
        ]
        self._handlers: list[tuple[list, Callable[..., None]]] = []
        handlers = bpy.app.handlers
        for where, handler in (
            (handlers.depsgraph_update_post, self._on_update),
            (handlers.frame_change_post, self._on_update),
            (handlers.undo_post, self._on_undo),
            (handlers.redo_post, self._on_undo),
            (handlers.load_pre, self._on_load),
        ):
            where.append(handler)
            self._handlers.append((where, handler))
        # Blender knows timers by the object; a method is another one each time it is looked up.
        self._timers = {name: getattr(self, name) for name in TIMERS}
        self._after(1.0, "_watch")

    # --- switching -------------------------------------------------------------------------------

    def add(self, space: bpy.types.SpaceView3D) -> None:
        """Make a view live."""
        self.spaces.add(space.as_pointer())
        redraw()

    def remove(self, space: int) -> None:
        """Let a view be as it was, given its pointer."""
        self.spaces.discard(space)
        for key in [key for key in self._views if key[0] == space]:
            del self._views[key]
        redraw()

    def stop(self) -> None:
        """Let go of everything."""
        for handler in self._drawing:
            bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
        for where, handler in self._handlers:
            where.remove(handler)
        for timer in self._timers.values():
            if bpy.app.timers.is_registered(timer):
                bpy.app.timers.unregister(timer)
        self._drawing, self._handlers = [], []
        self._views.clear()
        self._layers.clear()
        self.spaces.clear()
        self.maker.release()
        redraw()

    # --- what Blender tells ----------------------------------------------------------------------

    def _on_update(
        self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None
    ) -> None:
        if self._busy:
            return
        updates = () if depsgraph is None else depsgraph.updates
        moved, remade = set(), set()
        concerned = False
        for update in updates:
            changed = update.id.original
            if changed.id_type not in CONCERNED:
                continue
            concerned = True
            if changed.id_type == "IMAGE":
                moved |= {t.name for t in bpy.data.objects if t.rosy.tone_image == changed}
            if not update.is_updated_geometry:
                continue
            if changed.id_type == "MESH":
                remade |= {t.name for t in bpy.data.objects if t.data == changed}
            elif changed.id_type == "OBJECT":
                moved.add(changed.name)
        for (name, _), layer in self._layers.items():
            if name == scene.name and (concerned or depsgraph is None):
                layer.follower.forget(moved, faces=False)
                layer.follower.forget(remade)
                layer.stale = True

    def _on_undo(self, *_: Any) -> None:
        self._layers.clear()

    def _on_load(self, *_: Any) -> None:
        stop()

    def _watch(self) -> float | None:
        """Notice views that are gone."""
        there = {space.as_pointer() for space in _all_spaces()}
        for space in self.spaces - there:
            self.remove(space)
        if self.spaces:
            return 1.0
        stop()
        return None

    def _wake(self) -> float | None:
        """Have Blender redraw while pictures are to be made."""
        redraw(self.spaces)
        return None

    def _after(self, seconds: float, name: str) -> None:
        """Have a method called, unless it will be anyway."""
        timer = self._timers[name]
        if not bpy.app.timers.is_registered(timer):
            bpy.app.timers.register(timer, first_interval=seconds)

    def _learn(self) -> None:
        """Find out what cannot be found while Blender draws."""
        self._busy = True
        try:
            for window in bpy.context.window_manager.windows:
                layer = self._layers.get((window.scene.name, window.view_layer.name))
                if layer is None or not layer.follower.is_behind:
                    continue
                with bpy.context.temp_override(window=window):
                    depsgraph = bpy.context.evaluated_depsgraph_get()
                    layer.follower.learn(depsgraph, undefined_of(window.scene))
                layer.stale = True
        finally:
            self._busy = False
        redraw(self.spaces)

    def _fetch(self) -> None:
        """Read the pictures that tones come from: Blender may not load files while it draws."""
        for stamp in [stamp for stamp, found in self._files.items() if found is None]:
            try:
                self._files[stamp] = file_luminance(stamp[0])
            except RosyError as error:
                self._files[stamp] = error
        redraw(self.spaces)

    # --- drawing ---------------------------------------------------------------------------------

    def _draw(self) -> None:
        context = bpy.context
        space, region = context.space_data, context.region
        if space.as_pointer() not in self.spaces or not _shows_surfaces(space):
            return
        self.why_not = None
        try:
            self._draw_view(context, space, region)
        except DeviceError as error:
            self._do_without(error)
        except RosyError as error:
            self.why_not = str(error)

    def _do_without(self, error: DeviceError) -> None:
        """Go on without a card that does not take the shaders."""
        self.maker, self.why_slow = Processor(blender_device()), str(error)
        self._told_at = time.monotonic()
        self._views.clear()
        self._refining, self._cost = None, 0.0
        for layer in self._layers.values():
            layer.stale = True
        self._after(0.0, "_wake")

    def _draw_view(
        self,
        context: bpy.types.Context,
        space: bpy.types.SpaceView3D,
        region: bpy.types.Region,
    ) -> None:
        depsgraph = context.evaluated_depsgraph_get()
        look = look_of(context.scene.rosy)
        layer = self._read(context, depsgraph, look)
        camera = camera_of_view(region, context.region_data)
        seen = [entry for entry in layer.found if _is_visible(entry.shown_by, depsgraph, space)]
        if all(entry.body.field is None for entry in seen):
            return
        drawn = [entry for entry in seen if entry.body.field is not None]
        wish = tone_wish(context.scene, look)
        check_tones(wish, [(entry.body.tone, entry.owner) for entry in drawn])
        rendered = self._picture(context.scene, depsgraph, look)
        if look.tone == "picture" and rendered is None:
            return  # until it has been fetched
        placed = self.maker.place([entry.body for entry in seen], look.display)
        planes = _planes(context.region_data)
        lights = read_lights(depsgraph, camera.view) if look.light == "scene" else []
        view = self._views.setdefault((space.as_pointer(), region.as_pointer()), _View())
        wanted = (
            tuple(entry.number for entry in seen),
            camera.view.tobytes(),
            camera.projection.tobytes(),
            (camera.width, camera.height),
            look,
            planes.tobytes(),
            _key_of(lights),
            rendered,
        )
        self._make(view, wanted, placed, camera, look, lights, planes, rendered)
        if view.shown is not None:
            editing = context.mode.startswith("EDIT")
            opacity = OPACITY_IN_EDIT_MODE if editing else OPACITY
            self.maker.show(view.shown, placed, camera, planes, opacity)

    def _picture(
        self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, look: Look
    ) -> Rendered | None:
        """The picture that the tone comes from, the same as long as it is the same; None if it does
        not come from one, or that has yet to be fetched."""
        if look.tone != "picture":
            return None
        path = rendered_path(scene)
        stamp = path, _time_of(path)
        if stamp not in self._files:
            self._files = {stamp: None}
            self._after(0.0, "_fetch")
        found = self._files[stamp]
        if isinstance(found, RosyError):
            raise found
        if found is None:
            return None
        made = read_rendered(scene, depsgraph, render_camera(scene), look, found)
        key = stamp, made.camera.view.tobytes(), made.camera.projection.tobytes()
        if self._rendered[0] != key:
            self._rendered = key, made
        return self._rendered[1]

    def _read(
        self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, look: Look
    ) -> _Layer:
        key = context.scene.name, context.view_layer.name
        layer = self._layers.setdefault(key, _Layer())
        others = self.maker.sees_others or look.shadows
        asked = others, tone_wish(context.scene, look)
        if layer.stale or layer.asked != asked:
            layer.found = layer.follower.read(
                depsgraph, undefined_of(context.scene), others=others, wish=asked[1]
            )
            layer.stale, layer.asked = False, asked
            if layer.follower.is_behind:
                self._after(0.0, "_learn")
        return layer

    def _make(
        self,
        view: _View,
        wanted: Hashable,
        placed: list[Any],
        camera: Camera,
        look: Look,
        lights: list[Light],
        planes: np.ndarray,
        rendered: Rendered | None,
    ) -> None:
        """Bring a view's picture up to date, as far as there is time for it."""
        now = time.monotonic()
        if wanted != view.wanted:
            view.wanted, view.since = wanted, now
        coarse, fine = self.maker.coarseness
        if view.shows == wanted and view.coarseness == fine:
            return
        amount = self.maker.covered(placed, camera) * look.supersampling**2 / (1e6 * fine**2)

        def drawing(coarseness: int) -> Work[Any]:
            name = id(view), coarseness
            return self._drawing_of(
                placed, camera, look, lights, planes, name, coarseness, rendered
            )

        if self._cost * amount <= BUDGET:
            self._finish(view, wanted, drawing(fine), fine, amount)
        elif view.shows != wanted:
            self._finish(view, wanted, drawing(coarse), coarse, amount * COARSE_COST)
            self._after(REST, "_wake")
        elif now - view.since < REST:
            self._after(REST, "_wake")
        else:
            self._refine(view, wanted, lambda: drawing(fine))

    def _drawing_of(
        self,
        placed: list[Any],
        camera: Camera,
        look: Look,
        lights: list[Light],
        planes: np.ndarray,
        name: Hashable,
        coarseness: int,
        rendered: Rendered | None,
    ) -> Work[Any]:
        if coarseness > 1:
            look = look.with_settings(_coarser(look, coarseness))
            width, height = camera.width // coarseness, camera.height // coarseness
            camera = camera.resized(max(width, 1), max(height, 1))
        fine = camera.scaled(look.supersampling)
        return self.maker.drawing(placed, fine, look, lights, planes, name, rendered)

    def _finish(
        self, view: _View, wanted: Hashable, work: Work[Any], coarseness: int, amount: float
    ) -> None:
        """Make a picture at once, and learn how long one takes."""
        self._refining = None
        start = time.monotonic()
        view.shown = drain(work)
        self.maker.wait()
        taken = time.monotonic() - start
        # What is compiled or uploaded once counts little in the long run.
        cost = taken / max(amount, 0.02)
        self._cost = cost if not self._cost else min(cost, 0.5 * (self._cost + cost))
        view.shows, view.coarseness, view.work = wanted, coarseness, None

    def _refine(self, view: _View, wanted: Hashable, start: Callable[[], Work[Any]]) -> None:
        """Go on with a picture in full, for a slice of time."""
        other = self._refining
        if other in self._views.values() and other is not view and other.is_being_made:
            self._after(0.0, "_wake")  # one at a time: they share the images of the card
            return
        if other is not view or view.works_on != wanted or view.work is None:
            view.work, view.works_on = start(), wanted
            self._refining = view
        until = time.monotonic() + SLICE
        try:
            while time.monotonic() < until:
                next(view.work)
                self.maker.wait()
        except StopIteration as done:
            view.shown, view.shows = done.value, wanted
            view.coarseness = self.maker.coarseness[1]
            view.work = self._refining = None
            return
        view.worked_at = time.monotonic()
        self._after(0.0, "_wake")

    def _draw_text(self) -> None:
        """Say why a field is not drawn, in a corner of the view."""
        context = bpy.context
        if context.space_data.as_pointer() not in self.spaces:
            return
        layer = self._layers.get((context.scene.name, context.view_layer.name))
        lines = list(layer.follower.errors.values())[:4] if layer else []
        if self.why_not:
            lines.insert(0, self.why_not)
        if self.why_slow and time.monotonic() < self._told_at + TOLD:
            lines.insert(0, f"drawn on the processor, at reduced size: {self.why_slow}")
        scale = context.preferences.system.ui_scale
        blf.size(0, 12 * scale)
        blf.color(0, 1.0, 0.6, 0.2, 1.0)
        for number, line in enumerate(lines):
            blf.position(0, 16 * scale, (64 + 18 * number) * scale, 0)
            blf.draw(0, f"RoSy: {line}")


def _shows_surfaces(space: bpy.types.SpaceView3D) -> bool:
    return space.shading.type in {"SOLID", "MATERIAL", "RENDERED"}


def _is_visible(
    thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D
) -> bool:
    """Whether a view shows an object as a surface."""
    try:
        # In some versions only the evaluated object knows which local views it is in.
        evaluated = thing.evaluated_get(depsgraph)
        solid = thing.display_type not in {"BOUNDS", "WIRE"}
        return solid and evaluated.visible_in_viewport_get(space)
    except ReferenceError:
        return False


def _planes(region_3d: bpy.types.RegionView3D) -> np.ndarray:
    """(6, 4) world space: what a view's clipping region cuts away is on their negative side."""
    if not region_3d.use_clip_planes:
        return NO_PLANES
    planes = np.array([tuple(plane) for plane in region_3d.clip_planes], dtype=np.float64)
    planes[~planes.any(axis=1)] = NO_PLANES[0]
    return planes


def _time_of(path: Path) -> float | None:
    """When a file was written last; None if it is not there."""
    try:
        return path.stat().st_mtime
    except OSError:
        return None


def _coarser(look: Look, coarseness: int) -> dict[str, Any]:
    """Settings with which fewer pixels show streaks of the same size on the view."""
    if look.unit != "pixels":
        return {"supersampling": 1}
    return {
        "length": max(look.length // coarseness, 1),
        "grain": max(look.grain / coarseness, 0.75),
        "high_pass": look.high_pass / coarseness,
        "overshoot": look.overshoot / coarseness,
        "outline": look.outline / coarseness,
        "supersampling": 1,
    }


def _key_of(lights: list[Light]) -> Hashable:
    return tuple(
        (light.kind, tuple(light.vector), tuple(light.colour), light.strength) for light in lights
    )


def _maker(name: str) -> Card | Processor:
    """What makes the pictures.

    Raises
    ------
    DeviceError
        If there is no graphics context: nothing can be shown then.
    """
    device = blender_device()
    return Processor(device) if name == "cpu" else Card(device)


# --- the one that runs ---------------------------------------------------------------------------

_live: Live | None = None


def is_live(space: bpy.types.SpaceView3D) -> bool:
    """Whether a 3D view is live."""
    return _live is not None and space.as_pointer() in _live.spaces


def start(space: bpy.types.SpaceView3D, device: str = "auto") -> None:
    """Make a 3D view live.

    Parameters
    ----------
    space : bpy.types.SpaceView3D
    device : {"auto", "cpu"}
        What the first of the views is drawn with, and then all of them: the graphics card if it
        takes the shaders, or the processor at reduced size.

    Raises
    ------
    DeviceError
        If there is nothing to show pictures with.
    """
    global _live
    if _live is None:
        _live = Live(device)
    _live.add(space)


def stop(space: bpy.types.SpaceView3D | None = None) -> None:
    """Let a 3D view be as it was; all of them if none is given."""
    global _live
    if _live is None:
        return
    if space is not None:
        _live.remove(space.as_pointer())
    if space is None or not _live.spaces:
        _live.stop()
        _live = None


def redraw(spaces: set[int] | None = None) -> None:
    """Have 3D views drawn again: those given by their pointers, or all."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and (
                spaces is None or area.spaces.active.as_pointer() in spaces
            ):
                area.tag_redraw()


def _all_spaces() -> list[bpy.types.SpaceView3D]:
    return [
        space
        for screen in bpy.data.screens
        for area in screen.areas
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]
