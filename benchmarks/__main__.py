"""Run every benchmark of speed, each in a process of its own, and print one table: ``python -m benchmarks``."""

import json
import subprocess
import sys

from benchmarks.harness import FOLDER, print_rows

NAMES = (
    "transforms",
    "evaluation",
    "cost_volume",
    "guided",
    "aggregation",
    "roofline",
    "training",
    "growth",
    "workers",
    "cluster",
    "cached_run",
    "many_scenes",
    "own_pairs",
    "sweep",
    "memory",
)


def main() -> None:
    """Go on after a benchmark that fails; exit with 1 then."""
    failed = [name for name in NAMES if subprocess.run([sys.executable, "-m", f"benchmarks.{name}"]).returncode]
    found = [json.loads((FOLDER / f"{name}.json").read_text()) for name in NAMES if name not in failed]
    print_rows([row for document in found for row in document["ratios"]])
    if failed:
        print(f"these benchmarks failed: {', '.join(failed)}", file=sys.stderr)
        raise SystemExit(1)


if __name__ == "__main__":
    main()
