"""Inject every fault of the matrix, print the table, and put it where the documentation quotes it.

python -m tests.faults [--scale 1] [--rows 1,2] [--json docs/faults.json] [--quote]
"""

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

from tests.faults.matrix import PROMISED, ROWS, markdown, run_row, summary, total

PROJECT = Path(__file__).parents[2]
QUOTES = {"README.md": summary, "docs/cache.md": markdown}
"""Where the outcome is quoted, between two marks."""
MARKS = re.compile(r"(<!-- make faults -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> int:
    """Run the rows asked for; 1 if one is not clean, or the whole is smaller than promised."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__.splitlines()[0])
    parser.add_argument("--scale", type=float, default=1.0, help="1: the large form; less: a part of it")
    parser.add_argument("--rows", default="", help="numbers with commas; default: all")
    parser.add_argument("--json", type=Path, help="write the counts here")
    parser.add_argument("--quote", action="store_true", help="put the table into README.md and docs/cache.md")
    options = parser.parse_args()
    numbers = {int(number) for number in options.rows.split(",") if number}
    rows = []
    for row in ROWS:
        if not numbers or row.number in numbers:
            rows.append(run_row(row, options.scale))
            said = ", ".join(f"{name} {rows[-1][name]}" for name in total([]))
            print(f"row {row.number}: {said}; {rows[-1]['seconds']} s", file=sys.stderr, flush=True)
            print(*rows[-1]["notes"][:20], sep="\n", end="\n" if rows[-1]["notes"] else "", file=sys.stderr)
            if options.json:  # after each row: a row takes up to forty minutes, and the next one may be interrupted
                _write(options.json, rows)
    rows = _merged(options.json, rows)
    print(markdown(rows))
    if options.quote:
        quote(rows)
    counts = total(rows)
    enough = numbers or options.scale < 1 or counts["injected"] >= PROMISED
    return 0 if enough and not any(count for name, count in counts.items() if name != "injected") else 1


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    every = _merged(path, rows)
    path.write_text(json.dumps({"name": "faults", "rows": every, "total": total(every)}, indent=1) + "\n")


def _merged(path: Path | None, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of an earlier outcome with those in place that were run anew, in order."""
    old = json.loads(path.read_text())["rows"] if path and path.exists() else []
    return sorted({row["row"]: row for row in [*old, *rows]}.values(), key=lambda row: row["row"])


def quote(rows: list[dict[str, Any]]) -> None:
    """Put the outcome between the marks of the documents."""
    for name, text in QUOTES.items():
        path = PROJECT / name
        path.write_text(MARKS.sub(lambda m, text=text: f"{m[1]}{text(rows)}\n{m[2]}", path.read_text()))


if __name__ == "__main__":
    sys.exit(main())
