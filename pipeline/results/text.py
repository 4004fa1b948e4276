"""Values as short texts for people, and the console that results are printed on."""

import json
from collections.abc import Sequence
from textwrap import fill

from rich.console import Console
from rich.table import Column, Table

from semidense.cache.keys.recipe import short

_SHOWN = 3
"""Values of a list that are written out, at most."""
_TEXT = 20
"""Characters that a line of a folded text has at least."""


def counted(number: int, one: str, several: str = "") -> str:
    """Return a number of things: ``several`` is their word if that is not ``one`` with an s.

    >>> counted(1, "scene"), counted(2_000, "scene"), counted(0, "entry", "entries")
    ('1 scene', '2,000 scenes', '0 entries')
    """
    return f"{number:,} {one if number == 1 else several or f'{one}s'}"


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


def print_table(table: Table, console: Console, spare: Sequence[str] = ()) -> None:
    """Print a table; where it is too wide, break its heads, leave columns out, then print it in parts.

    No number is cut: columns that are aligned right, or that must not wrap, keep their width. Other texts are folded.

    Args:
        table: with texts as cells. Its title is printed once, above the first part.
        console: to print on.
        spare: heads of the columns that may be left out, the least important first. They are named below the table.
    """
    out: list[str] = []
    if table.title:
        console.print(table.title, style="italic", markup=False)
    if not _fits(table, console):
        table = _with_broken_heads(table, console)
    for head in (each for each in spare if each in _heads(table)):
        if _fits(table, console):
            break
        out.append(head)
        table = _only(table, [each for each in _heads(table) if each != head])
    _print_in_parts(table, console)
    if out:
        console.print(f"left out at this width: {', '.join(out)}; --json has all", style="dim", markup=False)


def _print_in_parts(table: Table, console: Console) -> None:
    """Print a table that fits; one that does not as several with a blank line between, each with the first column."""
    heads = _heads(table)
    while heads:
        part = heads[:2]
        while len(part) < len(heads) and _fits(_only(table, heads[: len(part) + 1]), console):
            part = heads[: len(part) + 1]
        console.print(_only(table, part))
        rest = heads[len(part) :]
        heads = [heads[0], *rest] if rest else []
        if rest:
            console.print()


def _fits(table: Table, console: Console) -> bool:
    """Return whether a table fits when its texts are folded to ``_TEXT`` characters."""
    full = console.measure(table, options=console.options.update(width=1000)).maximum
    return full - sum(_foldable(column, console) for column in table.columns) <= console.width


def _foldable(column: Column, console: Console) -> int:
    """Return how many characters a column can be narrower than its longest cell."""
    return 0 if _is_whole(column) else max(0, *(width - _TEXT for width in _widths(column, console)))


def _widths(column: Column, console: Console) -> list[int]:
    """Return how many characters the head and each cell of a column need in one line."""
    options = console.options.update(width=1000)
    return [console.measure(cell, options=options).maximum for cell in (column.header, *column.cells)]


def _is_whole(column: Column) -> bool:
    return column.no_wrap or column.justify == "right"


def _heads(table: Table) -> list[str]:
    """Return the heads of a table, each in one line."""
    return [" ".join(str(column.header).split()) for column in table.columns]


def _with_broken_heads(table: Table, console: Console) -> Table:
    """Return a table whose heads are broken between words where they are wider than the cells below."""
    broken = _only(table, _heads(table))
    for column, head in zip(broken.columns, _heads(table), strict=True):
        width = max(1, *map(len, head.split()), *_widths(column, console)[1:])
        column.header = fill(head, width, break_on_hyphens=False)
    return broken


def _only(table: Table, heads: Sequence[str]) -> Table:
    """Return a table of some of the columns, named by their heads in one line."""
    kept = [column for column, head in zip(table.columns, _heads(table), strict=True) if head in heads]
    narrower = Table(box=None, pad_edge=table.pad_edge)
    for column in kept:
        narrower.add_column(column.header, justify=column.justify, no_wrap=_is_whole(column), overflow="fold")
    for cells in zip(*(column.cells for column in kept), strict=True):
        narrower.add_row(*cells)
    return narrower
