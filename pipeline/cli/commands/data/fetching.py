"""Fetch a benchmark and show how it goes on."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

from semidense.datasets.benchmarks.copies.catalogue import publication, state
from semidense.datasets.benchmarks.copies.download import Watch
from semidense.datasets.benchmarks.copies.fetch import Fetch
from semidense.datasets.benchmarks.copies.lock import Lock
from semidense.datasets.benchmarks.copies.publication import Publication
from semidense.pipeline.cli.console import print_json


def fetch(name: str, data: Path, lock: Path, origin: str | None, again: bool, as_json: bool) -> None:
    """Fetch a benchmark, if it is not here, and print how to use it.

    Raises:
        DatasetError: if there is none of that name, or it cannot be fetched.
        OSError: if the folder cannot be written.
    """
    wanted = publication(name)
    fresh = again or state(wanted, data) != "yes"
    if fresh:
        Fetch(data, Lock(lock), origin, _watching)(wanted)
    if as_json:
        print_json({"name": name, "dataset": wanted.spec_of(data), "fetched": fresh, "lock": str(lock)})
    else:
        _print_result(wanted, data, fresh)


def _print_result(wanted: Publication, data: Path, fresh: bool) -> None:
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"{wanted.name}: {'fetched' if fresh else 'already here; --again fetches it anew'}", markup=False)
    console.print(f"licence: {wanted.licence} ({wanted.home}); cite {wanted.cite}", markup=False)
    console.print(f"check it: pipeline data check {wanted.spec_of(data)}", markup=False)


@contextmanager
def _watching(address: str) -> Iterator[Watch]:
    """Give what a download tells how it goes on: a bar on a terminal, elsewhere one line a file; always on stderr."""
    console = Console(stderr=True, soft_wrap=True)
    console.print(f"fetching {address}", highlight=False, markup=False)
    columns = (*Progress.get_default_columns()[1:2], DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("", total=None)
        yield lambda here, total: bar.update(task, completed=here, total=total)
