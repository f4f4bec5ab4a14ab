"""Compare the outputs of two commits, byte for byte.

    .venv-bpy42/bin/python tools/compare_outputs.py OLD [NEW] [--only TEXT] [--keep DIR]
        [--data DIR]
    .venv-bpy42/bin/python tools/compare_outputs.py OLD --blender "COMMAND"

OLD and NEW are git revisions. NEW is the working tree if it is not given. Each revision is copied
to a temporary folder, and every case runs there in a child process that imports that copy alone.
Outputs of commits are cached in build/compare/SHA/DIGEST, where DIGEST stands for this tool, its
inputs and the versions of Python and numpy. Another checkout with the same tool can use a copy of
that folder, or a link to it. The exit status is 0 only if all cases ran and gave the same files. A
revision takes 3 to 4 minutes on two processor cores.

Cases use only interfaces that users have, so that they run with all revisions: the command line,
the Python package, operators and properties. They run in three lanes: `numpy` (plain Python),
`bpy` (Blender's Python module, if this Python has it) and `card` (a full Blender that draws on the
graphics card, only with --blender; COMMAND starts it without a window when arguments are appended,
such as "blender -b").
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib
import importlib.util
import io
import itertools
import json
import math
import os
import platform
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
CACHE = ROOT / "build" / "compare"

#: Cases that one child process runs, and seconds after which the process is stopped.
BATCH_SIZE, BATCH_TIMEOUT = 12, 900

#: What a case printed, and its exit status, which is written last.
LOG, STATUS = "log.txt", "status.txt"

#: Ends of names of files that are not compared. The last are notes beside the frames of animations.
NOT_COMPARED = (LOG, ".rosy.txt")

#: Exit status of a command that refuses its input.
REFUSED = 2

#: Pattern of an input file in the code of a case, the folder of these files, and a file that does
#: not exist.
INPUT, INPUTS, MISSING = r"@([\w.-]+)", "inputs", "missing.off"

LANES = ("numpy", "bpy", "card")
HAS_BLENDER = importlib.util.find_spec("bpy") is not None


class Case(NamedTuple):
    """Code whose outputs are compared.

    Attributes
    ----------
    name : str
    lane : {"numpy", "bpy", "card"}
    code : str
        Python statements, run in the folder of the case with the names of `run_case`.
    status : int
        Expected exit status.
    """

    name: str
    lane: str
    code: str
    status: int = 0


# --- Cases -----------------------------------------------------------------------------------

PRESETS = tuple(sorted(path.stem for path in (ROOT / "presets").glob("*.json")))

#: Options of a hatched picture, to which those of a case are added.
HATCH = "ink=hatch light=lamp shading=0.9 line_width=2.5 length=30"

#: Arguments of `render`, to which an output and `SIZE` are added.
RENDERS = {
    **{f"degree-{n}": f"@torus.obj --degree {n} --generate smoothest" for n in (7, 12)},
    **{f"preset-{name}": f"@suzanne.obj --preset {name}" for name in PRESETS},
    **{
        f"preset-{name}-{n}": f"@torus.obj --degree {n} --generate smoothest --preset {name}"
        for name, n in itertools.product(PRESETS, range(1, 7))
    },
    **{
        f"{method}-{n}": f"@torus.obj --degree {n} --generate smoothest method={method}"
        for method, n in itertools.product(("members", "brute", "ibfv"), (1, 2, 3, 4, 6))
    },
    "members-cosine": "@bumpy.ply method=members",
    "members-binary": "@bumpy.ply method=members weights=binary",
    "members-none": "@bumpy.ply method=members weights=none guiding_angle=0.4",
    "members-view-plane": "@torus.obj --degree 3 method=members view_plane=off --ortho",
    "members-5-color": "@torus.obj --degree 5 method=members hue=noise high_pass=0 density=.5",
    "members-magnitude": "@bumpy.ply method=members hue=magnitude magnitude_length=on",
    "brute-4-taper": "@bumpy.ply method=brute fade=ends length=25",
    "brute-6-color": "@torus.obj --degree 6 method=brute hue=noise",
    "ibfv-1-oriented": "@torus.obj --degree 1 method=ibfv fade=tail",
    "ibfv-4-flow": "@bumpy.ply method=ibfv flow=1",
    "ibfv-6-color": "@torus.obj --degree 6 method=ibfv hue=noise magnitude_length=on",
    "supersampling-1": "@bumpy.ply supersampling=1",
    "supersampling-3": "@bumpy.ply supersampling=3",
    "flat": "@bumpy.ply display=flat supersampling=1",
    "flat-hatch": f"@bumpy.ply display=flat {HATCH}",
    "ortho-view": "@pair.stl --ortho --view 40,60 --generate axis --axis 1,0.5,0",
    "up-z": "@wave.obj --up z --view -30,-25 --generate features --sharp-angle 20",
    "world-unit": "@bumpy.ply unit_size=0.012",
    "world-unit-hatch": f"@torus.obj {HATCH} unit_size=0.01 anchor=surface outline=1",
    "noise-color": "@wave.obj hue=noise supersampling=1",
    "noise-color-surface": "@wave.obj hue=noise anchor=surface line_width=3",
    "surface-anchor": "@suzanne.obj anchor=surface",
    "noise-settings": "@bumpy.ply line_width=3 density=0.4 high_pass=5 seed=7 gain=4 fade=ends",
    "long-streamlines": "@bumpy.ply length=300 supersampling=1",
    "detail": "@suzanne.obj detail=0.7",
    "arrows": "@torus.obj --degree 1 --generate smoothest arrows=36",
    "singularities": "@suzanne.obj singularity_dots=visible_indices",
    "singularities-all": "@torus.obj --degree 3 singularity_dots=all singularity_size=12",
    "even-lines": f"@suzanne.obj {HATCH} ink=even line_distance=5",
    "even-lines-3": f"@torus.obj --degree 3 {HATCH} ink=even line_distance=5 anchor=surface outline=1",
    "creases": "@cube.off --generate features",
    "cross-creases": "@cube.off --generate smoothest crease_angle=3.1416",
    "crease-angle": "@cube.off --generate smoothest crease_angle=2.5 hue=noise",
    "magnitude-color": "@bumpy.ply hue=magnitude shading=0",
    "magnitude-length-magma": "@bumpy.ply magnitude_length=on color_map=magma",
    "magnitude-both-magma": "@torus.obj @member.rosy hue=magnitude magnitude_length=on color_map=magma",
    "magnitude-gray-range": "@bumpy.ply hue=magnitude color_map=gray color_range=0,0.5",
    "values": "@bumpy.ply --color-values weight",
    "values-hatch": f"@bumpy.ply --color-values weight {HATCH} color_range=1,-1",
    "lamp-shadows": "@pair.stl light=lamp shadows=on shading=1 --generate smoothest",
    "tone-color": f"@bumpy.ply --tone-attribute Color {HATCH}",
    "tone-number": f"@bumpy.ply --tone-attribute weight {HATCH} tone_levels=-0.5,0.8,1",
    "tone-number-lit": f"@bumpy.ply --tone-attribute weight {HATCH} tone_lit=on tone_levels=0,1,1.7",
    "tone-image": f"@wave.obj --tone-image @tone.png {HATCH}",
    "tone-image-soft": "@wave.obj --tone-image @tone.png tone_levels=1,0,1",
    "hatch": f"@suzanne.obj {HATCH}",
    "hatch-surface": f"@suzanne.obj {HATCH} anchor=surface",
    "hatch-breaks": f"@torus.obj {HATCH} anchor=surface breaks=0.8",
    "hatch-breaks-picture": f"@torus.obj {HATCH} breaks=0.5 seed=3",
    "hatch-overshoot": f"@suzanne.obj {HATCH} overshoot=12 anchor=surface",
    "hatch-overshoot-picture": f"@suzanne.obj {HATCH} overshoot=9",
    "hatch-wobble": f"@torus.obj {HATCH} wobble=0.9",
    "hatch-paper-grain": f"@torus.obj {HATCH} paper_grain=0.8 paper_color=#efe9dc",
    "hatch-outline": f"@pair.stl {HATCH} outline=2.5",
    "hatch-ramp": f"@bumpy.ply {HATCH} hue=tone ink_color_light=#2255cc",
    "hatch-clear-paper": f"@bumpy.ply {HATCH} paper_color=#ffffff00",
    "hatch-crisp": f"@bumpy.ply {HATCH} crispness=1 layers=6 layering=0.1 fade=ends",
    "hatch-soft-one": f"@bumpy.ply {HATCH} crispness=0 layers=1",
    "hatch-members": f"@torus.obj --degree 3 {HATCH} method=members",
    "hatch-brute": f"@torus.obj --degree 6 {HATCH} method=brute",
    "hatch-all": f"@suzanne.obj {HATCH} anchor=surface breaks=.6 overshoot=8 wobble=.6 "
    "paper_grain=.4 outline=1.5 hue=families fade=ends supersampling=3",
    **{
        f"hatch-families-{n}": f"@torus.obj --degree {n} {HATCH} hue=families" for n in (1, 3, 4, 6)
    },
    "families-tensors": "@torus.obj @tensors.txt hue=families",
    "families-tensors-hatch": f"@torus.obj @tensors.txt hue=families {HATCH} anchor=surface",
    "families-free": "@torus.obj @free.rawfield hue=families",
    "free": "@torus.obj @free.rawfield",
    "free-members": "@torus.obj @free.rawfield method=members",
    "free-brute": "@torus.obj @free.rawfield method=brute hue=magnitude magnitude_length=on",
    "free-ibfv": "@torus.obj @free.rawfield method=ibfv flow=1",
    "member-text": "@torus.obj @member.txt --degree 2",
    "member-array": "@torus.obj @member.npy --degree 5",
    "directions-of-vertices": "@torus.obj @vertices.txt",
    "concave-polygons": "@star.off --generate features",
    "other-mesh": "@torus.obj @shuffled.rosy --field-mesh @shuffled.off",
    "undefined": "@torus.obj @undefined.txt --undefined",
    "pair": "@pair.stl --generate curvature --reach 0.1",
    "real-spot": "@spot.obj --preset cross-hatch",
    "real-dome-6": "@dome.off @dome-6.rawfield",
    "real-vase-2": "@vase.off @vase-2.rawfield --preset pen-and-ink",
    "real-vase-4": "@vase.off @vase-4.rawfield --preset plaid",
    "real-vase-7": "@vase.off @vase-7.rawfield",
    "real-cheburashka": "@cheburashka.off @cheburashka.rawfield",
    "real-conjugate": "@cheburashka.off @cheburashka-cf.rawfield hue=families",
    "real-conjugate-members": "@cheburashka.off @cheburashka-cf.rawfield method=members",
    "real-conjugate-brute": "@cheburashka.off @cheburashka-cf.rawfield method=brute",
    "real-bunny": "@stanford-bunny.obj --preset engraving",
}
SIZE = "160x120"

#: Arguments of `strokes`, to which the same is added.
STROKES = {
    **{f"degree-{n}": f"@torus.obj --degree {n} --generate smoothest" for n in (1, 2, 3, 4, 6)},
    "tone": "@bumpy.ply --tone --layering 0.2 --width 1.6",
    "tone-lamp-outline": "@suzanne.obj --degree 2 --tone --light lamp --outline --overshoot 8",
    "outline": "@pair.stl --generate smoothest --outline --spacing 12",
    "hidden": "@cube.off --generate features --hidden --cross-creases --spacing 14",
    "plotter": "@torus.obj --plotter --mm 200 --gaps 0.3 --spacing 10",
    "gaps": "@bumpy.ply --gaps 0.5 --taper 2 --colors #aa0000,#0000aa --no-paper",
    "curvature": "@suzanne.obj --curvature 0.8 --spacing 12",
    "distance": "@wave.obj --distance 0.12 --up z --view -30,40 --ortho",
    "engraving": "@suzanne.obj --tone --swell 1 --light lamp --layering 0.4",
    "arrows": "@torus.obj --degree 1 --generate smoothest --spacing 12 --arrows 6",
    "singularities": "@suzanne.obj --spacing 12 --singularity-dots all_indices",
    "singularities-visible": "@torus.obj --degree 3 --spacing 14 --singularity-dots visible "
    "--singularity-size 14",
    "tone-plotter": "@wave.obj --tone --plotter --mm 120 --outline",
    "tone-degree-1": "@bumpy.ply --degree 1 --tone --light lamp --gaps 0.4",
    "tone-degree-6": "@bumpy.ply --degree 6 --tone --layering 0.1 --taper 0.3",
    "free": "@torus.obj @free.rawfield --spacing 12",
    "tensors": "@torus.obj @tensors.txt --spacing 12 --taper 0",
    "real-vase-7": "@vase.off @vase-7.rawfield --spacing 14",
    "real-conjugate": "@cheburashka.off @cheburashka-cf.rawfield --spacing 14 --outline",
}

#: Arguments of `texture`, to which an output and a size are added.
TEXTURES = {
    **{f"preset-{name}": f"@wave.obj --preset {name}" for name in PRESETS},
    **{f"degree-{n}": f"@wave.obj --degree {n} --generate smoothest" for n in range(1, 7)},
    "light": f"@wave.obj {HATCH} --light-direction 1,2,0.5",
    "anisotropy": "@wave.obj --content anisotropy",
    "flow": "@wave.obj --degree 1 --generate smoothest --content flow --margin 3",
    "color": "@wave.obj --generate uv hue=noise magnitude_length=on",
    "tensors": "@wave.obj --generate features --sharp-angle 20 hue=families anchor=surface",
    "real-spot": "@spot.obj --preset pen-and-ink",
}
TEXTURE_SIZE = 128

#: Arguments of `field`; the first word is the file to write.
FIELDS = {
    **{
        f"{kind}-degree-{n}": f"out.rawfield {mesh} --degree {n} --generate {kind}"
        for (kind, mesh), n in itertools.product(
            (("form", "@suzanne.obj"), ("smoothest", "@bumpy.ply"), ("features", "@wave.obj --sharp-angle 20")),
            range(1, 7),
        )
    },
    "form-noisy": "out.rosy @bumpy.ply --magnitude confidence",
    "cancel-pairs": "out.rosy @suzanne.obj --cancel-pairs 0.2",
    "smoothest-open": "out.sings @wave.obj --degree 5 --generate smoothest",
    "curvature": "out.rosy @suzanne.obj --generate curvature",
    "curvature-reach": "out.npy @suzanne.obj --degree 2 --reach 0.1",
    "features": "out.txt @cube.off --generate features",
    "guided-strokes": "out.rosy @torus.obj --strokes @strokes.txt",
    "guided-reach": "out.rosy @torus.obj --strokes @strokes.txt --reach 0.05 --degree 6",
    "guided-field": "out.npy @torus.obj --guides @guides.npy --degree 2",
    "guided-firmness": "out.rosy @torus.obj --guides @guides.npy --firmness --degree 4",
    "guided-uv": "out.rosy @wave.obj --generate guided --uv --reach 0.1",
    "axis": "out.obj @bumpy.ply --generate axis --axis 1,-0.5,0.2 --degree 3",
    "uv": "out.txt @wave.obj --generate uv --degree 4",
    "to-degree": "out.rosy @torus.obj @member.rosy --to-degree 1",
    "to-multiple": "out.rawfield @bumpy.ply --degree 2 --to-degree 6",
    "turn": "out.rosy @suzanne.obj --turn -30",
    "smooth": "out.rosy @suzanne.obj --smooth 0.05",
    **{f"magnitude-{m}": f"out.rosy @bumpy.ply --turn 10 --magnitude {m}" for m in
       ("unit", "confidence", "curvature")},
    "from-tensors": "out.rawfield @torus.obj @tensors.txt",
    "from-free": "out.npy @torus.obj @free.rawfield --turn 20",
    "from-other-mesh": "out.rosy @torus.obj @shuffled.rosy --field-mesh @shuffled.off",
    "real-sings": "out.sings @vase.off @vase-7.rawfield",
    "real-fieldgen": "out.obj @vase.off @vase-4.rawfield",
}  # fmt: skip

#: Command lines of other verbs, several for one case.
COMMANDS = {
    "render-tone-picture": (
        f"render @bumpy.ply -o tone.png --size {SIZE} shading=1 gain=0",
        f"render @bumpy.ply -o out.png --size {SIZE} --tone-picture tone.png {HATCH}",
    ),
    "info-torus": ("info @torus.obj --degree 6 --generate smoothest --json",),
    "info-suzanne": ("info @suzanne.obj --json",),
    "info-binary": ("info @pair-binary.stl --json", "info @star.ply --json"),
    "info-free": ("info @torus.obj @free.rawfield --json",),
    "info-against": (
        "field @bumpy.ply -o other.rosy --generate smoothest",
        "info @bumpy.ply --generate curvature --against other.rosy --json",
    ),
    "info-against-sings": (
        "field @bumpy.ply -o other.sings --generate smoothest",
        "info @bumpy.ply --against other.sings --json",
    ),
    "info-real-vase-7": ("info @vase.off @vase-7.rawfield --json",),
    "field-fieldgen-again": (
        "field @bumpy.ply -o fieldgen.obj --degree 4",
        "field @bumpy.ply fieldgen.obj -o out.rosy",
    ),
    "field-prescribed": (
        "field @torus.obj -o out.sings --degree 4 --generate form",
        "field @torus.obj -o out.rosy --degree 4 --singularities out.sings",
    ),
    "field-prescribed-more": (
        "field @bumpy.ply -o out.rosy --degree 2 --singularities @one.sings --add-missing",
    ),
    **{
        f"strokes-{end}": (f"strokes @suzanne.obj -o out.{end} --size {SIZE} --spacing 12",)
        for end in ("ply", "obj", "csv")
    },
    **{
        f"turntable-{name}": (
            f"turntable @suzanne.obj -o out.gif --pictures 3 --size 96x96 --preset {name} --ortho",
        )
        for name in PRESETS
    },
    "turntable-degree-6": ("turntable @torus.obj -o out.gif --pictures 5 --size 96x72 --degree 6",),
    "turntable-flow": (
        "turntable @torus.obj -o out.gif --pictures 4 --size 96x72 --degree 1 --still --flow 2",
    ),
    # Large enough for several bands, with one process as well.
    **{
        f"bands-{name}-{count}": (
            f"render @suzanne.obj -o out.png --size 1920x1200 --preset {name} --workers {count}",
        )
        for name, count in itertools.product(("default", "pen-and-ink", "cross-hatch"), (1, 2))
    },
    "presets": ("presets --json",),
}

#: Command lines that are refused.
REFUSALS = {
    "broken-mesh": "render @broken.obj -o out.png",
    "missing-mesh": f"info @{MISSING} --json",
    "bad-degree": "field @torus.obj -o out.rosy --degree 13",
    "odd-curvature": "field @torus.obj -o out.rosy --degree 3 --generate curvature",
    "bad-setting": "render @torus.obj -o out.png color=red",
    "bad-value": "render @torus.obj -o out.png length=-1",
    "bad-preset": "render @torus.obj -o out.png --preset nonsense",
    "wrong-field": "render @cube.off @member.rosy -o out.png",
    "no-svg": "strokes @torus.obj -o out.png",
    "bad-verb": "paint @torus.obj",
}

#: Code with the Python package `rf`. `ring` is a surface, `save` writes named arrays.
API = {
    "film": "film = [rf.smoothest(ring, 3).rotated(0.1 * k) for k in range(3)]; "
    "rf.film(film, 'out.gif', between=1, size=(96, 72), workers=1)",
    "film-loop": "film = [rf.form(ring, n) for n in (4, 4, 4)]; film[1] = film[1].rotated(0.3); "
    "rf.film(film, 'out.gif', loop=True, size=(96, 72), preset='pen-and-ink', workers=1)",
    "film-auto": "film = [rf.smoothest(ring, 1), rf.smoothest(ring, 1).rotated(0.2)]; "
    "rf.film(film, 'out.gif', between=None, size=(64, 48), flow=1.5, workers=1)",
    "render": "save(rgba=rf.render(ring, size=(96, 72), workers=1).rgba)",
    "render-hatch": "save(rgba=rf.render(ring, size=(96, 72), preset='charcoal', workers=1).rgba)",
    "texture": "wave = rf.Surface('@wave.obj'); "
    "save(rgba=rf.texture(wave, size=96, preset='plaid').tiles[1001].rgba)",
    "occlusion": "save(tone=rf.ambient_occlusion(ring, directions=16))",
    "strokes": "drawing = rf.strokes(ring, spacing=12); "
    "save(**{str(k): line for k, line in enumerate(drawing.polylines)})",
    "compare": "fields = {'a': rf.form(ring), 'b': rf.smoothest(ring)}; "
    "save(text=rf.compare(fields).to_json(), table=rf.compare(fields).to_latex())",
    "difference": "difference = rf.form(ring).difference(rf.curvature(ring)); "
    "save(angle=difference.angle, mean=difference.mean, p95=difference.p95)",
    "singularities": "field = rf.read_field('@member.rosy', ring); "
    "save(**field.singularities._asdict(), energy=field.energy)",
    "field": "field = rf.smoothest(ring, 6).to_degree(3).rotated(0.4).smoothed(0.03); "
    "save(directions=field.directions, angles=field.angles, z=field.representation)",
    "moved-singularity": "field = rf.form(rf.Surface('@suzanne.obj')); "
    "vertex, index = field.singularities; "
    "moved = field.with_moved_singularity(int(vertex[0]), int(vertex[1]), reach=0.3); "
    "save(vectors=moved.vectors)",
    "guided": "strokes = [ring.vertices[:200:20]]; "
    "save(vectors=rf.guided(ring, 2, strokes=strokes, reach=0.05).vectors)",
    "tensors": "tensors = np.loadtxt('@tensors.txt').reshape(-1, 3, 3); "
    "save(directions=rf.from_tensors(ring, tensors).directions)",
}

#: Arguments of `bake` for the scene that `build_scene` makes.
BAKES = {
    "camera": "--camera Camera",
    "all-cameras": "--all-cameras --size 120x120",
    "frames": "--frames 1-3 --size 96x72",
    "frames-surface": "--frames 2-6:4 --size 96x72 --preset pen-and-ink",
    "workers": "--workers 2 --size 1920x1200 --object Suzanne",
    "flow": "--frames 1-2 --flow 3 --size 96x72 --object Ring",
    **{f"preset-{name}": f"--preset {name}" for name in PRESETS},
    **{
        f"ortho-{name}": f"--preset {name} --camera Ortho"
        for name in ("charcoal", "engraving", "plaid")
    },
    "object": "--object Suzanne Ring --preset paper",
    "scene-light": "light=scene shadows=on shading=1",
    "scene-light-hatch": f"{HATCH} light=scene shadows=on outline=1.5 overshoot=6",
    "brute": "method=brute --size 96x72",
}

#: Makes the object `ring` the only one that is selected.
SELECT_RING = (
    "bpy.ops.object.select_all(action='DESELECT'); ring.select_set(True); "
    "bpy.context.view_layer.objects.active = ring; "
)

#: A stroke of the comb along the torus, in the space of the object.
COMB_STROKE = (
    "[{'name': '', 'location': (1.25 * cos(k / 9), 1.25 * sin(k / 9), 0), 'pressure': 1.0, "
    "'is_start': False} for k in range(12)]"
)

#: Code with operators, and `strokes` of the scene.
OPERATORS = {
    **{
        f"field-{kind}-{n}": f"ops.field_generate(kind='{kind}', degree={n}); dump_attributes()"
        for kind, n in (
            *(("form", n) for n in range(1, 7)),
            *(("smoothest", 3), ("features", 4), ("uv", 2), ("axis", 5)),
        )
    },
    "field-guided": "ops.field_generate(kind='guided', guides={'EDGES', 'UV'}, reach=0.1); "
    "dump_attributes()",
    "field-guided-empty": SELECT_RING
    + "ops.field_generate(kind='guided', guide='Instance', reach=0.05); dump_attributes()",
    "field-guided-curve": "bpy.ops.curve.primitive_bezier_circle_add(location=ring.location); "
    "bpy.context.object.name = 'Circle'; "
    + SELECT_RING
    + "ops.field_generate(kind='guided', guide='Circle'); dump_attributes()",
    "field-guided-vectors": "ops.field_generate(kind='guided', guides={'ATTRIBUTE'}, "
    "vectors='rosy', degree=2, reach=0.1, attribute='other'); dump_attributes()",
    "field-seams": SELECT_RING + "edges = ring.data.edges; "
    "edges.foreach_set('use_seam', [k % 30 == 0 for k in range(len(edges))]); "
    "ops.field_generate(kind='features', edges='SEAM', degree=6); dump_attributes()",
    "field-compare": SELECT_RING
    + "ops.field_generate(kind='features', degree=6, attribute='second'); "
    "ops.field_compare(); ops.bake(); dump_attributes(); dump_images()",
    "field-comb": SELECT_RING + f"ops.field_comb(stroke={COMB_STROKE}, radius=0.4); "
    "dump_attributes()",
    "field-comb-exact": SELECT_RING
    + f"ops.field_comb(stroke={COMB_STROKE}, radius=0.3, exact=True, mirror=(True, False, False)); "
    "dump_attributes()",
    "field-singularities": SELECT_RING
    + "ops.field_singularities(source=3, target=40, index=1, reach=0.3); dump_attributes()",
    "field-values": SELECT_RING
    + "ops.field_convert(magnitude='values', values='shade'); dump_attributes()",
    "field-angles": "ops.field_store(form='ANGLE'); ring.data.rosy.attribute = 'rosy_angle'; "
    "ops.bake(); dump_images()",
    "field-directions": "ops.field_store(form='DIRECTIONS'); ops.bake(); dump_attributes(); "
    "dump_images()",
    "field-convert": "ops.field_convert(degree=12, angle=0.3, smooth=0.02, magnitude='unit'); "
    "ops.field_store(form='ANGLE'); dump_attributes()",
    "field-exchange": "ops.field_export(filepath='a.rawfield'); ops.field_convert(angle=0.2); "
    "ops.field_import(filepath='a.rawfield', attribute='again'); dump_attributes()",
    "bake": "ops.bake(); dump_images()",
    "bake-all": "ops.bake(camera='ALL'); dump_images()",
    "bake-float": "rosy.image_format = 'FLOAT'; rosy.percentage = 70; rosy.look.ink = 'hatch'; "
    "rosy.look.light = 'scene'; ops.bake(); dump_images()",
    "bake-preset": "ops.preset_apply(preset='woodcut'); ops.bake(); dump_images()",
    **{
        f"texture-{name}": "rosy.texture_size = 128; "
        f"ops.preset_apply(preset='{name}'); ops.bake_texture(unwrap=True); dump_images()"
        for name in PRESETS
    },
    **{
        f"texture-content-{content.lower()}": f"rosy.texture_content = '{content}'; "
        + SELECT_RING
        + "rosy.texture_size = 128; ops.bake_texture(unwrap=True); dump_images()"
        for content in ("ANISOTROPY", "FLOW")
    },
    "texture-lights": "rosy.texture_bake_light = True; rosy.texture_size = 128; "
    "ops.preset_apply(preset='pen-and-ink'); ops.bake_texture(unwrap=True); dump_images()",
    "bake-tone-attribute": "rosy.look.tone = 'attribute'; rosy.look.ink = 'hatch'; ops.bake(); "
    "dump_images()",
    "bake-values": "rosy.look.hue = 'values'; rosy.color_attribute = 'shade'; ops.bake(); "
    "dump_images()",
    "bake-tone-image": "rosy.look.tone = 'image'; rosy.look.tone_lit = True; "
    "ring.rosy.tone_image = bpy.data.images.load(f'{os.getcwd()}/@tone.png'); ops.bake(); "
    "dump_images()",
    "bake-tone-picture": "rosy.look.tone = 'picture'; rosy.look.ink = 'hatch'; "
    "rosy.tone_picture = os.path.abspath('@tone.png'); ops.bake(); dump_images()",
    "bake-not-included": "ring.rosy.include = False; ops.bake(); dump_images()",
    "bake-again": "ops.bake(); rosy.look.seed = 3; ring.location.x += 0.2; ops.bake(); "
    "dump_images()",
    "bake-names": "ops.bake(camera='ALL'); dump_names()",
    "bake-remove": "ops.bake(camera='ALL'); ops.remove(); dump_names()",
    "bake-show": "ops.bake(camera='ALL'); ops.show(camera='Camera'); dump_names()",
    "preset-save": "own = os.environ['ROSY_PRESETS']; os.environ['ROSY_PRESETS'] = os.getcwd(); "
    "ops.preset_apply(preset='pencil'); ops.preset_save(name='Mine'); "
    "os.environ['ROSY_PRESETS'] = own",
    "bake-animation": "rosy.directory = os.getcwd(); ops.bake_animation(first=1, last=2)",
    "occlusion": "ops.occlusion(directions=8); ops.bake(); dump_attributes(); dump_images()",
    "singularities": "ops.singularities(show='POINTS'); dump_attributes(); dump_names()",
    "turntable": "ops.turntable(filepath='out.gif', film='.gif', pictures=3, width=80, height=60)",
    "strokes-svg": "strokes.spacing = 9; strokes.outline = True; "
    "ops.strokes(kind='FILE', filepath='out.svg')",
    "strokes-svg-lights": "strokes.tone = True; strokes.light = 'scene'; "
    "strokes.inks = 'FAMILIES'; ops.strokes(kind='FILE', filepath='out.svg')",
    "strokes-pencil": "strokes.spacing = 12; strokes.outline = True; ops.strokes(kind='PENCIL'); "
    "dump_pencil()",
    "strokes-curves": "strokes.spacing = 10; strokes.gaps = 0.3; ops.strokes(kind='CURVES'); "
    "dump_attributes()",
    "strokes-remove": "strokes.spacing = 12; ops.strokes(kind='PENCIL'); ops.strokes_remove(); "
    "dump_names()",
    "strokes-scene": "cli('strokes scene.blend -o out.svg --spacing 12 --tone --outline')",
    "strokes-scene-frames": "cli('strokes scene.blend -o frame-##.svg --frames 1-5:4 '"
    "'--spacing 12 --object Suzanne --camera Ortho')",
}

#: Arguments of `bake --device gpu`, in a full Blender.
CARD = {
    **{f"degree-{n}": "--object Ring" for n in range(1, 7)},
    **{f"preset-{name}": f"--preset {name}" for name in ("cross-hatch", "charcoal", "plaid")},
    "surface-anchor": "anchor=surface fade=ends",
    "families": f"{HATCH} hue=families anchor=surface breaks=0.5",
    "tone": f"{HATCH} tone=attribute tone_levels=0,1,1.4",
    "scene-light": "light=scene shadows=on shading=1 --camera Ortho",
    "scene-light-hatch": f"{HATCH} light=scene shadows=on wobble=0.6 paper_grain=0.4",
    "outline-overshoot": f"{HATCH} outline=2 overshoot=10 supersampling=2",
    "magnitude-flat": "hue=magnitude magnitude_length=on color_map=magma display=flat supersampling=2",
    "all-cameras": "--all-cameras hue=noise unit_size=0.012",
}


def all_cases() -> Iterator[Case]:
    """Yield the cases of all lanes."""
    for verb, table, output, size in (
        ("render", RENDERS, "out.png", SIZE),
        ("strokes", STROKES, "out.svg", SIZE),
        ("texture", TEXTURES, "out.png", TEXTURE_SIZE),
    ):
        for name, words in table.items():
            code = f"cli('{verb} {words} -o {output} --size {size}')"
            yield Case(f"{verb}-{name}", "numpy", code)
    for name, words in FIELDS.items():
        yield Case(f"field-{name}", "numpy", f"cli('field -o {words}')")
    for name, lines in COMMANDS.items():
        yield Case(name, "numpy", "; ".join(f"cli('{line}')" for line in lines))
    for name, line in REFUSALS.items():
        yield Case(f"refused-{name}", "numpy", f"cli('{line}')", REFUSED)
    for name, code in API.items():
        prepare = "import rosy_addon as rf; ring = rf.Surface('@torus.obj'); "
        yield Case(f"api-{name}", "numpy", prepare + code)
    bake = "bake scene.blend --out ."
    for name, words in BAKES.items():
        yield Case(f"bake-{name}", "bpy", f"cli('{bake} {words}')")
    yield Case("refused-camera", "bpy", f"cli('{bake} --camera Nothing')", REFUSED)
    for name, code in OPERATORS.items():
        yield Case(f"operator-{name}", "bpy", code)
    for name, words in CARD.items():
        yield Case(f"card-{name}", "card", f"cli('{bake} --device gpu {words}')")


#: Names of the tables of cases.
TABLES = (
    *("PRESETS", "RENDERS", "STROKES", "TEXTURES", "FIELDS", "COMMANDS", "REFUSALS", "API"),
    *("BAKES", "OPERATORS", "CARD"),
)


def check_cases() -> None:
    """End the program with one line if a table or a lane has no cases.

    A table may be derived from files, such as those of the presets, that are not where they were.
    """
    empty = [name for name in TABLES if not globals()[name]]
    lanes = {case.lane for case in all_cases()}
    empty += [f"the lane {lane}" for lane in LANES if lane not in lanes]
    if empty:
        sys.exit(f"compare_outputs: no cases in {', '.join(empty)}")


# --- Input files -----------------------------------------------------------------------------


class Mesh(NamedTuple):
    """Vertices (V, 3), faces as tuples of vertex indices, and UVs (V, 2) if there are any."""

    vertices: np.ndarray
    faces: list[tuple[int, ...]]
    uv: np.ndarray | None = None


def grid(columns: int, rows: int, wrap: bool, shape: Callable[..., Sequence[Any]]) -> Mesh:
    """Return a lattice of quads over the unit square, mapped by ``shape(u, v)``."""
    nu, nv = (columns, rows) if wrap else (columns + 1, rows + 1)
    uv = np.stack(np.divmod(np.arange(nu * nv), nv), axis=1) / (columns, rows)
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    faces = [
        tuple((i + a) % nu * nv + (j + b) % nv for a, b in corners)
        for i, j in itertools.product(range(columns), range(rows))
    ]
    return Mesh(np.stack(shape(*uv.T), axis=1), faces, uv)


def torus() -> Mesh:
    """Return a torus of triangles about the y axis."""

    def shape(u: np.ndarray, v: np.ndarray) -> Sequence[np.ndarray]:
        u, v = 2 * np.pi * u, 2 * np.pi * v
        ring = 1 + 0.4 * np.cos(v)
        return ring * np.sin(u), 0.4 * np.sin(v), ring * np.cos(u)

    return triangulated(grid(36, 18, True, shape))


def box(count: int) -> Mesh:
    """Return a cube whose sides are `count` x `count` quads."""
    side = grid(count, count, False, lambda u, v: (2 * u - 1, 2 * v - 1, np.ones_like(u)))
    turned = [side.vertices, side.vertices * (-1, 1, -1)]
    corners = np.concatenate([np.roll(each, k, axis=1) for each in turned for k in range(3)])
    vertices, index = np.unique(np.round(corners, 9) + 0.0, axis=0, return_inverse=True)
    index = index.ravel()
    starts = range(0, len(corners), len(side.vertices))
    faces = [tuple(index[start + i] for i in face) for start in starts for face in side.faces]
    return Mesh(vertices, faces)


def bumpy_sphere(count: int = 18) -> Mesh:
    """Return a sphere of quads whose radius varies."""
    cube = box(count)
    points = cube.vertices / np.linalg.norm(cube.vertices, axis=1, keepdims=True)
    x, y, z = points.T
    radius = 1 + 0.15 * np.sin(4 * x) * np.cos(3 * y) + 0.1 * np.sin(5 * z + y)
    return Mesh(points * radius[:, None], cube.faces)


def wavy_sheet() -> Mesh:
    """Return an open sheet of quads with UVs."""
    return grid(
        24, 18, False, lambda u, v: (2 * u - 1, 1.4 * v - 0.7, 0.2 * np.sin(7 * u) * np.cos(5 * v))
    )


def star() -> Mesh:
    """Return a prism over a star, a concave polygon."""
    k = np.arange(10)
    radius, angle = np.where(k % 2, 0.45, 1.0), np.pi * k / 5
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    vertices = np.concatenate([np.column_stack([outline, np.full(10, z)]) for z in (-0.3, 0.3)])
    sides = [(i, (i + 1) % 10, (i + 1) % 10 + 10, i + 10) for i in range(10)]
    return Mesh(vertices, [tuple(range(9, -1, -1)), tuple(range(10, 20)), *sides])


def triangulated(mesh: Mesh) -> Mesh:
    """Return the mesh with its polygons cut into fans."""
    fans = [(f[0], f[k], f[k + 1]) for f in mesh.faces for k in range(1, len(f) - 1)]
    return Mesh(mesh.vertices, fans)


def two_parts() -> Mesh:
    """Return a sphere and a torus beside it, not connected."""
    first, second = triangulated(bumpy_sphere(9)), torus()
    moved = second.vertices[:, [0, 2, 1]] * 0.6 + (1.3, -0.4, 0.2)
    faces = [tuple(len(first.vertices) + i for i in face) for face in second.faces]
    return Mesh(np.concatenate([first.vertices * 0.8, moved]), first.faces + faces)


def suzanne() -> Mesh | None:
    """Return Blender's monkey, or None if this Python has no Blender."""
    if not HAS_BLENDER:
        return None
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add()
    mesh = bpy.context.object.data
    vertices = np.array([[v.co.x, v.co.z, -v.co.y] for v in mesh.vertices])
    return Mesh(vertices, [tuple(face.vertices) for face in mesh.polygons])


def rows_of(values: Any) -> list[str]:
    """Return rows of numbers as text, with as many digits as float64 needs."""
    return [" ".join(f"{x:.17g}" for x in np.ravel(row)) for row in values]


def obj_text(mesh: Mesh) -> str:
    """Return an .obj file."""
    lines = [f"v {row}" for row in rows_of(mesh.vertices)]
    if mesh.uv is None:
        lines += ["f " + " ".join(f"{i + 1}" for i in face) for face in mesh.faces]
    else:
        lines += [f"vt {row}" for row in rows_of(mesh.uv)]
        lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in mesh.faces]
    return "\n".join([*lines, ""])


def off_text(mesh: Mesh) -> str:
    """Return an .off file."""
    faces = [" ".join(map(str, (len(face), *face))) for face in mesh.faces]
    counts = f"{len(mesh.vertices)} {len(faces)} 0"
    return "\n".join(["OFF", counts, *rows_of(mesh.vertices), *faces, ""])


def ply_file(mesh: Mesh, binary: bool = False) -> bytes:
    """Return a .ply file with a color and a number `weight` at each vertex."""
    kinds = dict.fromkeys(("x", "y", "z", "weight"), "double")
    kinds |= dict.fromkeys(("red", "green", "blue"), "uchar")
    numbers = np.column_stack([mesh.vertices, np.sin(4 * mesh.vertices[:, 0])])
    colors = (127.5 + 127.5 * np.sin(3 * mesh.vertices)).astype(int)
    vertices = list(zip(numbers, colors, strict=True))
    header = ["ply", f"format {'binary_little_endian' if binary else 'ascii'} 1.0"]
    header += [f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name, kind in kinds.items()]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    head = "\n".join([*header, "end_header", ""])
    if binary:
        rows = [struct.pack("<4d3B", *number, *color) for number, color in vertices]
        rows += [struct.pack(f"<B{len(face)}i", len(face), *face) for face in mesh.faces]
        return head.encode() + b"".join(rows)
    lines = [f"{row} {r} {g} {b}" for row, (r, g, b) in zip(rows_of(numbers), colors, strict=True)]
    lines += [" ".join(map(str, (len(face), *face))) for face in mesh.faces]
    return (head + "\n".join([*lines, ""])).encode()


def stl_text(mesh: Mesh) -> str:
    """Return an .stl file."""
    lines = ["solid mesh"]
    for face in mesh.faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {row}" for row in rows_of(mesh.vertices[list(face)])]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid mesh", ""])


def stl_bytes(mesh: Mesh) -> bytes:
    """Return a binary .stl file."""
    corners = mesh.vertices[np.array(mesh.faces)]
    records = np.zeros(
        len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("", "<u2")]
    )
    records["corners"] = corners
    return bytes(80) + struct.pack("<I", len(corners)) + records.tobytes()


def png_file(gray: np.ndarray) -> bytes:
    """Return a gray .png file of (H, W) uint8 values."""
    height, width = gray.shape
    rows = np.column_stack([np.zeros(height, np.uint8), gray]).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def write_inputs(folder: Path, data: Path) -> None:
    """Write the meshes, fields and images that cases name with `@`.

    Files in the subfolders of `data`, if it exists, are copied.
    """
    ring, pair = torus(), two_parts()
    texts = {
        "torus.obj": obj_text(ring),
        "wave.obj": obj_text(wavy_sheet()),
        "cube.off": off_text(box(1)),
        "star.off": off_text(star()),
        "pair.stl": stl_text(pair),
        "broken.obj": "v 0 0 0\nv 1 0 0\nf 1 2 99\n",
    }
    if (monkey := suzanne()) is not None:
        texts["suzanne.obj"] = obj_text(monkey)
    faces = np.array(ring.faces)
    corners = ring.vertices[faces]
    normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    member, free = tangents(normal)
    x = corners[:, 0, :1]
    member *= np.where(np.abs(x) < 0.1, 0.0, 1 + 0.5 * np.sin(3 * x))
    tensors = np.einsum("fni,fnj,n->fij", free[:, :2], free[:, :2], (1.0, 0.4))
    undefined, guides = member.copy(), np.zeros_like(member)
    undefined[5:9], guides[::50] = np.nan, member[::50]
    sums = np.zeros_like(ring.vertices)
    np.add.at(sums, faces, normal[:, None])
    order = np.argsort(np.sin(7.3 * np.arange(len(faces))), kind="stable")
    texts["shuffled.off"] = off_text(Mesh(ring.vertices, [ring.faces[i] for i in order]))
    rows = {
        "member.rosy": [f"{len(faces)} 3", *rows_of(member)],
        "shuffled.rosy": [f"{len(faces)} 3", *rows_of(member[order])],
        "member.txt": rows_of(member),
        "undefined.txt": rows_of(undefined),
        "free.rawfield": [f"4 {len(faces)}", *rows_of(free)],
        "vertices.txt": rows_of(tangents(unit(sums))[1]),
        "tensors.txt": rows_of(tensors),
        "one.sings": ["2 1", "7 1"],
        "strokes.txt": [*rows_of(ring.vertices[:300:19]), "", *rows_of(corners[40])],
    }
    texts |= {name: "\n".join([*lines, ""]) for name, lines in rows.items()}
    folder.mkdir()
    for name, text in texts.items():
        (folder / name).write_text(text)
    np.save(folder / "member.npy", member)
    np.save(folder / "guides.npy", guides)
    v, u = np.mgrid[:48, :64] / 48
    gray = (127.5 + 127.5 * np.sin(9 * u + 4 * v * v)).astype(np.uint8)
    (folder / "tone.png").write_bytes(png_file(gray))
    (folder / "bumpy.ply").write_bytes(ply_file(bumpy_sphere()))
    (folder / "star.ply").write_bytes(ply_file(star(), binary=True))
    (folder / "pair-binary.stl").write_bytes(stl_bytes(pair))
    for path in sorted(data.glob("*/*")):
        shutil.copy(path, folder)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a tangent at each normal, and four tangents on two lines that are not at right angles.

    The shapes are those of (F, 3) normals: (F, 3) and (F, 4, 3).
    """
    first = np.cross(normal, (0.3, 1.0, 0.1))
    second = 0.6 * np.cross(normal, first) + 0.5 * first
    return first, np.stack([first, second, -first, -second], axis=1)


# --- Child processes -------------------------------------------------------------------------


def run_child(tree: Path, outputs: Path, lane: str, names: Sequence[str]) -> None:
    """Run cases with the package in `tree`."""
    cases = {case.name: case for case in all_cases()}
    sys.path.insert(0, str(tree))
    extension = None if lane == "numpy" else load_extension(tree)
    main = importlib.import_module(f"{'rosy.' * (extension is not None)}rosy_addon.cli.parser")
    assert Path(main.__file__).is_relative_to(tree)
    for name in names:
        folder = outputs / name
        folder.mkdir(parents=True)
        os.chdir(folder)
        printed, start = io.StringIO(), time.process_time()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            try:
                status = str(run_case(cases[name], main.main))
            except BaseException:
                status = "error"
                traceback.print_exc()
        seconds = time.process_time() - start
        (folder / LOG).write_text(f"{printed.getvalue()}\n{seconds:.2f} s of processor time\n")
        (folder / "scene.blend").unlink(missing_ok=True)
        (folder / STATUS).write_text(status)
    if extension is not None:
        extension.unregister()


def load_extension(tree: Path) -> Any:
    """Load a tree's root as the package `rosy`, as Blender loads an extension, and register it."""
    import bpy  # noqa: F401

    spec = importlib.util.spec_from_file_location(
        "rosy", tree / "__init__.py", submodule_search_locations=[str(tree)]
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules["rosy"] = module
    spec.loader.exec_module(module)
    module.register()
    return module


def run_case(case: Case, main: Callable[..., int]) -> int:
    """Run the code of a case in the current folder and return the largest exit status."""
    statuses = [0]

    def cli(line: str) -> None:
        """Run a command line in which `NAME=VALUE` is short for `--set NAME=VALUE`."""
        words: list[str] = []
        for word in shlex.split(line):
            words += ["--set", word] if "=" in word else [word]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            statuses.append(main(words))
        if "--json" in words:
            with Path("stdout.txt").open("a") as file:
                file.write(printed.getvalue())
        print(printed.getvalue())

    def save(**arrays: Any) -> None:
        """Write arrays as .npy files, and texts and numbers as text."""
        for key, value in arrays.items():
            if isinstance(value, np.ndarray):
                np.save(f"{key}.npy", value)
            else:
                Path(f"{key}.txt").write_text(f"{value}")

    names: dict[str, Any] = {"cli": cli, "save": save, "np": np, "os": os}
    names |= {"cos": math.cos, "sin": math.sin}
    if case.lane != "numpy":
        import bpy

        ring = build_scene(case.name)
        rosy = bpy.context.scene.rosy
        names |= {"bpy": bpy, "ops": bpy.ops.rosy, "rosy": rosy, "strokes": rosy.strokes}
        names |= {"ring": ring} | {dump.__name__: dump for dump in DUMPS}
    exec(re.sub(INPUT, rf"../../{INPUTS}/\1", case.code), names)
    return max(statuses)


def build_scene(case: str) -> Any:
    """Open a new file with all kinds of objects, save it as scene.blend, and return one of them."""
    import bpy
    from mathutils import Vector

    bpy.ops.wm.read_homefile(use_empty=True)
    scene, meshes = bpy.context.scene, bpy.ops.mesh
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.view_settings.view_transform = "Standard"
    scene.rosy.tone_attribute = "shade"

    def add(name: str, data: Any, location: Sequence[float]) -> Any:
        obj = bpy.data.objects.new(name, data)
        obj.location = location
        direction = Vector((0.2, 0.0, 0.0)) - obj.location
        if obj.type in ("CAMERA", "LIGHT"):
            obj.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
        scene.collection.objects.link(obj)
        return obj

    meshes.primitive_torus_add(
        location=(1.5, 0.2, 0.1), rotation=(0.5, 0.2, 0.0), major_segments=24, minor_segments=12
    )
    ring = bpy.context.object
    ring.name, ring.scale = "Ring", (0.9, 0.9, 1.1)
    shade = ring.data.attributes.new("shade", "FLOAT", "POINT")
    shade.data.foreach_set("value", [0.5 + 0.4 * vertex.co.x for vertex in ring.data.vertices])
    degree = int(case[-1]) if case.startswith("card-degree") else 6
    bpy.ops.rosy.field_generate(kind="smoothest", degree=degree)
    meshes.primitive_monkey_add(location=(-1.0, 0.0, 0.1))
    monkey = bpy.context.object
    bpy.ops.object.shade_smooth()
    modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = 1
    bpy.ops.rosy.field_generate(kind="curvature", degree=4)
    for frame, x in ((6, -0.6), (1, -1.0)):
        monkey.location.x = x
        monkey.keyframe_insert("location", frame=frame)
    add("Mirrored", monkey.data, (0.4, 1.8, 1.0)).scale = (-0.6, 0.6, 0.6)
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("Part", ring.data))
    instance = add("Instance", None, (0.3, -1.2, -0.5))
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.scale = (0.3, 0.3, 0.3)
    ground = bpy.data.meshes.new("Ground")
    ground.from_pydata([(-4, -3, -1), (4, -3, -1), (4, 4, -1), (-4, 4, -1)], [], [(0, 1, 2, 3)])
    add("Ground", ground, (0.0, 0.0, 0.0))
    for kind, energy, location in (("SUN", 2.0, (-2, -3, 4)), ("AREA", 150.0, (3, -2, 2))):
        light = bpy.data.lights.new(kind.title(), kind)
        light.energy = energy
        add(kind.title(), light, location)
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), (0.5, -6.5, 2.0))
    ortho = add("Ortho", bpy.data.cameras.new("Ortho"), (4.0, -4.0, 3.0))
    ortho.data.type, ortho.data.ortho_scale = "ORTHO", 5.0
    ring.select_set(True)
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=f"{os.getcwd()}/scene.blend")
    return ring


def dump_images() -> None:
    """Write the pixels of all images."""
    import bpy

    for image in bpy.data.images:
        np.save(f"image {image.name}.npy", pixels_of(image))


def pixels_of(image: Any) -> np.ndarray:
    """Return the (H, W, C) float32 values of an image of Blender."""
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    width, height = image.size
    return values.reshape(height, width, -1)


def dump_attributes() -> None:
    """Write the attributes of all meshes, point clouds and curves, a number a line."""
    import bpy

    values_by_name = {}
    for kind in ("meshes", "pointclouds", "hair_curves"):
        for data in getattr(bpy.data, kind, ()):
            for attribute in data.attributes:
                if attribute.name.startswith(".") or not len(attribute.data):
                    continue
                rows = attribute.data
                properties = (p.identifier for p in rows[0].bl_rna.properties)
                key = next(p for p in properties if p in ("value", "vector", "color"))
                values = [getattr(row, key) for row in rows]
                values_by_name[f"{kind} {data.name} {attribute.name}"] = [
                    list(v) if hasattr(v, "__len__") else v for v in values
                ]
    write_json("attributes.json", values_by_name)


def dump_pencil() -> None:
    """Write the points of all Grease Pencil strokes."""
    import bpy

    points_by_layer = {}
    store = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils)
    for data in store:
        for layer in data.layers:
            for frame in layer.frames:
                strokes = frame.strokes if hasattr(frame, "strokes") else frame.drawing.strokes
                points_by_layer[
                    f"{data.name} {layer.info if hasattr(layer, 'info') else layer.name}"
                ] = [
                    [
                        [*p.co, p.pressure, p.strength]
                        if hasattr(p, "co")
                        else [*p.position, p.radius, p.opacity]
                        for p in stroke.points
                    ]
                    for stroke in strokes
                ]
    write_json("pencil.json", points_by_layer)


def dump_names() -> None:
    """Write the names of all datablocks, and of the modifiers and materials of objects."""
    import bpy

    names_by_key: dict[str, Any] = {}
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION":
            names_by_key[prop.identifier] = [
                data.name for data in getattr(bpy.data, prop.identifier)
            ]
    for obj in bpy.data.objects:
        slots = [slot.material.name for slot in obj.material_slots if slot.material]
        names_by_key[f"object {obj.name}"] = [
            *(modifier.name for modifier in obj.modifiers),
            *slots,
        ]
    write_json("names.json", {key: sorted(names) for key, names in names_by_key.items()})


DUMPS = (dump_images, dump_attributes, dump_pencil, dump_names)


def write_json(name: str, data: Any) -> None:
    """Write data as JSON, its keys sorted and its values on a line each."""
    Path(name).write_text(json.dumps(data, indent=0, sort_keys=True))


# --- Parent process --------------------------------------------------------------------------


class Revision(NamedTuple):
    """A revision, and where its files and outputs are.

    Attributes
    ----------
    label : str
    sha : str
        Empty for the working tree.
    tree : Path
        Copy of its files, once something has to run.
    outputs : Path
        Folder for the outputs of this run, with a folder for each case.
    caches : dict of str to Path
        For each lane, the folder of outputs that are kept.
    """

    label: str
    sha: str
    tree: Path
    outputs: Path
    caches: dict[str, Path]

    def cached(self, case: Case) -> Path:
        """Return where the outputs of a case are in the cache, or would be."""
        return self.caches[case.lane] / case.name

    def folder(self, case: Case) -> Path:
        """Return where the outputs of a case are."""
        new = self.outputs / case.name
        return new if new.is_dir() else self.cached(case)

    def extract(self) -> None:
        """Copy the files of the commit, or those of the working tree that git does not ignore."""
        self.tree.mkdir()
        if self.sha:
            with tarfile.open(fileobj=io.BytesIO(git("archive", self.sha))) as files:
                files.extractall(self.tree, filter="data")
            return
        listed = git("ls-files", "-z", "--cached", "--others", "--exclude-standard")
        for name in filter(None, os.fsdecode(listed).split("\0")):
            if (ROOT / name).is_file():
                (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, self.tree / name)


def git(*arguments: str) -> bytes:
    """Return what git prints; end the program if it fails. Git prints the reason."""
    completed = subprocess.run(
        ["git", "-C", str(ROOT), *arguments], check=False, stdout=subprocess.PIPE
    )
    if completed.returncode:
        sys.exit(f"git {arguments[0]} failed for {arguments[-1]}")
    return completed.stdout


def find_revision(side: str, name: str | None, work: Path, blender: str) -> Revision:
    """Return the revision that the user means; the working tree if none is given.

    Cached outputs are kept by all that they depend on: the commit, this tool, the inputs, the
    versions of Python and numpy, and which Blender draws.
    """
    sha = ""
    if name is not None:
        sha = git("rev-parse", "--verify", f"{name}^{{commit}}").decode().strip()
    digest = hashlib.sha256(Path(__file__).read_bytes())
    digest.update(f"{sys.version} {np.__version__} {platform.platform()} {PRESETS}".encode())
    for path in sorted((work / INPUTS).iterdir()):
        digest.update(path.name.encode() + path.read_bytes())
    cache = CACHE / (sha or "none") / digest.hexdigest()[:12]
    digest.update(blender.encode())
    card = cache.with_name(digest.hexdigest()[:12])
    caches = {"numpy": cache, "bpy": cache, "card": card}
    label = f"{side} ({name or 'working tree'})"
    return Revision(label, sha, work / f"{side}-tree", work / side, caches)


def run_cases(
    revisions: Sequence[Revision], cases: Sequence[Case], blender: str, jobs: int
) -> None:
    """Run the cases whose outputs are not in the cache."""
    batches = []
    for revision in revisions:
        missing = [case for case in cases if not (revision.sha and revision.cached(case).is_dir())]
        print(f"{revision.label}: {len(cases) - len(missing)} cached, {len(missing)} to run")
        if missing:
            revision.extract()
        for lane in reversed(LANES):  # those that take longest first
            chosen = [case for case in missing if case.lane == lane]
            starts = range(0, len(chosen), BATCH_SIZE)
            batches += [(revision, chosen[start : start + BATCH_SIZE]) for start in starts]
    sys.stdout.flush()
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(lambda batch: run_batch(*batch, blender), batches))


def run_batch(revision: Revision, batch: Sequence[Case], blender: str) -> None:
    """Run cases of one lane in a child process, and cache their outputs if it is a commit's.

    A case that ends the process is marked as crashed, and the next ones run in another process. If
    not even the first case has started, all are.
    """
    work, lane, script = revision.outputs.parent, batch[0].lane, str(Path(__file__).resolve())
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "ROSY_PRESETS": str(work / "no-presets"),
        "BLENDER_USER_RESOURCES": str(work / "blender-user"),
    }
    command = [sys.executable, script]
    if lane == "card":
        command = [*shlex.split(blender), "--factory-startup", "-P", script, "--"]
    command += ["--child", str(revision.tree), str(revision.outputs), lane]
    remaining = list(batch)
    while remaining:
        try:
            completed = subprocess.run(
                [*command, *(case.name for case in remaining)],
                cwd=ROOT,
                env=environment,
                timeout=BATCH_TIMEOUT,
                check=False,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            printed = completed.stdout.decode(errors="replace")
        except subprocess.TimeoutExpired:
            printed = f"stopped after {BATCH_TIMEOUT} s"
        remaining = [
            case for case in remaining if not (revision.outputs / case.name / STATUS).is_file()
        ]
        started = remaining and (revision.outputs / remaining[0].name).is_dir()
        for case in remaining[:1] if started else remaining:
            folder = revision.outputs / case.name
            folder.mkdir(parents=True, exist_ok=True)
            (folder / LOG).write_text(printed)
            (folder / STATUS).write_text("crashed")
        remaining = remaining[1:] if started else []
    for case in batch if revision.sha else ():
        new, cached = revision.outputs / case.name, revision.cached(case)
        if (new / STATUS).read_text() == str(case.status):
            cached.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(OSError):  # it is there already
                os.replace(new, cached)


def report(revisions: Sequence[Revision], cases: Sequence[Case], keep: Path | None) -> Counter[str]:
    """Print a line for each case and return how many are the same, differ or failed."""
    counts: Counter[str] = Counter()
    for case in cases:
        old, new = (revision.folder(case) for revision in revisions)
        differences = compare(old, new)
        failed = [
            f"{side} ended with {status}, see its {LOG} (--keep)"
            for side, folder in (("old", old), ("new", new))
            if (status := (folder / STATUS).read_text()) != str(case.status)
        ]
        result = "failed" if failed else "DIFFERS" if differences else "same"
        counts[result] += 1
        print(f"{result:7}  {case.name}  {'; '.join(failed or differences.values())}".rstrip())
        if keep is not None:
            keep_outputs(keep, case, old, new, differences)
    return counts


def compare(old: Path, new: Path) -> dict[str, str]:
    """Return what differs between the outputs of a case, by file."""
    first, second = compared_files(old), compared_files(new)
    differences = {}
    for name in sorted({*first, *second}):
        if name not in first or name not in second:
            differences[name] = f"{name} is only in {'old' if name in first else 'new'}"
        elif first[name].read_bytes() != second[name].read_bytes():
            differences[name] = f"{name}: {describe_difference(first[name], second[name])}"
    return differences


def compared_files(folder: Path) -> dict[str, Path]:
    """Return the files of a case that are compared, by their relative names."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    files = {str(path.relative_to(folder)): path for path in paths}
    return {name: path for name, path in files.items() if not name.endswith(NOT_COMPARED)}


def describe_difference(old: Path, new: Path) -> str:
    """Describe how two files differ."""
    if old.suffix == ".npy" or (old.suffix == ".png" and HAS_BLENDER):
        first, second = read_pixels(old), read_pixels(new)
        if first.shape != second.shape or first.ndim != 3:
            return f"arrays of shape {first.shape} and {second.shape}"
        difference = np.abs(first.astype(np.float64) - second).max(axis=2)
        count = np.count_nonzero(difference)
        return f"{count} of {difference.size} pixels differ, by {difference.max():.6g} at most"
    before, after = old.read_bytes(), new.read_bytes()
    if b"\0" in before:
        return f"{len(before)} and {len(after)} bytes"
    lines = list(itertools.zip_longest(before.splitlines(), after.splitlines()))
    differing = [number for number, (a, b) in enumerate(lines, 1) if a != b]
    return f"{len(differing)} of {len(lines)} lines differ, the first are {differing[:3]}"


def read_pixels(path: Path) -> np.ndarray:
    """Return the array of an .npy file, or the (H, W, 4) values from 0 to 255 of a .png file."""
    if path.suffix == ".npy":
        return np.load(path)
    import bpy

    image = bpy.data.images.load(str(path))
    image.alpha_mode = "CHANNEL_PACKED"  # keeps the color of transparent pixels
    pixels = pixels_of(image)
    bpy.data.images.remove(image)
    return np.rint(255 * pixels)


def keep_outputs(folder: Path, case: Case, old: Path, new: Path, names: Iterable[str]) -> None:
    """Copy the outputs of a case, and each pair of files that differ, to a folder."""
    for side, source in (("old", old), ("new", new)):
        shutil.copytree(source, folder / side / case.name, dirs_exist_ok=True)
        for name in names:
            if (source / name).is_file():
                path = folder / "differing" / case.name / name
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source / name, path.with_name(f"{path.stem}.{side}{path.suffix}"))


def parse_arguments() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", nargs="?", metavar="OLD", help="git revision")
    parser.add_argument(
        "new", nargs="?", metavar="NEW", help="git revision; by default the working tree"
    )
    parser.add_argument("--only", default="", metavar="TEXT", help="cases with this in their name")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep outputs and differing pairs")
    parser.add_argument(
        "--data",
        type=Path,
        default=ROOT.parent / "shared" / "data",
        metavar="DIR",
        help="folder with the meshes and fields of others, for the cases that use them "
        "(../shared/data)",
    )
    parser.add_argument("--list", action="store_true", help="list the cases and end")
    parser.add_argument(
        "--blender",
        default="",
        metavar="COMMAND",
        help="run the cases of the graphics card as well, in this Blender",
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    options = parser.parse_args()
    if options.old is None and not options.list:
        parser.error("OLD is missing")
    return options


def main() -> int:
    """Compare two revisions and return the exit status."""
    options = parse_arguments()
    check_cases()
    cases = [case for case in all_cases() if options.only in case.name]
    if options.list:
        print(*(f"{case.lane:5}  {case.name}" for case in cases), sep="\n")
        return 0
    if not cases:
        sys.exit(f"compare_outputs: no case has {options.only!r} in its name")
    is_available = {"numpy": True, "bpy": HAS_BLENDER, "card": bool(options.blender)}
    cases = [case for case in cases if is_available[case.lane]]
    print("lanes:", *(lane for lane in LANES if is_available[lane]))
    CACHE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE, prefix="work-") as work_name:
        work = Path(work_name)
        write_inputs(work / INPUTS, options.data)
        inputs = {path.name for path in (work / INPUTS).iterdir()} | {MISSING}
        chosen = [case for case in cases if inputs.issuperset(re.findall(INPUT, case.code))]
        revisions = [
            find_revision(side, name, work, options.blender)
            for side, name in (("old", options.old), ("new", options.new))
        ]
        run_cases(revisions, chosen, options.blender, options.jobs)
        counts = report(revisions, chosen, options.keep)
    print(
        f"{len(chosen)} cases: {counts['same']} same, {counts['DIFFERS']} differ, "
        f"{counts['failed']} failed; {len(cases) - len(chosen)} left out because an input is missing (--data)"
    )
    return 0 if chosen and counts["same"] == len(chosen) else 1


if __name__ == "__main__":
    if "--child" in sys.argv:
        tree, outputs, lane, *names = sys.argv[sys.argv.index("--child") + 1 :]
        run_child(Path(tree), Path(outputs), lane, names)
    else:
        sys.exit(main())
