"""Write measured cases into the tables of docs/performance.md and bench/NOTES.md.

    python -m bench.page CASES.json ...

Benchmarks write the files with --json. In a page, a table stands between ``<!-- cases: PATTERN -->`` and
``<!-- end -->``. PATTERN is a regular expression, and the table lists the cases whose names match it. If
PATTERN has the groups `row` and `column`, their texts are the rows and columns of the table, and its cells
are the ratios, with targets in parentheses.
"""

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "docs" / "performance.md", ROOT / "bench" / "NOTES.md")

TABLE = re.compile(r"(<!-- cases: (?P<pattern>.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    """Rewrite the tables of all pages. A table without any case in the files stays as it is."""
    entries = [entry for path in sys.argv[1:] for entry in json.loads(Path(path).read_text())]
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8"), entries), encoding="utf-8")


def filled(text: str, entries: list[dict]) -> str:
    """Return the text of a page with its tables rewritten."""

    def fill_table(table: re.Match[str]) -> str:
        pattern = re.compile(table["pattern"])
        matching = [entry for entry in entries if pattern.search(entry["name"])]
        if not matching:
            return table[0]
        rows = _grid(matching, pattern) if "column" in pattern.groupindex else _list(matching)
        lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
        return table[1] + "".join(f"| {' | '.join(line)} |\n" for line in lines) + table[3]

    return TABLE.sub(fill_table, text)


def _list(entries: list[dict]) -> list[list[str]]:
    """Return the rows of a table with one row per case, after the header."""
    rows = [["case", "ratio", "target", "amounts"]]
    for entry in entries:
        ratio = f"{entry['ratio']:.2f}"
        amounts = (f"{n:.0f}" if n >= 100 else f"{n:.3g}" for n in entry["amounts"])
        if entry["low"] < entry["high"]:
            ratio += f" ({entry['low']:.2f} to {entry['high']:.2f})"
        amount = f"{' / '.join(amounts)} {entry['unit']}".strip()
        rows.append([entry["name"].strip(), ratio, _target(entry), amount])
    return rows


def _grid(entries: list[dict], pattern: re.Pattern[str]) -> list[list[str]]:
    """Return the rows of a table of ratios, arranged by the groups `row` and `column` of the names."""
    cells: dict[str, dict[str, str]] = {}
    for entry in entries:
        found, target = pattern.search(entry["name"]), _target(entry)
        cell = f"{entry['ratio']:.2f}" + (f" ({target})" if target else "")
        cells.setdefault(found["row"].strip(), {})[found["column"]] = cell
    columns = list(dict.fromkeys(column for row in cells.values() for column in row))
    rows = [[name, *(row.get(column, "") for column in columns)] for name, row in cells.items()]
    return [["", *columns], *rows]


def _target(entry: dict) -> str:
    if entry["target"] is None:
        return ""
    sign = 1 if entry["higher_is_better"] else -1
    missed = ": **missed**" if sign * entry["ratio"] < sign * entry["target"] else ""
    return f"{'≥' if sign > 0 else '≤'} {entry['target']:g}{missed}"


if __name__ == "__main__":
    main()
