"""Draw the pictures of the documentation, and fill the tables of docs/gallery: all, or the named ones."""

import argparse
import importlib
import sys

from .page import FOLDER
from .sheets import PAGES, write_page

#: Modules that draw the pictures that `pictures.toml` does not describe.
MODULES = (
    *("figure-02", "figure-05", "figure-06", "figure-07", "figure-09", "figure-10", "figure-11"),
    *("preset-pictures", "hero", "logo", "start-pages", "looks-page", "strokes-page"),
    *("textures-page", "editing-page", "figures-page", "listing", "simulations-page"),
    "performance",
)


def main() -> int:
    """Draw the pictures that the arguments of the command line name; all if there are none."""
    known = list(dict.fromkeys([*MODULES, *PAGES]))
    parser = argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__)
    parser.add_argument("name", nargs="*", help=", ".join(known))
    names = parser.parse_args().name or known
    if unknown := [name for name in names if name not in known]:
        parser.error(f"there is no '{unknown[0]}', only {', '.join(known)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        print(f"drawing {name}", flush=True)
        if name in PAGES:
            write_page(name)
        if name in MODULES:
            importlib.import_module(f".{name.replace('-', '_')}", __package__).write()
    return 0


if __name__ == "__main__":
    sys.exit(main())
