"""The settings of singularities, which the settings classes `Look` and `StrokeStyle` share."""

from typing import Any

from ..core.settings import choice, number


def shows_singularities(settings: Any) -> bool:
    """Return whether singularities are drawn.

    `settings` is a look, a stroke style, or a group of properties in Blender with the same names.
    """
    return settings.singularity_dots != "none"


def shows_hidden_singularities(settings: Any) -> bool:
    """Return whether dots are also drawn for singularities that the camera does not see.

    `settings` is a look, a stroke style, or a group of properties in Blender with the same names.
    """
    return settings.singularity_dots.startswith("all")


def shows_indices(settings: Any) -> bool:
    """Return whether the indices of singularities are written beside their dots."""
    return settings.singularity_dots.endswith("indices") or shows_clusters(settings)


def shows_clusters(settings: Any) -> bool:
    """Return whether singularities that are near to each other are drawn as one dot."""
    return settings.singularity_dots == "clusters"


def singularity_dots_choice(**place: Any) -> Any:
    """Return a dataclass field for the setting `singularity_dots`, given its `panel` and `stage` for `choice`."""
    return choice(
        "none",
        "Which singularities have dots: orange for positive index, blue for negative index. The "
        "area of a dot is proportional to the index. Indices are written beside visible dots, unless there "
        "are more than 250",
        {
            "none": "None",
            "visible": "Those that the camera sees",
            "visible_indices": "Those that the camera sees, with their indices",
            "clusters": "Those that the camera sees, with their indices. Singularities within 2 % of the size of "
            "the mesh are one dot, with the sum of their indices",
            "all": "All, with fainter dots for hidden ones",
            "all_indices": "All, with the indices of visible ones",
        },
        option_labels={
            "visible_indices": "Visible, with Indices",
            "clusters": "Visible Clusters",
            "all_indices": "All, with Indices",
        },
        panel_label="Show",
        **place,
    )


def singularity_size_number(**place: Any) -> Any:
    """Return a dataclass field for the setting `singularity_size`, given its `panel` and `stage` for `number`."""
    return number(
        9.0,
        1.0,
        256.0,
        "Diameter in pixels of the dot of an index of 1/N",
        panel_label="Dot Size",
        applies=shows_singularities,
        **place,
    )
