"""The reference renders of the tone "picture", for the live view."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from pathlib import Path

import bpy
import numpy as np

from ..compositor.look import Look
from ..compositor.target_tone import ReferenceRender
from ..core.errors import REPORTED_ERRORS, RosyError, error_text
from ..scene.cameras import render_camera
from ..scene.look_inputs import load_luminance, load_reference, reference_path


class ReferenceImages:
    """Loads the picture that a tone comes from, outside of drawing.

    Blender may not load files while it draws, so a picture is first requested and loaded later.

    Parameters
    ----------
    schedule_loading : callable
        Called without arguments while Blender draws. It must arrange for a later call of
        `load_pending`.
    """

    def __init__(self, schedule_loading: Callable[[], None]) -> None:
        self._schedule_loading = schedule_loading
        #: By the name of a scene: path and modification time of its file, and the luminance, or the
        #: message of the error of reading it. None: not loaded.
        self._images: dict[str, tuple[tuple, np.ndarray | str | None]] = {}
        #: By the name of a scene: the last result, and what it depends on.
        self._current: dict[str, tuple[Hashable, ReferenceRender]] = {}

    def load_pending(self) -> None:
        """Load the files that have been requested."""
        for name, (file_key, image) in list(self._images.items()):
            if image is not None:
                continue
            try:
                self._images[name] = file_key, load_luminance(file_key[0])
            except REPORTED_ERRORS as error:
                self._images[name] = file_key, error_text(error)

    def current(
        self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, look: Look
    ) -> ReferenceRender | None:
        """Return the reference render of a scene.

        Returns
        -------
        ReferenceRender or None
            The same object as long as the file and the camera are unchanged. None if the tone does
            not come from a picture, or the picture is not loaded yet.

        Raises
        ------
        RosyError
            If the file cannot be read, or there is no camera.
        """
        if look.tone != "picture":
            return None
        path = reference_path(scene)
        file_key = path, _modified_time(path)
        if scene.name not in self._images or self._images[scene.name][0] != file_key:
            self._images[scene.name] = file_key, None
            self._schedule_loading()
        image = self._images[scene.name][1]
        if isinstance(image, str):
            raise RosyError(image)
        if image is None:
            return None
        reference = load_reference(scene, depsgraph, render_camera(scene), look, image)
        key = file_key, reference.camera.view.tobytes(), reference.camera.projection.tobytes()
        if scene.name not in self._current or self._current[scene.name][0] != key:
            self._current[scene.name] = key, reference
        return self._current[scene.name][1]


def _modified_time(path: Path) -> float | None:
    """Return when a file was last modified; None if it does not exist."""
    try:
        return path.stat().st_mtime
    except OSError:
        return None
