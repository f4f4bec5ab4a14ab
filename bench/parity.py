"""Print how well the graphics card agrees with numpy, for several shapes and degrees.

    blender -b --python-exit-code 1 -P bench/parity.py -- [--size PIXELS] [--data FOLDER]

Draws a sphere, a torus and Suzanne for N = 1 to 6 with the graphics card that Blender uses, and
prints a row for each. With `--data`, also the bunny and the vase, which are the files
`meshes/stanford-bunny.obj` and `meshes/vase.off` in FOLDER.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from harness.gpu_parity import (  # noqa: E402
    DEGREES,
    VIEWS,
    camera_of_shape,
    draw_on_card,
    draw_pair,
    module_of,
    rooms,
    surface_of_shape,
)


def table_lines(rosy: SimpleNamespace, card: Any, size: int, data: Path | None) -> Iterator[str]:
    """Yield the lines of the table: its header, and a row for each shape and degree."""
    yield "| shape | triangles | N | pixels | agree % | correlation | shaded | card s | numpy s |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    unshaded = rosy.Look(shading=0.0)
    for name in VIEWS:
        surface = surface_of_shape(rosy, name, data)
        if surface is None:
            continue
        camera = camera_of_shape(rosy, name, surface, size)
        for degree in DEGREES:
            field = rosy.generate(surface, "smoothest", degree)
            instances = [rosy.MeshInstance(surface, np.eye(4), field)]
            start = time.perf_counter()
            draw_on_card(rosy, card, instances, camera, unshaded)
            middle = time.perf_counter()
            pair = draw_pair(rosy, card, instances, camera, unshaded)
            end = time.perf_counter()
            shaded = draw_pair(rosy, card, instances, camera, rosy.Look())
            yield (
                f"| {name} | {len(surface.triangles)} | {degree} | {len(pair.gbuffer.pixel)} "
                f"| {100 * pair.agreement:.3f} | {pair.likeness:.4f} | {shaded.likeness:.4f} "
                f"| {middle - start:.1f} | {end - middle:.1f} |"
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--data", type=Path, help="folder with the meshes of bunny and vase")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    rosy = rooms()
    renderer = rosy.GpuRenderer(module_of(rosy.package, "gpu.device").Device())
    for line in table_lines(rosy, renderer, options.size, options.data):
        print(line, flush=True)


if __name__ == "__main__":
    main()
