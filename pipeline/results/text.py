"""Values as short texts for people, and the console that results are printed on."""

import json

from rich.console import Console

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
