"""The pages of the documentation name functions, modules and operators that exist."""

import ast
import re

import pytest
from conftest import ROOT

import rosy_addon as rf

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md")), *sorted(DOCS.rglob("*.ipynb"))]


def names_in(module: str) -> set[str]:
    """Return what a module of the package defines or imports. It is not imported, as it may need bpy."""
    path = ROOT.joinpath("rosy_addon", *module.split(".")[1:])
    source = (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text()
    names = set(re.findall(r"^(\w+)(?::.*)? = ", source, re.M))
    for node in ast.parse(source).body:
        names |= {alias.asname or alias.name for alias in getattr(node, "names", ())}
        names.add(getattr(node, "name", ""))
    return names


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_names_exists(page):
    text = page.read_text()
    for name in re.findall(r"\b(?:rf|rosyfields)\.(?!external\b)(\w+)", text):
        assert hasattr(rf, name), name
    imports = re.findall(r"((?:rosy_addon|rosyfields)(?:\.\w+)+) import ([\w, ]+)", text)
    modules = re.findall(r"module `((?:rosy_addon)(?:\.\w+)+)`: ([^.]*)\.", text)
    modules += [pair[::-1] for pair in re.findall(r"(`\w+`) from `(rosy_addon[\w.]+)`", text)]
    for module, names in imports + modules:
        assert set(re.findall(r"\w\w+", names)) - {"and"} <= names_in(module), module
    operators = "".join(path.read_text() for path in (ROOT / "operators").glob("*.py"))
    for name in re.findall(r"bpy\.ops\.rosy\.(\w+)", text):
        assert f"class ROSY_OT_{name}(" in operators, name


def test_the_functions_of_the_reference_are_public():
    listed = re.findall(r"^::: rosyfields\.(\w+)", (DOCS / "api.md").read_text(), re.M)
    assert set(listed) == set(rf.__all__)
