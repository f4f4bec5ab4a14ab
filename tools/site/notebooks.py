"""Hook of MkDocs: run the notebooks of docs/notebooks, and show them as pages.

A notebook is stored without outputs. A cell that shows a picture describes it in its metadata, for
readers who do not see it: `"alt": "Bunny with a cross field"`.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbconvert import MarkdownExporter
from repository_pages import ROOT

FOLDER = ROOT / "docs" / "notebooks"

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
        markdown, pictures = _run(path)
        page = NotebookPage(
            source,
            None,
            config.site_dir,
            config.use_directory_urls,
            dest_uri=f"notebooks/{path.stem}.html",
        )
        page.content_string = markdown
        files.append(page)
        for name, content in pictures.items():
            address = f"notebooks/{path.stem}/{name}"
            picture = File(
                f"docs/{address}",
                None,
                config.site_dir,
                config.use_directory_urls,
                dest_uri=address,
            )
            picture.content_bytes = content
            files.append(picture)
        # The notebook itself, for download; its name in the repository is that of the page.
        files.append(File.generated(config, f"notebooks/{path.name}", abs_src_path=str(path)))
    return files


def _notebooks() -> list[Path]:
    return sorted(FOLDER.glob("*.ipynb"))


def _run(path: Path) -> tuple[str, dict[str, bytes]]:
    """Run a notebook, and return it as Markdown with the contents of its pictures by their names."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=120,
        resources={"metadata": {"path": str(FOLDER)}},
        # It warns that other users of the machine could read the messages of the kernel.
        extra_arguments=["--IPKernelApp.log_level=ERROR"],
    )
    try:
        client.execute()
    except CellExecutionError as error:
        raise PluginError(f"{path.relative_to(ROOT)}: {error}") from error
    markdown, resources = MarkdownExporter().from_notebook_node(notebook)

    def described(match: re.Match[str]) -> str:
        alt = notebook.cells[int(match["cell"])].metadata.get("alt", "")
        return f"![{alt}]({path.stem}/{match['file']})"

    title, _, rest = _OUTPUT.sub(described, markdown).strip().partition("\n")
    download = f'<a href="{path.name}" download>Download this notebook</a>'
    return f"{title}\n\n{download}\n{rest}", resources["outputs"]
