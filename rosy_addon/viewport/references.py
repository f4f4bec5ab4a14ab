"""The reference renders of the tone "picture", for the live view."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from pathlib import Path

import bpy
import numpy as np

from ..compositor.look import Look
from ..compositor.target_tone import ReferenceRender
from ..errors import RosyError
from ..scene.cameras import render_camera
from ..scene.tone_inputs import load_luminance, load_reference, reference_path


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
        #: Luminance, or the error of reading it, by path and modification time. None: not loaded.
        self._images: dict[Hashable, np.ndarray | RosyError | None] = {}
        self._current: tuple[Hashable, ReferenceRender | None] = None, None

    def load_pending(self) -> None:
        """Load the files that have been requested."""
        for file_key in [key for key, image in self._images.items() if image is None]:
            try:
                self._images[file_key] = load_luminance(file_key[0])
            except RosyError as error:
                self._images[file_key] = error

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
        if file_key not in self._images:
            self._images = {file_key: None}
            self._schedule_loading()
        image = self._images[file_key]
        if isinstance(image, RosyError):
            raise image
        if image is None:
            return None
        reference = load_reference(scene, depsgraph, render_camera(scene), look, image)
        key = file_key, reference.camera.view.tobytes(), reference.camera.projection.tobytes()
        if self._current[0] != key:
            self._current = key, reference
        return self._current[1]


def _modified_time(path: Path) -> float | None:
    """Return when a file was last modified; None if it does not exist."""
    try:
        return path.stat().st_mtime
    except OSError:
        return None
