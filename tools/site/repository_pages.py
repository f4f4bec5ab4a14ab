"""Hook of MkDocs: name every page by its path in the repository.

The pages are written for the repository: `docs/first-bake.md` has a link to `../README.md`, and the README
one to `docs/first-bake.md`. With these names, MkDocs can follow and check such links without changes.
"""

import re
from pathlib import Path

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]

#: Files outside of docs/ to which pages have links, with their addresses on the site.
OUTSIDE_DOCS = {
    "README.md": "index.html",
    "CHANGELOG.md": "changes.html",
    "CONTRIBUTING.md": "contributing.html",
    "SECURITY.md": "security.html",
    "bench/NOTES.md": "laboratory-notes.html",
    "LICENSE": "files/LICENSE.txt",
    "CITATION.cff": "files/CITATION.cff",
    "examples/bake_scene.py": "files/bake_scene.py",
    "farm/flamenco/rosy_bake.js": "files/rosy_bake.js",
}


def on_files(files: Files, *, config) -> Files:
    """Return the files of docs/ and of `OUTSIDE_DOCS`, named by their paths in the repository."""
    named = [
        _named(file, config) if file.src_dir == config.docs_dir else file
        for file in files
        # The theme's search in other languages is left out.
        if not file.src_uri.startswith("assets/javascripts/lunr/")
    ]
    for source, address in OUTSIDE_DOCS.items():
        named.append(repository_file(source, address, config))
    return Files(named)


def on_page_markdown(markdown: str, *, page, config, files) -> str:
    """Hide the list of pages at the side of the home page."""
    if page.is_homepage:
        page.meta["hide"] = ["navigation"]
    return markdown


def on_page_content(html: str, *, page, config, files) -> str:
    """Remove the backslash before a bar (``|``) in code in a table. Code hosts need it, MkDocs shows it."""
    return re.sub(r"<td[^>]*>.*?</td>", lambda cell: cell[0].replace(r"\|", "|"), html, flags=re.S)


def repository_file(source: str, address: str, config) -> File:
    """Return a file of the repository with its address on the site."""
    return File(source, str(ROOT), config.site_dir, config.use_directory_urls, dest_uri=address)


def _named(file: File, config) -> File:
    named = repository_file(f"docs/{file.src_uri}", file.dest_uri, config)
    named.inclusion = file.inclusion
    return named
