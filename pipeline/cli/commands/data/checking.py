"""Check a copy of a dataset, scene by scene."""

from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

from semidense.datasets import open_dataset
from semidense.datasets.benchmarks.copies.check import Checked, check_scene
from semidense.pipeline.cli.console import print_json
from semidense.pipeline.results.text import print_table, results

_SPARE = ("rows x columns", "visible %", "known %", "truth px")


def check(spec: str, scenes: Sequence[str], as_json: bool) -> bool:
    """Print what was found in each scene of a dataset; return whether all are sound.

    Raises:
        DatasetError: if the dataset cannot be listed.
    """
    dataset = open_dataset(spec)
    sources = (dataset.select(scenes) if scenes else dataset).scenes
    console = Console(stderr=True)
    watched = track(sources, "checking", console=console, transient=True, disable=not console.is_terminal)
    found = [check_scene(source) for source in watched]
    if as_json:
        print_json({"dataset": spec, "scenes": [asdict(each) for each in found]})
    else:
        _print(found)
    return not any(each.problems for each in found)


def _print(found: Sequence[Checked]) -> None:
    table = Table("scene", "rows x columns", "truth px", "known %", "visible %", "correlation", "verdict", box=None)
    for column in table.columns[1:6]:
        column.justify = "right"
    for each in found:
        table.add_row(*_cells(each))
    console = results()
    print_table(table, console, _SPARE)
    for each in found:
        for line in (*each.problems, *(f"note: {warning}" for warning in each.warnings)):
            console.print(f"{each.scene}: {line}", markup=False, soft_wrap=True)
    verdicts = [_verdict(each) for each in found]
    counts = {name: verdicts.count(name) for name in _COUNTED}
    scenes = "1 scene" if len(found) == 1 else f"{len(found)} scenes"
    console.print(f"{scenes}: " + ", ".join(f"{count} {_COUNTED[name]}" for name, count in counts.items() if count))


_COUNTED = {"sound": "sound", "wrong": "with something wrong", "no truth": "without a truth, so not checked"}
"""How each verdict is counted."""


def _verdict(each: Checked) -> str:
    return "wrong" if each.problems else "sound" if each.truth else "no truth"


def _cells(each: Checked) -> list[str]:
    span = "-" if each.least is None else f"{each.least:.4g}..{each.largest:.4g}"
    shares = [f"{100 * share:.1f}" if share is not None else "-" for share in (each.known, each.visible)]
    fit = "-" if each.fit is None else f"{each.fit:.2f}"
    return [escape(each.scene), f"{each.size[0]} x {each.size[1]}", span, *shares, fit, _verdict(each)]
