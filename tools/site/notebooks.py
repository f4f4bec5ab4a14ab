"""Hook of MkDocs: show the notebooks of docs/notebooks as pages, as they were run by the tests.

A notebook is stored without outputs. A cell that shows a picture describes it in its metadata, for
readers who do not see it: `"alt": "Bunny with a cross field"`.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from repository_pages import ROOT

FOLDER = ROOT / "docs" / "notebooks"

#: Where `make test-notebooks` keeps the notebooks with their outputs.
EXECUTED_FOLDER = ROOT / "dist" / "notebooks"

#: Pictures in the Markdown of nbconvert, by the number of their cell.
_OUTPUT = re.compile(r"!\[\w+\]\((?P<file>output_(?P<cell>\d+)_\d+\.\w+)\)")


class NotebookPage(File):
    """A notebook as a page. Its name ends in .ipynb, as links in the repository do."""

    def is_documentation_page(self) -> bool:
        """Return True: the content is Markdown."""
        return True


def on_config(config):
    """Add the notebooks to the navigation, under *Python*."""
    section = next(entry["Python"] for entry in config.nav if "Python" in entry)
    section.extend(f"docs/notebooks/{path.name}" for path in _notebooks())
    return config


def on_files(files: Files, *, config) -> Files:
    """Replace each notebook with its page, its pictures and the notebook for download."""
    for path in _notebooks():
        source = f"docs/notebooks/{path.name}"
        files.remove(files.src_uris[source])
        markdown, pictures = _markdown(path)
        page = _made(NotebookPage, source, f"notebooks/{path.stem}.html", config)
        page.content_string = markdown
        files.append(page)
        for name, content in pictures.items():
            address = f"notebooks/{path.stem}/{name}"
            picture = _made(File, f"docs/{address}", address, config)
            picture.content_bytes = content
            files.append(picture)
        # The notebook itself, for download; its name in the repository is that of the page.
        files.append(File.generated(config, f"notebooks/{path.name}", abs_src_path=str(path)))
    return files


def _made(kind: type[File], source: str, address: str, config) -> File:
    """Return a file of the site that is none of the repository."""
    return kind(source, None, config.site_dir, config.use_directory_urls, dest_uri=address)


def _notebooks() -> list[Path]:
    return sorted(FOLDER.glob("*.ipynb"))


def _markdown(path: Path) -> tuple[str, dict[str, bytes]]:
    """Return a notebook as Markdown, with the contents of its pictures by their names."""
    executed = EXECUTED_FOLDER / path.name
    if not executed.exists():
        raise PluginError(f"{executed.relative_to(ROOT)} is missing: run `make test-notebooks`")
    notebook = nbformat.read(executed, as_version=4)
    markdown, resources = MarkdownExporter().from_notebook_node(notebook)

    def described(match: re.Match[str]) -> str:
        alt = notebook.cells[int(match["cell"])].metadata.get("alt", "")
        return f"![{alt}]({path.stem}/{match['file']})"

    title, _, rest = _OUTPUT.sub(described, markdown).strip().partition("\n")
    download = f'<a href="{path.name}" download>Download this notebook</a>'
    return f"{title}\n\n{download}\n{rest}", resources["outputs"]
