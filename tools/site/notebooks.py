"""Hook of MkDocs: show the notebooks of docs/notebooks as pages, with the outputs of the tests.

The notebooks in the repository have no outputs. If a cell shows a picture, its metadata have a description
for readers who cannot see it: `"alt": "Bunny with a cross field"`.
"""

import re
from pathlib import Path

import nbformat
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter
from repository_pages import ROOT

FOLDER = ROOT / "docs" / "notebooks"

#: Folder in which `make test-notebooks` stores the notebooks with their outputs.
EXECUTED_FOLDER = ROOT / "dist" / "notebooks"

#: Pattern of a picture in the Markdown of nbconvert, with the number of its cell.
_OUTPUT = re.compile(r"!\[\w+\]\((?P<file>output_(?P<cell>\d+)_\d+\.\w+)\)")


class NotebookPage(File):
    """A page with a notebook. Its name ends in .ipynb, as that of the notebook in the repository."""

    def is_documentation_page(self) -> bool:
        """Return True, so that MkDocs renders the content as Markdown."""
        return True


def on_config(config):
    """Add the notebooks to the navigation, under *Python*."""
    section = next(entry["Python"] for entry in config.nav if "Python" in entry)
    section.extend(f"docs/notebooks/{path.name}" for path in _notebooks())
    return config


def on_files(files: Files, *, config) -> Files:
    """Replace each notebook by its page, the pictures of the page, and the notebook for download."""
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
        # The notebook for download. The page has taken its name in the repository.
        files.append(File.generated(config, f"notebooks/{path.name}", abs_src_path=str(path)))
    return files


def _made(kind: type[File], source: str, address: str, config) -> File:
    """Return a file of the site whose content is generated. `address` is its path on the site."""
    return kind(source, None, config.site_dir, config.use_directory_urls, dest_uri=address)


def _notebooks() -> list[Path]:
    return sorted(FOLDER.glob("*.ipynb"))


def _markdown(path: Path) -> tuple[str, dict[str, bytes]]:
    """Return a notebook as Markdown, and the contents of its picture files by name."""
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
