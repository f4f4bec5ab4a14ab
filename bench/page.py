"""Write measured cases into the tables of docs/performance.md.

    python -m bench.page CASES.json ...

A table is between ``<!-- cases: PATTERN -->`` and ``<!-- end -->``. It lists the cases whose names
match the regular expression.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "performance.md"

TABLE = re.compile(r"(<!-- cases: (?P<pattern>.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> int:
    """Rewrite all tables for which the files have cases."""
    summary = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m bench.page", description=summary)
    parser.add_argument(
        "cases", nargs="+", type=Path, help="files that benchmarks wrote with --json"
    )
    entries = [
        entry for path in parser.parse_args().cases for entry in json.loads(path.read_text())
    ]

    def fill_table(match: re.Match[str]) -> str:
        matching = [entry for entry in entries if re.search(match["pattern"], entry["name"])]
        return match[1] + _table(matching) + match[3] if matching else match[0]

    PAGE.write_text(TABLE.sub(fill_table, PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


def _table(entries: list[dict]) -> str:
    lines = ["| case | ratio | min to max | target | amounts |", "| --- " * 5 + "|"]
    for entry in entries:
        target = ""
        if entry["target"] is not None:
            better = entry["higher_is_better"]
            target = f"{'at least' if better else 'at most'} {entry['target']:g}"
            missed = (
                entry["ratio"] < entry["target"] if better else entry["ratio"] > entry["target"]
            )
            target += ": **missed**" if missed else ""
        amounts = " / ".join(_rounded(amount) for amount in entry["amounts"])
        spread = f"{entry['low']:.2f} to {entry['high']:.2f}"
        spread = spread if entry["low"] < entry["high"] else ""
        name = entry["name"].strip().replace("|", "\\|")
        cells = [
            name,
            f"{entry['ratio']:.2f}",
            spread,
            target,
            f"{amounts} {entry['unit']}".strip(),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _rounded(amount: float) -> str:
    return f"{amount:.0f}" if amount >= 100 else f"{amount:.3g}"


if __name__ == "__main__":
    sys.exit(main())
