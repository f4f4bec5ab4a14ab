"""Write measured cases into the tables of docs/performance.md and bench/NOTES.md.

    python -m bench.page CASES.json ...

The files are those that benchmarks write with --json. A table is between ``<!-- cases: PATTERN -->`` and
``<!-- end -->``. It lists the cases whose names match the regular expression.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "docs" / "performance.md", ROOT / "bench" / "NOTES.md")

TABLE = re.compile(r"(<!-- cases: (?P<pattern>.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    """Rewrite all tables for which the files have cases."""
    entries = [entry for path in sys.argv[1:] for entry in json.loads(Path(path).read_text())]

    def fill_table(match: re.Match[str]) -> str:
        matching = [entry for entry in entries if re.search(match["pattern"], entry["name"])]
        return match[1] + _table(matching) + match[3] if matching else match[0]

    for page in PAGES:
        page.write_text(TABLE.sub(fill_table, page.read_text(encoding="utf-8")), encoding="utf-8")


def _table(entries: list[dict]) -> str:
    lines = ["| case | ratio | min to max | target | amounts |", "| --- " * 5 + "|"]
    for entry in entries:
        target, ratio, sign = (
            entry["target"],
            entry["ratio"],
            1 if entry["higher_is_better"] else -1,
        )
        if target is not None:
            missed = ": **missed**" if sign * ratio < sign * target else ""
            target = f"{'at least' if sign > 0 else 'at most'} {target:g}{missed}"
        spread = f"{entry['low']:.2f} to {entry['high']:.2f}"
        spread = spread if entry["low"] < entry["high"] else ""
        amounts = " / ".join(f"{a:.0f}" if a >= 100 else f"{a:.3g}" for a in entry["amounts"])
        name = entry["name"].strip().replace("|", "\\|")
        cells = [name, f"{ratio:.2f}", spread, target or "", f"{amounts} {entry['unit']}".strip()]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
