"""The session of all live views: handlers, timers and drawing."""

import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from itertools import chain

import bpy
from bpy.types import Area, Context, SpaceView3D

from ..annotation.singularity_settings import shows_singularities
from ..compositor.flow import NO_DRIFT
from ..compositor.look import Look, has_flow
from ..compositor.look_units import in_percent
from ..core.cache import Cache
from ..core.errors import REPORTED_ERRORS, DeviceError, RosyError, counted, error_text
from ..gpu.background import draw_background
from ..gpu.select import look_in_view, select_viewport_renderer
from ..rendering.view_input import ViewInput
from ..scene.app_handlers import add_handlers, remove_handlers
from ..scene.cameras import camera_of_view, render_size
from ..scene.look_inputs import check_sources, read_request
from ..scene.look_properties import drift_in_scene, read_look
from ..worker.helper import Helper
from . import overlays, view3d
from .flow_clock import FlowClock
from .layers import LayerState, LayerStates, ReferenceImages
from .overlays import ViewOverlay
from .progressive import ProgressiveRenderer, Request

#: Seconds between two checks for views that were closed.
CLOSED_VIEWS_INTERVAL_SECONDS = 1.0

#: Seconds between two checks whether the helper process is done.
POLL_SECONDS = 0.02

#: Seconds for which a view shows the message why the CPU draws it.
MESSAGE_SECONDS = 10.0

#: Largest number of objects that cannot be read and are named in a view.
MAX_OBJECT_ERRORS = 4

#: Opacity of the picture, in general and in edit mode, where the mesh shows through.
OPACITY, OPACITY_IN_EDIT_MODE = 1.0, 0.7

#: Pointers of a space and of one of its regions.
ViewPointers = tuple[int, int]


class ViewportSession:
    """All live views, and everything that is registered with Blender for them.

    `stop` removes all handlers and timers, frees all textures and ends the helper process.

    Parameters
    ----------
    device : {"auto", "cpu"}

    Attributes
    ----------
    spaces : set of int
        Pointers of the `SpaceView3D` that are live.
    fallback_reason : str or None
        Why the CPU draws instead of the graphics card. None if the card draws, or if the user chose the CPU.
    flow_clock : FlowClock
        Frames by which streaks drift in all views, in addition to the frames of the scene.

    Raises
    ------
    DeviceError
        If there is no graphics context.
    """

    def __init__(self, device: str = "auto") -> None:
        self._helper = Helper()
        self.progressive = self._new_progressive(device)
        self.spaces: set[int] = set()
        self.fallback_reason: str | None = None
        self._fallback_time = 0.0
        self.flow_clock = FlowClock()
        #: Whether a view has shown drifting streaks since the clock was advanced last.
        self._has_shown_flow = False
        self._overlays: defaultdict[ViewPointers, ViewOverlay] = defaultdict(ViewOverlay)
        self.layers = LayerStates()
        #: Stores the singularities of fields, and the corner fields that arrowheads are placed with.
        self._marks_cache = Cache()
        self._references = ReferenceImages()
        self._draw_handlers = [
            SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW"),
            SpaceView3D.draw_handler_add(self._draw_text, (), "WINDOW", "POST_PIXEL"),
        ]
        self._app_handlers = {
            "depsgraph_update_post": self.layers.invalidate,
            "frame_change_post": self.layers.invalidate,
            "undo_post": self.layers.forget,
            "redo_post": self.layers.forget,
            "load_pre": lambda *_: stop(),
        }
        add_handlers(self._app_handlers)
        #: The methods that timers call. Blender identifies a timer by its function object, and each access to
        #: a method makes a new one.
        self._timers: dict[Callable[[], float | None], Callable[[], float | None]] = {}
        self._schedule(CLOSED_VIEWS_INTERVAL_SECONDS, self._drop_closed_views)

    def _new_progressive(self, device: str) -> ProgressiveRenderer:
        """Return a new `ProgressiveRenderer` that draws the views with a device."""
        return ProgressiveRenderer(
            select_viewport_renderer(device),
            self._helper,
            self._schedule_redraw,
            lambda: self._redraw_when(self.progressive.poll, POLL_SECONDS),
        )

    # --- switching -------------------------------------------------------------------------------

    def add(self, space: SpaceView3D) -> None:
        """Make a view live: from now on, the fields of its objects are drawn over it."""
        self.spaces.add(space.as_pointer())
        view3d.redraw()

    def remove(self, space_pointer: int) -> None:
        """Stop drawing over a view, given its pointer."""
        self.spaces.discard(space_pointer)
        for pointers in [pointers for pointers in self._overlays if pointers[0] == space_pointer]:
            del self._overlays[pointers]
        self.progressive.remove_space(space_pointer)
        view3d.redraw()

    def stop(self) -> None:
        """Remove all handlers and timers, and free all resources."""
        for handler in self._draw_handlers:
            SpaceView3D.draw_handler_remove(handler, "WINDOW")
        remove_handlers(self._app_handlers)
        for timer in self._timers.values():
            if bpy.app.timers.is_registered(timer):
                bpy.app.timers.unregister(timer)
        self.layers.clear()
        self.spaces.clear()
        self.progressive.release()
        self._helper.close()
        view3d.redraw()

    def play_flow(self, plays: bool) -> None:
        """Let streaks drift if `plays` is true, otherwise stop them."""
        if plays:
            self.flow_clock.play(time.monotonic())
            self._schedule(0.0, self._advance_flow)
            view3d.redraw(self.spaces)
        else:
            self.flow_clock.pause()
        view3d.redraw_sidebars()

    # --- handlers and timers ---------------------------------------------------------------------

    def _drop_closed_views(self) -> float | None:
        """Timer: remove views that were closed, and stop the session if no view is left.

        Return the seconds until the next call; None to end the timer.
        """
        open_spaces = {space.as_pointer() for space in view3d.open_view3d_spaces()}
        for space_pointer in self.spaces - open_spaces:
            self.remove(space_pointer)
        if self.spaces:
            return CLOSED_VIEWS_INTERVAL_SECONDS
        stop()
        return None

    def _advance_flow(self) -> float | None:
        """Timer: advance the clock of the streaks, and tag the views for a redraw.

        While pictures are rendered, the clock is not advanced. While the timeline plays, it stands still, as
        streaks drift with the frames of the scene. Return the seconds until the next call; None to end the
        timer.
        """
        if not self.flow_clock.is_playing:
            return None
        render, now = bpy.context.scene.render, time.monotonic()
        rate = render.fps / render.fps_base
        if view3d.is_timeline_playing():
            self.flow_clock.play(now)
        elif (
            self._has_shown_flow
            and not self.progressive.is_rendering
            and self.flow_clock.advance(now, rate)
        ):
            self._has_shown_flow = False
            self._tag_redraw()
        return 1 / rate

    def _schedule(self, seconds: float, function: Callable[[], float | None]) -> None:
        """Start a timer that calls a function after some seconds, unless its timer is running already."""
        timer = self._timers.setdefault(function, function)
        if not bpy.app.timers.is_registered(timer):
            bpy.app.timers.register(timer, first_interval=seconds)

    def _schedule_redraw(self, seconds: float) -> None:
        self._schedule(seconds, self._tag_redraw)

    def _tag_redraw(self) -> None:
        """Tag the live views for a redraw, in which rendering continues."""
        view3d.redraw(self.spaces)

    def _redraw_when(self, is_ready: Callable[[], bool], seconds: float = 0.0) -> None:
        """Call a function every so many seconds until it returns True, then tag the views for a redraw."""

        def call() -> float | None:
            if not is_ready():
                return seconds
            self._tag_redraw()
            return None

        self._schedule(seconds, self._timers.setdefault(is_ready, call))

    # --- drawing ---------------------------------------------------------------------------------

    def _draw(self) -> None:
        context = bpy.context
        pointers = _pointers(context)
        if pointers[0] not in self.spaces:
            return
        overlay = self._overlays[pointers]
        overlay.problem = overlay.labeled = None
        try:
            if context.space_data.shading.type == "WIREFRAME":
                raise RosyError("fields are not drawn in wireframe shading: choose another shading")
            self._draw_view(context, overlay)
        except DeviceError as error:
            if self.fallback_reason is None:
                self._fall_back_to_cpu(error)
            else:
                overlay.problem = str(error)
        except REPORTED_ERRORS as error:
            overlay.problem = error_text(error)
        except Exception as error:
            # Blender would print this, and the view would stay plain.
            traceback.print_exc()
            overlay.problem = error_text(error)

    def _fall_back_to_cpu(self, error: DeviceError) -> None:
        """Continue with the CPU when the graphics card rejects a shader."""
        self.progressive.release()
        self.progressive = self._new_progressive("cpu")
        self.fallback_reason, self._fallback_time = str(error), time.monotonic()
        self.layers.forget()
        self._schedule_redraw(0.0)

    def _draw_view(self, context: Context, overlay: ViewOverlay) -> None:
        """Update the picture of a view, and composite the picture and its overlays over the view."""
        look = read_look(context.scene.rosy)
        view_input = self._read_view(context, look, overlay)
        if view_input is None:
            return
        shows_dots = shows_singularities(look)
        still_key = _picture_key(replace(view_input, drift=NO_DRIFT))
        lookups = [
            partial(overlays.look_up_singularities, instance, self._marks_cache)
            for instance in view_input.instances
            if shows_dots and instance.field is not None
        ]
        request = Request(_picture_key(view_input), still_key, view_input, lookups)
        view = self.progressive.update(_pointers(context), request)
        renderer = self.progressive.renderer
        if self.progressive.is_prepared:
            background = view3d.view_background(context, view_input.camera, look)
            if background is not None:
                draw_background(renderer.device, background)
        if view.texture is None:
            return
        opacity = OPACITY_IN_EDIT_MODE if context.mode.startswith("EDIT") else OPACITY
        renderer.composite(view.texture, view.items, view_input, opacity)
        if look.arrows:
            still = replace(view_input, look=look, lights=(), reference=None, drift=NO_DRIFT)
            key = _picture_key(still)
            overlays.draw_view_arrowheads(context, still, key, overlay, self._marks_cache)
        else:
            overlay.arrowheads = None
        if shows_dots:
            overlays.draw_singularities(context, view_input, look, overlay, self._marks_cache)
        self._marks_cache.evict_over_limit()

    def _read_view(self, context: Context, look: Look, overlay: ViewOverlay) -> ViewInput | None:
        """Return the input of the picture of a view, or None if there is nothing to draw yet.

        Raises
        ------
        RosyError
            If no field is visible and no other message says why, or if the tone or the colors have no source.
        """
        # Dots and arrowheads are drawn over the picture.
        depsgraph = context.evaluated_depsgraph_get()
        look = replace(look, singularity_dots="none", arrows=0.0)
        look, overlay.problem = look_in_view(look, self.progressive.renderer)
        include_occluders = (
            self.progressive.renderer.needs_occluders or look.shadows or look.light == "scene"
        )
        layer = self.layers.read(context, depsgraph, look, include_occluders=include_occluders)
        if layer.is_starting:
            self._schedule_redraw(0.0)
            return None
        camera = camera_of_view(context.region, context.region_data)
        frame = None if look.unit == "pixels" else view3d.camera_frame(context, camera)
        if frame is not None:
            # The finished picture is what the camera shows.
            camera = replace(camera, picture_share=(frame[1][0] - frame[0][0]) / 2)
            look = in_percent(look, render_size(context.scene, context.scene.rosy.percentage)[0])
        visible = [
            entry
            for entry in layer.instances
            if view3d.is_visible(entry.visibility_object, depsgraph, context.space_data)
        ]
        with_field = [entry for entry in visible if entry.instance.field is not None]
        if not with_field:
            if layer.reader.errors:
                return None
            raise RosyError(
                "no object with a field is visible here: make a field, or show its object"
            )
        sources = [(entry.instance, entry.owner) for entry in with_field]
        check_sources(sources, read_request(context.scene, look))
        reference = self._references.current(context.scene, depsgraph, look)
        if look.tone == "picture" and reference is None:
            self._redraw_when(self._references.load_pending)
            return None
        self._has_shown_flow |= has_flow(look)
        # Streaks drift with the frames of the scene, and with the clock.
        frame = context.scene.frame_current_final + self.flow_clock.frames
        return ViewInput(
            instances=tuple(entry.instance for entry in visible),
            camera=camera,
            look=look,
            lights=tuple(light.transformed(camera.view) for light in layer.lights),
            reference=reference,
            clip_planes=view3d.clip_planes(context.region_data),
            drift=drift_in_scene(context.scene, look, frame),
        )

    def _draw_text(self) -> None:
        """Draw the messages and the labels of singularities in a view."""
        context = bpy.context
        pointers = _pointers(context)
        if pointers[0] not in self.spaces:
            return
        overlay = self._overlays[pointers]
        if overlay.labeled is not None:
            overlays.draw_labels(context, *overlay.labeled)
        lines = self._lines_of_view(pointers, self.layers.get(context.scene, context.view_layer))
        overlays.draw_messages(lines, context)
        if lines != overlay.lines:
            overlay.lines = lines
            self._schedule(0.0, view3d.redraw_sidebars)

    def _lines_of_view(self, pointers: ViewPointers, layer: LayerState | None) -> list[str]:
        """Return the rows of text that a view shows. `layer` is None if its view layer was never read."""
        lines = []
        if self.fallback_reason and time.monotonic() < self._fallback_time + MESSAGE_SECONDS:
            lines.append(f"drawn on the processor, at reduced size: {self.fallback_reason}")
        if layer is not None and layer.is_starting:
            lines.append("reading the meshes ...")
        view = self.progressive.views.get(pointers)
        if view is not None and view.progress is not None:
            lines.append(f"{view.progress.label} ...")
        problem = self._overlays[pointers].problem
        if problem is not None:
            lines.append(problem)
        if layer is None:
            return lines
        errors = [error_text(error) for error in layer.reader.errors.values()]
        lines += errors[:MAX_OBJECT_ERRORS]
        rest = len(errors) - MAX_OBJECT_ERRORS
        lines += [f"{counted(rest, 'more object')} cannot be drawn"] * (rest > 0)
        return lines + list(layer.reader.notes.values())[:MAX_OBJECT_ERRORS]

    def messages(self, area: Area) -> list[str]:
        """Return the rows of text in the views of an area, as they were drawn last."""
        space_pointer = area.spaces.active.as_pointer()
        views = ((space_pointer, region.as_pointer()) for region in area.regions)
        lines = (self._overlays[view].lines for view in views if view in self._overlays)
        return list(dict.fromkeys(chain.from_iterable(lines)))


def _pointers(context: Context) -> ViewPointers:
    """Return the pointers of the space and the region that are being drawn."""
    return context.space_data.as_pointer(), context.region.as_pointer()


def _picture_key(view_input: ViewInput) -> Hashable:
    """Return a key that changes whenever the picture of a view would change."""
    planes = view_input.clip_planes
    scene_key = view_input.instances, view_input.camera.key, view_input.look, view_input.drift
    light_keys = (
        (light.kind, tuple(light.vector), tuple(light.color), light.strength)
        for light in view_input.lights
    )
    plane_key = None if planes is None else planes.tobytes()
    return *scene_key, plane_key, *light_keys, view_input.reference


# --- the session of this Blender -----------------------------------------------------------------

_session: ViewportSession | None = None


def is_live(space: SpaceView3D) -> bool:
    """Return whether a 3D view is live, that is, fields are drawn over it."""
    return _session is not None and space.as_pointer() in _session.spaces


def messages(area: Area) -> list[str]:
    """Return the messages in the live views of an area: progress, and reasons why a field is not drawn."""
    return [] if _session is None else _session.messages(area)


def is_flow_playing() -> bool:
    """Return whether streaks drift in the live views without the timeline."""
    return _session is not None and _session.flow_clock.is_playing


def play_flow(plays: bool) -> None:
    """Let streaks drift in the live views if `plays` is true, otherwise stop them where they are."""
    if _session is not None:
        _session.play_flow(plays)


def start(space: SpaceView3D, device: str = "auto") -> None:
    """Make a 3D view live: from now on, the fields of its objects are drawn over it.

    Parameters
    ----------
    space : bpy.types.SpaceView3D
    device : {"auto", "cpu"}
        The device that draws. Only used if this is the first live view; later views share its renderer.
        "auto" is the graphics card, or the CPU at reduced size if the card rejects the shaders.

    Raises
    ------
    DeviceError
        If there is no graphics context.
    """
    global _session
    if _session is None:
        _session = ViewportSession(device)
    _session.add(space)


def stop(space: SpaceView3D | None = None) -> None:
    """Stop drawing over a live 3D view or, if `space` is None, over all live views."""
    global _session
    if _session is None:
        return
    if space is not None:
        _session.remove(space.as_pointer())
    if space is None or not _session.spaces:
        _session.stop()
        _session = None
