"""Write the documented examples as a program, so that mypy checks their types: ``examples.py FILE``."""

import doctest
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import indent

import rosyfields

#: Pages of the documentation with programs and commands for readers who need no Blender.
PAGES = Path(__file__).resolve().parents[2] / "docs" / "start"

#: A program, or the commands of an indented block.
BLOCK = re.compile(r"^```python\n(?P<python>.*?)^```$|(?P<shell>(?:^    \S[^\n]*\n)+)", re.M | re.S)


def examples_of(name: str) -> list[doctest.Example]:
    """Return the examples in the docstrings of a public name that are run."""
    tests = doctest.DocTestFinder().find(getattr(rosyfields, name), name, globs={})
    examples = [example for test in tests for example in test.examples]
    return [example for example in examples if doctest.SKIP not in example.options]


def programs() -> Iterator[str]:
    """Yield the programs of the docstrings and the pages."""
    for name in rosyfields.__all__:
        yield "".join(example.source for example in examples_of(name))
    for page in sorted(PAGES.glob("*.md")):
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            yield block["python"] or ""


if __name__ == "__main__":
    functions = [
        f"def example_{number}() -> None:\n{indent(text, '    ')}"
        for number, text in enumerate(filter(None, programs()))
    ]
    Path(sys.argv[1]).write_text("\n".join(functions), encoding="utf-8")
