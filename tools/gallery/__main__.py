"""Draw the gallery: all figures, or the named ones."""

from __future__ import annotations

import argparse
import importlib
import sys

from .page import FOLDER, SOURCE

#: Pages by the names of their modules: figure, title and topic.
PAGES = {
    "figure-02": ("Figure 2", "One direction is not enough", "one of six directions, and all six"),
    "figure-05": ("Figure 5", "From a field to a picture", "a 3-RoSy field, step by step"),
    "figure-06": ("Figure 6", "Contrast", "how blending reduces it, and the correction"),
    "figure-07": ("Figures 7, 8", "Tilted surfaces", "members in the view plane, and artifacts"),
    "figure-09": ("Figure 9", "Magnitude", "as color, as the length of streaks, as both"),
    "figure-10": ("Figure 10", "Many directions", "N = 5 and 7, and how legible each N is"),
    "figure-11": ("Figure 11", "Surfaces", "Suzanne, a triple torus, a knot, a sphere, a torus"),
}
#: Modules of other pages and pictures.
OTHERS = (
    "preset-pictures",
    "hero",
    "logo",
    "start-pages",
    "looks-page",
    "hatching-page",
    "peers",
    "strokes-page",
    "textures-page",
    "fields-page",
    "editing-page",
    "figures-page",
    "motion-page",
    "turntable",
    "listing",
    "simulations-page",
    "performance",
)


def main() -> int:
    """Draw the pages that the arguments name."""
    parser = argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__)
    parser.add_argument("figure", nargs="*", help=", ".join([*PAGES, *OTHERS]))
    known = [*PAGES, *OTHERS]
    names = parser.parse_args().figure or known
    unknown = [name for name in names if name not in known]
    if unknown:
        parser.error(f"there is no '{unknown[0]}', only {', '.join(known)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        print(f"drawing {name}", flush=True)
        importlib.import_module(f".{name.replace('-', '_')}", __package__).write()
    _write_index()
    return 0


def _write_index() -> None:
    pieces = [
        "# Gallery",
        f"Here you can compare RoSy with the figures of {SOURCE}. RoSy redraws the same kinds of "
        "fields and the same comparisons, with measurements beside the pictures. `make gallery` "
        "draws the pictures, measures them and writes these pages. No number in the tables is "
        "typed by hand. Look at the pictures at their original size. If they are scaled by a "
        "factor that is not a whole number, the streaks alias with the pixels of the screen.",
        "\n".join(
            f"- [{figure}: {title}]({name}.md): {about}"
            for name, (figure, title, about) in PAGES.items()
        ),
    ]
    (FOLDER / "README.md").write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
