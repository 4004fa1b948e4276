"""Values as short texts for people, and the console that results are printed on."""

from rich.console import Console


def bytes_text(count: int) -> str:
    """Return a number of bytes for people: ``47.7 MB``."""
    value = float(count)
    for unit in ("B", "kB", "MB"):
        if value < 999.5:  # what rounds to 1000 is one of the next unit
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.4g} GB"


def results() -> Console:
    """Return the console for results: as wide as the terminal, wide enough for any table elsewhere."""
    return Console(highlight=False) if Console().is_terminal else Console(highlight=False, width=240)
