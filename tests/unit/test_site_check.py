"""The check of the built site finds what is wrong, and only that."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from conftest import ROOT

_spec = importlib.util.spec_from_file_location("site_check", ROOT / "tools" / "site" / "check.py")
site_check = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(site_check)

GOOD_PAGE = """<html><head><link rel="stylesheet" href="site.css"></head><body>
<h1 id="top">Title</h1> <img src="a%20picture.png" alt="A torus">
<a href="#top">up</a> <a href="index.html#top">home</a> <a href="https://example.org/">elsewhere</a>
</body></html>"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Return a site of one page without faults."""
    (tmp_path / "index.html").write_text(GOOD_PAGE)
    (tmp_path / "site.css").write_text("a { color: blue } /* https://example.org/ */")
    (tmp_path / "a picture.png").touch()
    return tmp_path


def test_a_site_without_faults(site):
    assert list(site_check.problems(site)) == []


@pytest.mark.parametrize(
    ("tag", "problem"),
    [
        ('<img src="site.css">', "no alternative text: site.css"),
        ('<img src="absent.png" alt="x">', "absent.png does not exist"),
        ('<script src="https://example.org/x.js"></script>', "loads https://example.org/x.js"),
        ('<link rel="preconnect" href="//example.org">', "loads //example.org"),
        (
            '<pre class="mermaid"></pre>',
            "the theme loads scripts from elsewhere for the class mermaid",
        ),
    ],
)
def test_faults_of_pages_are_found(site, tag, problem):
    (site / "index.html").write_text(GOOD_PAGE + tag)
    assert list(site_check.problems(site)) == [f"index.html: {problem}"]


@pytest.mark.parametrize("text", ["@import 'https://a.org/f'", "x { src: url(https://a.org/f) }"])
def test_addresses_in_styles_are_found(site, text):
    (site / "site.css").write_text(text)
    assert list(site_check.problems(site)) == ["site.css: loads https://a.org/f"]


def test_names_without_a_description_are_found(site):
    (site / "api.html").write_text('<h3 id="rosyfields.Surface">Surface</h3>')
    assert list(site_check.problems(site, ["Surface", "Field"])) == [
        "api.html: no rosyfields.Field: add it to docs/api.md"
    ]
