"""Read the commands and programs of a page of the documentation, and run them in their order."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

#: Lines that install the package or fetch the sources: the tests run with the package installed.
SETUP = re.compile(r"(\S*python\S* -m (pip|venv)|pip|git|cd|source|\.) ")

#: Names of files in a page, and the mark before those that a command or a program writes.
FILE_NAME = re.compile(
    r"(?P<output>(?:-o|--out|--output)[ =]|save\(\s*f?[\"']|path=[\"'])?"
    r"(?<![\w./-])(?P<name>[\w-]+\.(?:obj|off|ply|stl|rosy|rawfield|npy|png|svg|gif|json))\b"
)
MESH_SUFFIXES = (".obj", ".off", ".ply", ".stl")


@dataclass(frozen=True)
class Block:
    """Code of a page.

    Attributes
    ----------
    language : str
        "python" or "sh"; other languages are not run.
    text : str
    line : int
        Line of the page before the first line of the text.
    """

    language: str
    text: str
    line: int


def blocks_of(page: str) -> list[Block]:
    """Return the fenced blocks, and the indented ones, which are commands."""
    blocks: list[Block] = []
    lines = page.splitlines()
    at = 0
    while at < len(lines):
        fence = re.match(r"(```+|~~~+) *(\w*)", lines[at])
        start = at
        if fence:
            start, at = at + 1, at + 1
            while at < len(lines) and not lines[at].startswith(fence[1]):
                at += 1
            language = {"bash": "sh", "console": "sh", "shell": "sh"}.get(fence[2], fence[2])
            blocks.append(Block(language, "\n".join(lines[start:at]), start))
        elif lines[at].startswith("    ") and not lines[at - 1].strip():
            while at < len(lines) and (lines[at].startswith("    ") or not lines[at].strip()):
                at += 1
            text = "\n".join(line[4:] for line in lines[start:at])
            # The further paragraphs of a list item are indented as well.
            if not re.search(r"\n[-*\d]+\.? [^\n]*\n+$", "\n" + "\n".join(lines[:start]) + "\n"):
                blocks.append(Block("sh", text.rstrip(), start))
            continue
        at += 1
    return blocks


def files_of(blocks: list[Block]) -> tuple[list[str], list[str]]:
    """Return the files that a page expects, and those that it writes, in the order of their names."""
    is_output: dict[str, bool] = {}
    for block in blocks:
        if block.language in ("python", "sh"):
            for found in FILE_NAME.finditer(block.text):
                is_output.setdefault(found["name"], found["output"] is not None)
    inputs = [name for name, output in is_output.items() if not output]
    return inputs, [name for name, output in is_output.items() if output]


def run_page(page: Path, blocks: list[Block], folder: Path, environment: dict[str, str]) -> int:
    """Run the blocks of a page in a folder, which is the working directory too.

    The programs share their variables. Returns the number of commands and programs.
    """
    variables: dict[str, object] = {"__name__": "__main__"}
    count = 0
    for block in blocks:
        if block.language == "python":
            # Tracebacks name the lines of the page.
            exec(compile("\n" * block.line + block.text, str(page), "exec"), variables)
            count += 1
        elif block.language == "sh":
            commands = [
                line
                for line in block.text.replace("\\\n", " ").splitlines()
                if line.strip() and not SETUP.match(line) and not line.startswith("#")
            ]
            for command in commands:
                done = subprocess.run(
                    command, shell=True, cwd=folder, env=environment, capture_output=True, text=True
                )
                assert done.returncode == 0, (
                    f"{page}, from line {block.line}: {command}\n{done.stderr}"
                )
                count += 1
    return count
