"""The report to hand around: one HTML file that needs nothing else."""

from pathlib import Path
from typing import Unpack

from semidense.pipeline.api import Data, Options, Task
from semidense.pipeline.plan.errors import UsageError

_START = 1000
"""Bytes in which a report says what wrote it."""


def report(dataset: Data | Task = "motorcycle", output: Path | str = "report.html", **options: Unpack[Options]) -> Path:
    """Write what is cached of a dataset as one self-contained HTML file, and return its path. Nothing is made.

    Args:
        dataset: what to report on: a dataset, or a task that ``options`` refine.
        output: the file; an existing report is replaced, at once.
        **options: as for ``run``.

    Raises:
        UsageError: if nothing of it is cached, the file cannot be written, or it is there and no report.
        DatasetError, CacheError: what the user can mend, in one line.
    """
    from semidense.datasets.formats.atomic import atomic_write
    from semidense.pipeline.files.writing import explaining
    from semidense.pipeline.pages.report.gathered import gather
    from semidense.pipeline.pages.report.page import page

    path = Path(output)
    _refuse_foreign(path)
    document = page(gather(Task.of(dataset, **options))).encode()
    with explaining(path), atomic_write(path) as file:
        file.write(document)
    return path


def _refuse_foreign(path: Path) -> None:
    """Refuse to replace a file that is no report."""
    from semidense.pipeline.pages.report.page import GENERATOR

    if path.is_file():
        with path.open("rb") as file:
            if GENERATOR.encode() not in file.read(_START):
                raise UsageError(
                    f"{path}: this file is no report of this program; move it, or name another file with -o"
                )
