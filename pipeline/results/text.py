"""Values as short texts for people, and the console that results are printed on."""

import json
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from semidense.cache.keys.recipe import short

_SHOWN = 3
"""Values of a list that are written out, at most."""


def bytes_text(count: int) -> str:
    """Return a number of bytes for people: ``47.7 MB``."""
    value = float(count)
    for unit in ("B", "kB", "MB"):
        if value < 999.5:  # what rounds to 1000 is one of the next unit
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.4g} GB"


def value_text(value: object) -> str:
    """Return a setting or an ingredient as ``--set`` takes it, short: of a hash 12 digits, of a long list the first.

    >>> value_text(True), value_text(["gray", "rank"]), value_text([0, 1, 2, 3]), value_text("ab" * 32)
    ('true', 'gray,rank', '0 and 3 more', 'abababababab')
    """
    if isinstance(value, list) and len(value) > _SHOWN:
        return f"{value_text(value[0])} and {len(value) - 1} more"
    if isinstance(value, list):
        return ",".join(map(value_text, value))
    return short(value) if isinstance(value, str) else json.dumps(value)


def time_text(created: str) -> str:
    """Return when an entry was made, in UTC, to the second: ``2026-11-28 16:03:17``."""
    return created[:19].replace("T", " ")


def opening_text(folder: object, key: str) -> str:
    """Return the Python code that opens a cached product."""
    imports = "from semidense.pipeline import open_product, open_store"
    return f'{imports}; open_product(open_store("{folder}"), "{key}")'


def results() -> Console:
    """Return the console for results: as wide as the terminal, wide enough for any table elsewhere."""
    return Console(highlight=False) if Console().is_terminal else Console(highlight=False, width=240)


def print_table(table: Table, console: Console, spare: Sequence[str]) -> None:
    """Print a table; where it is too wide, leave columns out and name them below. No number is cut.

    Args:
        table: with texts as cells.
        console: to print on.
        spare: heads of the columns that may be left out, the least important first.
    """
    out: list[str] = []
    there = [str(column.header) for column in table.columns]
    for head in (each for each in spare if each in there):
        if _width(table, console) <= console.width:
            break
        out.append(head)
        table = _only(table, [str(column.header) for column in table.columns if column.header != head])
    console.print(table)
    if out:
        console.print(f"left out at this width: {', '.join(out)}; --json has all", style="dim", markup=False)


def print_in_parts(table: Table, console: Console) -> None:
    """Print a table; where it is too wide, print it as several, each with the first column. No number is cut."""
    heads = [str(column.header) for column in table.columns]
    while len(heads) > 1:
        part = heads[:2]
        while len(part) < len(heads) and _width(_only(table, heads[: len(part) + 1]), console) <= console.width:
            part = heads[: len(part) + 1]
        console.print(_only(table, part), "")
        heads = [heads[0], *heads[len(part) :]]


def _width(table: Table, console: Console) -> int:
    """Return the characters that a table needs to show every cell in one line."""
    return console.measure(table, options=console.options.update(width=1000)).maximum


def _only(table: Table, heads: Sequence[str]) -> Table:
    """Return a table of some of the columns."""
    kept = [column for column in table.columns if str(column.header) in heads]
    narrower = Table(box=None, pad_edge=table.pad_edge, title=table.title, title_justify=table.title_justify)
    for column in kept:
        narrower.add_column(column.header, justify=column.justify, no_wrap=column.no_wrap)
    for cells in zip(*(column.cells for column in kept), strict=True):
        narrower.add_row(*cells)
    return narrower
