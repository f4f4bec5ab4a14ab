"""The wheel `rosyfields`, installed with numpy and nothing else."""

import doctest
import pkgutil
import re
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest
import rosyfields
from conftest import ENVIRONMENT, TREE, WHEELS, run, write_torus

from examples import examples_of

PACKAGE = Path(rosyfields.__file__).parent

#: The wheel is for the package index, and people download it to try it.
LARGEST_WHEEL = 1_200_000


def submodules(package) -> list[str]:
    return [module.name for module in pkgutil.iter_modules(package.__path__)]


def modules_of(statements: str) -> set[str]:
    """Modules that are loaded after some statements in a new process."""
    code = f"{statements}\nimport sys; print(*sys.modules)"
    return set(subprocess.check_output([sys.executable, "-c", code], text=True).split())


def test_the_wheel_is_what_is_tested():
    assert TREE not in PACKAGE.parents or ".venv-" in str(PACKAGE)
    assert "site-packages" in PACKAGE.parts
    assert not [folder for folder in sys.path if Path(folder).resolve() == TREE]


def test_two_builds_have_the_same_bytes():
    (first,), (second,) = (list((WHEELS / source).glob("*.whl")) for source in ("tree", "sdist"))
    assert first.name == second.name
    assert first.read_bytes() == second.read_bytes()
    assert first.stat().st_size < LARGEST_WHEEL


def test_numpy_is_the_only_requirement():
    requirements = distribution("rosyfields").requires
    assert [line for line in requirements if "extra ==" not in line] == ["numpy>=1.24"]


@pytest.mark.parametrize("name", rosyfields.__all__)
def test_examples(name, tmp_path, monkeypatch):
    """Every public name has an example, except errors and what other names return."""
    monkeypatch.chdir(tmp_path)
    write_torus(tmp_path / "torus.obj")
    errors_and_results = ("RosyError", "RosyWarning", "Singularities", "Difference")
    exceptions = (*errors_and_results, "from_array", "save_figures")
    assert examples_of(name) or name in exceptions
    runner = doctest.DocTestRunner()
    for test in doctest.DocTestFinder().find(getattr(rosyfields, name), name, globs={}):
        assert runner.run(test).failed == 0


def test_import_loads_nothing_before_a_name_is_used():
    loaded = modules_of("import rosyfields")
    assert "numpy" not in loaded
    assert {name for name in loaded if name.startswith("rosyfields")} == {"rosyfields"}
    loaded = modules_of("import rosyfields; dir(rosyfields); rosyfields.__all__")
    assert "rosyfields.api" not in loaded
    assert {"rosyfields.api", "numpy"} <= modules_of("import rosyfields; rosyfields.render")


def test_other_libraries_are_not_loaded():
    loaded = modules_of("from rosyfields import *")
    ours = {"numpy", "rosyfields", "sitecustomize"} | sys.stdlib_module_names
    # numpy's own helpers, and those of the environment.
    foreign = {name.split(".")[0] for name in loaded} - ours
    assert not {name for name in foreign if not name.startswith(("_", "cython_runtime"))}


def test_every_public_name():
    from rosyfields import api

    assert rosyfields.__all__ == sorted(set(rosyfields.__all__))
    imported = {name for name in vars(api) if not name.startswith("_")} - {*submodules(api)}
    assert imported == set(rosyfields.__all__)
    for name in rosyfields.__all__:
        assert getattr(rosyfields, name) is getattr(api, name)
    assert set(rosyfields.__all__) <= set(dir(rosyfields))
    with pytest.raises(AttributeError, match="'rosyfields' has no attribute 'rendr'"):
        rosyfields.rendr  # noqa: B018
    # A submodule of the same name would replace the function once it is imported.
    assert not {*rosyfields.__all__} & {*submodules(rosyfields)}
    assert not {*rosyfields.__all__} & {*submodules(api)}


def test_files_of_the_package():
    assert (PACKAGE / "py.typed").is_file()
    presets = {path.name for path in (PACKAGE / "presets").iterdir()}
    in_tree = {path.name for path in TREE.glob("presets/*.json")}
    assert presets == in_tree and "engraving.json" in presets
    shaders = {path.name for path in (TREE / "rosy_addon" / "gpu" / "glsl").iterdir()}
    assert {path.name for path in (PACKAGE / "gpu" / "glsl").iterdir()} == shaders
    known = rosyfields.list_presets()
    assert {name.removesuffix(".json") for name in presets} <= known.keys()


def test_nothing_imports_the_name_of_the_tree():
    """Neither in a statement nor as the text of a module to run in another process."""
    name = r"(rosy_addon|operators)\b"
    used = re.compile(rf"""^\s*(from|import) {name}|["']{name}[\w.]*["']""", re.M)
    for path in PACKAGE.rglob("*.py"):
        assert not used.search(path.read_text(encoding="utf-8")), path


def test_command_draws_the_same_bytes_as_the_tree(tmp_path):
    write_torus(tmp_path / "torus.obj")
    options = ["--size", "200x160", "--preset", "engraving", "--generate", "smoothest"]
    arguments = ["render", "torus.obj", *options, "-o"]
    python = sys.executable, "-m"
    installed = run(*python, "rosyfields", *arguments, "wheel.png", folder=tmp_path)
    assert installed.returncode == 0, installed.stderr
    refused = run("rosyfields", "render", "no.obj", "-o", "no.png", folder=tmp_path)
    assert refused.returncode == 2 and refused.stderr.startswith("rosy: no.obj: ")
    in_tree = ENVIRONMENT | {"PYTHONPATH": str(TREE)}
    words = *python, "rosy_addon", *arguments, "tree.png"
    assert run(*words, folder=tmp_path, env=in_tree).returncode == 0
    picture = (tmp_path / "wheel.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and picture == (tmp_path / "tree.png").read_bytes()
