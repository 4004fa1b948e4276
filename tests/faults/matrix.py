"""The fault matrix: its rows, how they are run, and how the table is printed."""

import logging
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from tests.faults import inputs, keys, machine, processes, storage
from tests.faults.runs import changes, far_cluster, mistakes, objects, workers
from tests.faults.tally import Tally

PROMISED = 5000
"""Faults and bad inputs that the large form injects at least."""


@dataclass(frozen=True)
class Row:
    """A row: what is done, and how large the quick form is next to the large one."""

    number: int
    title: str
    inject: Callable[[float], Tally]
    quick: float


ROWS = (
    Row(1, "kill -9 at every step of publishing, every kind of product", processes.kill_at_steps, 0.1),
    Row(2, "kill -9 at random times, also of the real pipeline", processes.kill_at_random, 0.1),
    Row(3, "SIGINT and SIGTERM in the middle of a stage", processes.signals, 0.17),
    Row(4, "a stage raises in one tile", processes.failing_stages, 0.5),
    Row(5, "disk full, files too large, no permission", processes.bad_disks, 0.1),
    Row(6, "a bit flipped at every offset of an entry", storage.flipped_bytes, 0.1),
    Row(
        7,
        "files truncated, zeroed, deleted, swapped, linked; entries copied; other formats",
        storage.damaged_files,
        0.1,
    ),
    Row(8, "many processes on the same keys, with gc and verify", processes.crowds, 0.1),
    Row(9, "settings, input bytes and source tokens changed", keys.changed_ingredients, 0.1),
    Row(10, "random sequences of run, sweep, damage, kill, gc, verify", machine.random_sequences, 0.05),
    Row(11, "bad images", inputs.bad_images, 0.1),
    Row(12, "bad maps, calibrations, configurations, weights, archives", inputs.bad_files, 0.1),
    Row(13, "workers with other code than the run", workers.other_code, 0.2),
    Row(14, "input files replaced between planning and reading, and put back", changes.replaced_inputs, 0.5),
    Row(15, "modules edited around their import", changes.edited_modules, 0.5),
    Row(16, "workers and schedulers killed during a run on a cluster", workers.killed_workers, 0.03),
    Row(17, "sweeping and cleaning beside living runs that no process id tells of", changes.living_runs, 0.2),
    Row(18, "folders, files and links of the user's own in the cache's place", changes.folders_of_others, 1),
    Row(19, "URLs as caches", changes.urls, 1),
    Row(20, "pipes and devices in place of files", mistakes.pipes, 1),
    Row(21, "mistakes on the command line, streams that are full or closed, too little memory", mistakes.commands, 0.5),
    Row(22, "calibrations that claim absurd ranges", mistakes.absurd_ranges, 1),
    Row(23, "records of a sweep", changes.records_of_a_sweep, 0.2),
    Row(24, "another CPU, and a result that differs", changes.other_cpus, 1),
    Row(25, "S3: kill -9 before and after each request that changes something", objects.killed_at_steps, 0.016),
    Row(
        26,
        "object store in memory: bits flipped; objects deleted, swapped, edited, foreign",
        objects.damaged_objects,
        0.1,
    ),
    Row(27, "S3: many processes on the same keys, with gc and verify", objects.crowds, 0.1),
    Row(
        28, "S3: slow, failing, conflicting and lost answers, dropped connections, late lists", objects.bad_stores, 0.1
    ),
    Row(29, "S3 and four workers: workers killed while requests go wrong", far_cluster.killed_workers, 0.1),
)
COLUMNS = ("injected", "wrong", "lost", "leftovers", "tracebacks")
HEADINGS = ("faults", "wrong results", "lost products", "leftovers", "tracebacks")


def run_row(row: Row, scale: float) -> dict[str, Any]:
    """Run a row and return its counts."""
    logging.getLogger("semidense.cache").setLevel(logging.ERROR)  # what is set aside is expected here
    started = time.monotonic()
    try:
        tally = row.inject(scale)
    finally:
        logging.getLogger("semidense.cache").setLevel(logging.NOTSET)
    about = {"row": row.number, "title": row.title, "seconds": round(time.monotonic() - started, 1)}
    return about | tally.to_dict()


def total(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Return the sum of each column."""
    rows = list(rows)
    return {name: sum(row[name] for row in rows) for name in COLUMNS}


def markdown(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return the table, as the documentation quotes it."""
    rows = list(rows)
    lines = [f"| # | fault | {' | '.join(HEADINGS)} |", "|---|---|" + "---:|" * len(HEADINGS)]
    for row in rows:
        counts = " | ".join(f"{row[name]:,}" for name in COLUMNS)
        lines.append(f"| {row['row']} | {row['title']}{_figures(row)} | {counts} |")
    counts = " | ".join(f"**{count:,}**" for count in total(rows).values())
    return "\n".join([*lines, f"| | **together** | {counts} |"])


def _figures(row: Mapping[str, Any]) -> str:
    told = ", ".join(f"{name} {count:,}" for name, count in row["figures"].items())
    return f" ({told})" if told else ""


def summary(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return one line with the counts, as the README quotes it."""
    counts = total(rows)
    return (
        f"`make faults` injects {counts['injected']:,} faults and bad inputs: {counts['wrong']:,} wrong results, "
        f"{counts['lost']:,} lost products, {counts['leftovers']:,} leftovers, {counts['tracebacks']:,} tracebacks."
    )
