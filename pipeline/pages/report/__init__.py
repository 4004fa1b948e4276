"""The report to hand around: one HTML file that needs nothing else."""

from pathlib import Path

from semidense.pipeline.api import Task


def report(task: Task | str = "motorcycle", output: Path | str = "report.html") -> Path:
    """Write what is cached of a dataset as one self-contained HTML file, and return its path. Nothing is made.

    Args:
        task: what to report on; a text is a dataset.
        output: the file; an existing one is replaced, at once.

    Raises:
        UsageError: if nothing of it is cached, or the file cannot be written.
        DatasetError, CacheError: what the user can mend, in one line.
    """
    from semidense.datasets.formats.atomic import atomic_write
    from semidense.pipeline.files.writing import explaining
    from semidense.pipeline.pages.report.gathered import gather
    from semidense.pipeline.pages.report.page import page

    path = Path(output)
    document = page(gather(Task(task) if isinstance(task, str) else task)).encode()
    with explaining(path), atomic_write(path) as file:
        file.write(document)
    return path
