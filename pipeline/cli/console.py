"""Print results: tables for people, one JSON object for scripts. Results go to stdout."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from semidense.cache import Change, Store
from semidense.cache.keys.recipe import short
from semidense.pipeline.execution.scheduler import totals
from semidense.pipeline.plan.causes import PENDING
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.results.estimate import Estimate, Part, estimate, estimate_parts, in_all
from semidense.pipeline.results.metric_rows import FIGURES, MASK, THRESHOLD, averaged, with_means
from semidense.pipeline.results.text import counted, print_table, results
from semidense.stages.metrics.stage import ROW

_COLUMNS = (*ROW, "pixels")
_SPARE = tuple(FIGURES[name].head for name in ("pixels", "auc_optimal", "rms", "avgerr", "auc", "raw_bad"))
"""Columns of the metrics that a narrow terminal does without, the least important first."""
STYLES = {"hit": "green", "made": "cyan", "stale": "yellow", "missing": "dim"}


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object, and nothing else."""
    Console(soft_wrap=True).out(json.dumps(value, allow_nan=False), highlight=False)


def step_rows(plan: Plan, made: Mapping[str, Made]) -> list[dict[str, Any]]:
    """Return the rows that ``run`` and ``status`` promise: product, scene, key, state, changed, why, seconds."""
    return [_step_row(planned, made.get(planned.step.id)) for planned in plan.steps]


def _step_row(planned: Planned, made: Made | None) -> dict[str, Any]:
    fresh = made is not None and not made.reused
    state = "made" if fresh else "hit" if made else planned.state
    return {
        "product": planned.step.product,
        "scene": planned.step.scene,
        "key": made.key if made else planned.key,
        "state": state,
        "changed": [_change_row(change) for change in planned.changed],
        **({"damage": planned.damage} if planned.damage else {}),
        "why": list(planned.causes),
        "seconds": made.seconds if made else planned.seconds,
    }


def _change_row(change: Change) -> dict[str, Any]:
    return {"field": change.field, "old": change.old, "new": change.new}


def show_plan(plan: Plan, store: Store, as_json: bool, workers: int | None = None) -> None:
    """Print a plan and how long it will take, as a table or as JSON.

    Args:
        plan: what would be reused and made.
        store: the cache.
        as_json: print one JSON object.
        workers: also print what each product takes on so many workers.
    """
    parts = estimate_parts(plan, store)
    if as_json:
        own = {"workers": workers, "stages": [part_row(part, workers) for part in parts]} if workers else {}
        print_json({"steps": step_rows(plan, {}), "metrics": [], "estimate_seconds": in_all(parts).seconds, **own})
    else:
        print_plan(plan, in_all(parts, workers), parts if workers else (), workers or 1)


def part_row(part: Part, workers: int) -> dict[str, Any]:
    """Return the row that ``run --dry-run --json`` promises for each product that is to be made."""
    seconds = part.seconds_on(workers)
    hours = None if seconds is None else seconds / 3600
    return {"product": part.product, "results": part.results, "tasks": part.tasks, "bytes": part.bytes, "hours": hours}


def _print_parts(parts: Sequence[Part], workers: int, console: Console) -> None:
    """Print a line a product: how many tasks and bytes, and how long they take."""
    heads = ("tasks", "MB", f"min on {counted(workers, 'worker')}")
    table = Table("product", *heads, box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for part in parts:
        seconds = part.seconds_on(workers)
        size = "unknown" if part.bytes is None else f"{part.bytes / 1e6:,.1f}"
        table.add_row(part.product, f"{part.tasks:,}", size, "unknown" if seconds is None else f"{seconds / 60:,.2f}")
    print_table(table, console, ("tasks",))


def print_plan(plan: Plan, time: Estimate, parts: Sequence[Part] = (), workers: int = 1) -> None:
    """Print a line a product and scene: its state, its key, and why it is not a hit; then how long a run takes."""
    console = results()
    print_table(_plan_table(plan), console, ("key",))
    print_notes(plan.notes)
    if parts:
        _print_parts(parts, workers, console)
    todo: dict[str, int] = {}
    for planned in plan.todo():
        todo[planned.step.product] = todo.get(planned.step.product, 0) + 1
    hits = len(plan.steps) - len(plan.todo())
    making = ", ".join(f"{count} {product}" for product, count in todo.items()) or "nothing"
    console.print(f"reuses {counted(hits, 'product')}, makes {making}", highlight=False)
    if todo:
        where = f" on {counted(workers, 'worker')}" if parts and time.seconds is not None else ""
        console.print(f"time: {time}{where}", highlight=False)


def _plan_table(plan: Plan) -> Table:
    """Return a line a step; a column "why" only if a step is not a hit."""
    tellers: dict[str, str] = {}
    reasons = [escape(why(planned, tellers)) for planned in plan.steps]
    table = Table("product", "scene", "state", "key", *(["why"] if any(reasons) else []), box=None, pad_edge=False)
    for planned, reason in zip(plan.steps, reasons, strict=True):
        state = f"[{STYLES[planned.state]}]{planned.state}[/]"
        cells = (planned.step.product, escape(planned.step.scene), state, short(planned.key or ""))
        table.add_row(*cells, *([reason] if any(reasons) else []))
    return table


LONG = 10.0
"""Seconds from which a run says beforehand how long it will take."""


def announce(plan: Plan, store: Store) -> None:
    """Print on stderr how long a run will take, if that is over 10 s."""
    expected = estimate(plan, store)
    if expected.known > LONG:
        Console(stderr=True, soft_wrap=True).print(f"time: {expected}", highlight=False, markup=False)


def why(planned: Planned, tellers: dict[str, str] | None = None) -> str:
    """Return why a step is not a hit, in one line; nothing for a hit.

    Args:
        planned: the step.
        tellers: the product that told each cause first, which this call adds to: a product below it names only that
            product, so that a cause is told once.
    """
    if planned.damage:
        return f"damaged: {planned.damage}"
    if planned.state == "missing":
        return "never made" if planned.key else "never made; its inputs are not there yet"
    if planned.causes:
        product, tellers = planned.step.product, {} if tellers is None else tellers
        told = dict.fromkeys(tellers.setdefault(cause, product) for cause in planned.causes)
        fresh = [cause for cause in planned.causes if tellers[cause] == product]
        above = [each for each in told if each != product]
        return "; ".join([*_telling(fresh), *([f"because of {', '.join(above)}"] if above else [])])
    above = [change.field.removeprefix("inputs.") for change in planned.changed if change.new == PENDING]
    own = [str(change) for change in planned.changed if change.new != PENDING]
    return "; ".join([*_telling(own), *([f"made after {', '.join(above)}"] if above else [])])


def _telling(changes: Sequence[str], most: int = 3) -> Iterable[str]:
    """Return the first changes, and how many more there are."""
    yield from changes[:most]
    if len(changes) > most:
        yield f"and {len(changes) - most} more"


def print_notes(notes: Sequence[str]) -> None:
    """Print what a person should know; many of a kind in one line."""
    console = Console(stderr=True, soft_wrap=True)
    for note in notes[:5]:
        console.print(f"note: {note}", highlight=False, style="dim", markup=False)
    if len(notes) > 5:
        console.print(f"note: and {len(notes) - 5} more like these", style="dim", highlight=False)


def reuse_line(made: Iterable[Made]) -> str:
    """Return one line that says what was reused and what was made."""
    counts = totals(made)
    reused = sum(old for old, _ in counts.values())
    fresh = ", ".join(f"{new} {product}" for product, (_, new) in counts.items() if new)
    return f"reused {counted(reused, 'product')}, made {fresh or 'nothing'}"


def print_metrics(rows: Sequence[Mapping[str, Any]], masks: Mapping[str, str]) -> None:
    """Print the table of metrics: non-occluded pixels, every threshold, and the mean of several scenes.

    Args:
        rows: as ``run --json`` gives them.
        masks: where the mask of each scene comes from.
    """
    shown = with_means([row for row in rows if row["mask"] == MASK])
    if shown:
        _print_rows(shown, masks)


def _print_rows(rows: Sequence[Mapping[str, Any]], masks: Mapping[str, str]) -> None:
    swept = len({_swept(row) for row in rows}) > 1
    by_threshold = any("R" in row for row in rows)
    heads = ("threshold px", *(["R"] if by_threshold else []), *(FIGURES[name].head for name in _COLUMNS))
    table = Table("scene", *(Column(head, justify="right") for head in heads), box=None)
    if swept:
        table.add_column("settings")
    for row in rows:
        table.add_row(*_cells(row, by_threshold), *([escape(_swept(row))] if swept else []))
    console = results()
    thresholds = {row["threshold_px"] for row in rows}
    alike = len(thresholds) == 1  # then the line below tells it
    print_table(table, console, (*_SPARE, "threshold px") if alike else _SPARE)
    kinds = ", ".join(sorted(set(masks.values())))
    wrong = f"wrong above {thresholds.pop():g} px; " if alike else ""
    console.print(
        f"mask: nonocc ({kinds}); {wrong}bad and errors are of reported pixels, "
        "raw bad counts unreported ones as wrong; thresholds in pixels of the image at hand",
        style="dim",
        highlight=False,
    )


def _swept(row: Mapping[str, Any]) -> str:
    """Return the settings of a variant, but for R, which has a column of its own."""
    settings = str(row.get("variant", "")).split(", ")
    return ", ".join(each for each in settings if not each.startswith("semidense.R="))


def _cells(row: Mapping[str, Any], by_threshold: bool) -> list[str]:
    """Return a row's cells; with one for R if a row of the table was filtered by a threshold."""
    figures = [FIGURES[name].text(row.get(name)) for name in _COLUMNS]
    threshold = [f"{row['R']:g}" if "R" in row else "-"] if by_threshold else []
    return [escape(row["scene"]), f"{row['threshold_px']:g}", *threshold, *figures]


def print_sweep(rows: Sequence[Mapping[str, Any]], masks: Mapping[str, str]) -> None:
    """Print error and density for each R: the mean over scenes, or the scene if there is one."""
    chosen = [row for row in rows if row["mask"] == MASK and row["threshold_px"] == THRESHOLD]
    if chosen:
        _print_rows(averaged(chosen), masks)
