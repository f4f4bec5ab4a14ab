"""`Studio`: draws the panels of a figure (pictures of fields and of differences), all from the same camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..annotation.figure_parts import ColorBar, Panel, Row
from ..annotation.singularity_marks import SingularityMarks, singularity_marks
from ..annotation.singularity_settings import shows_singularities
from ..compositor.look import Look
from ..core.cache import Cache
from ..core.color import map_colors
from ..field.analysis import format_degrees
from ..image_io.png import to_srgb_uint8
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.visible_vertices import project_vertices
from ..rendering.draw import draw_picture
from ..rendering.view_input import ViewInput
from .comparison import Comparison

#: Largest fraction of the area of a panel that the dots of singularities may cover.
MAX_DOT_SHARE = 0.06

#: The color map of differences, and its positions (0 to 1) for an angle of 0 and for the largest angle. They
#: are light and dark, but not so dark that lines vanish.
DIFFERENCE_COLORS, DIFFERENCE_ENDS = "magma", (1.0, 0.25)


@dataclass(frozen=True, eq=False)
class Studio:
    """Draws the panels of a figure, which show fields or differences between them, from one camera.

    Attributes
    ----------
    comparison : Comparison
    instances : dict of str to MeshInstance
        The fields in world space, by their titles.
    camera : Camera
    look : Look
    workers : int
        Number of processes that draw a picture together; see `draw_picture`.
    """

    comparison: Comparison
    instances: dict[str, MeshInstance]
    camera: Camera
    look: Look
    workers: int
    _cache: Cache = field(default_factory=Cache)

    def _rgba(self, instance: MeshInstance, **changes: Any) -> NDArray[np.float32]:
        """Return the (H, W, 4) picture of a mesh instance, without singularities: linear, bottom row first.

        `changes` are settings that replace those of the look.
        """
        look = replace(self.look, singularity_dots="none", **changes)
        view = ViewInput((instance,), self.camera, look)
        return draw_picture(view, self._cache, keep_gbuffers=False, workers=self.workers).rgba

    @cached_property
    def _marks(self) -> dict[str, SingularityMarks | None]:
        """The dots of the singularities of each field, by title; None if the look shows no singularities.

        If there are very many, their dots are smaller, so that they do not hide the lines.
        """
        if not shows_singularities(self.look):
            return dict.fromkeys(self.instances)
        limit = MAX_DOT_SHARE * self.camera.width * self.camera.height
        shown: dict[str, SingularityMarks | None] = {}
        for title, instance in self.instances.items():
            marks = singularity_marks([instance], self.camera, self.look)
            area = max(float((np.pi * marks.radius**2).sum()), limit)
            shown[title] = replace(marks, size=marks.size * np.sqrt(limit / area))
        return shown

    def field_row(self, titles: Sequence[str], color_bar: ColorBar | None) -> Row:
        """Return the row of the figure that shows the fields. `titles` are the texts over the panels."""
        panels = [
            Panel(text, to_srgb_uint8(self._rgba(instance)[::-1]), self._marks[title])
            for text, (title, instance) in zip(titles, self.instances.items(), strict=True)
        ]
        return Row(panels, color_bar)

    def difference_row(self, lines: str, largest_angle: float) -> Row:
        """Return the row of the figure that shows the differences from the first field.

        Panels have the order of the fields. A field without a difference has None as its panel.

        Parameters
        ----------
        lines : {"other", "first", "both"}
            Fields whose lines are drawn over a difference: the field that is compared with the first one, the
            first field, or both.
        largest_angle : float
            Angle at the top of the color map, in degrees. 0 means 180/N.
        """
        reference, first = next(iter(self.comparison.fields.items()))
        top = largest_angle or 180.0 / first.degree
        differences, panels = self.comparison.differences, []
        for title in self.instances:
            has_one = title in differences
            panels.append(self._difference_panel(title, lines, top) if has_one else None)
        legend = f"Angle to \u201c{reference}\u201d\n\u00d7  largest angle"
        if shows_singularities(self.look):
            legend += (
                f"\nOpen circles: singularities of\n\u201c{reference}\u201d; dots: of the other field."
                "\nLines connect those that match."
            )
        stops = map_colors(np.linspace(*DIFFERENCE_ENDS, 33), DIFFERENCE_COLORS)
        return Row(panels, ColorBar("angle (degrees)", 0.0, top, stops.astype(np.float64)), legend)

    def _difference_panel(self, title: str, lines: str, top: float) -> Panel:
        """Return the panel that shows the difference between a field and the first field.

        Parameters
        ----------
        title : str
            Title of the field.
        lines : {"other", "first", "both"}
            Whether the lines of this field, of the first field or of both are drawn.
        top : float
            Angle at the top of the color map, in degrees.
        """
        reference, first = next(iter(self.instances.items()))
        other, difference = self.instances[title], self.comparison.differences[title]
        values = np.degrees(difference.angle).astype(np.float32)[first.surface.corner_face]
        at_zero, at_top = DIFFERENCE_ENDS
        slope = top / (at_top - at_zero)
        look = {"hue": "values", "magnitude_length": False, "color_map": DIFFERENCE_COLORS}
        look["color_range"] = -slope * at_zero, slope * (1.0 - at_zero)
        drawn = {"first": [first], "other": [other], "both": [first, other]}[lines]
        pictures = [self._rgba(replace(each, color_values=values), **look) for each in drawn]
        # The pictures cover the same pixels, so their mean has the same coverage.
        rgba = np.mean(pictures, axis=0)
        mean, p95, largest = (
            f"{format_degrees(np.degrees(angle))}\u00b0"
            for angle in (difference.mean, difference.p95, difference.max)
        )
        marks = self._marks[title], self._marks[reference]
        links = self._links(title) if shows_singularities(self.look) else None
        place = self._worst_place(difference.worst_face)
        heading, note = f"{title} vs. {reference}", f"mean {mean}, 95 % {p95}, largest {largest}"
        return Panel(heading, to_srgb_uint8(rgba[::-1]), *marks, links, place, note)

    def _links(self, title: str) -> NDArray[np.float64]:
        """Return the (n, 2, 2) end points, in pixels, of lines that connect matching singularities.

        A line begins at a singularity of the first field and ends at one of the field `title`. Pixels are
        counted from the lower left. Lines of which an end is hidden are left out.
        """
        first = next(iter(self.comparison.fields.values())).singularities
        second = self.comparison.fields[title].singularities
        matching = self.comparison.matchings[title]
        ends = np.stack([first.vertex[matching.first], second.vertex[matching.second]], axis=1)
        place, is_visible = self._projected(ends.ravel())
        return place.reshape(-1, 2, 2)[is_visible.reshape(-1, 2).all(axis=1)]

    def _worst_place(self, face: int) -> NDArray[np.float64] | None:
        """Return the position of a face of the first field in the picture, (2,) pixels from the lower left.

        None if none of the corners of the face is visible, or `face` is negative.
        """
        if face < 0:
            return None
        surface = next(iter(self.instances.values())).surface
        corners = surface.corner_vertex[surface.face_start[face] : surface.face_start[face + 1]]
        place, is_visible = self._projected(corners)
        return place[is_visible].mean(axis=0) if is_visible.any() else None

    def _projected(self, vertices: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return where n vertices of the first surface are in the picture, and which are visible.

        Positions, (n, 2), are in pixels from the lower left.
        """
        first = next(iter(self.instances.values()))
        projected = project_vertices([first], self.camera, [vertices])
        return projected.position, projected.is_visible
