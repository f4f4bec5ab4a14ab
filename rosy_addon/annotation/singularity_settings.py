"""The settings of singularities in pictures and in drawings, for their classes of settings."""

from __future__ import annotations

from typing import Any

from ..core.settings import choice, number, switch


def shows_singularities(settings: Any) -> bool:
    """Return whether singularities are drawn: of a look or a stroke style, or their properties."""
    return settings.singularity_dots != "none"


def singularity_dots_choice(**place: Any) -> Any:
    """Return the setting `singularity_dots`; `place` is its stage and its panel."""
    return choice(
        "none",
        "Which singularities have dots: orange for positive index, blue for negative index. The "
        "area of a dot is proportional to the index",
        {
            "none": "None",
            "visible": "Those that the camera sees",
            "all": "All, with fainter dots for hidden ones",
        },
        panel_label="Show",
        **place,
    )


def singularity_size_number(**place: Any) -> Any:
    """Return the setting `singularity_size`."""
    return number(
        9.0,
        1.0,
        256.0,
        "Diameter in pixels of the dot of an index of 1/N",
        panel_label="Dot Size",
        applies=shows_singularities,
        **place,
    )


def singularity_labels_switch(**place: Any) -> Any:
    """Return the setting `singularity_labels`."""
    return switch(
        False,
        "Write the indices beside visible dots, unless there are more than 250",
        panel_label="Indices",
        applies=shows_singularities,
        **place,
    )
