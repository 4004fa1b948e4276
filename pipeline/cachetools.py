"""List, verify and measure a cache."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from cache.verify import size, verify
from pipeline.api import open_store
from pipeline.console import print_json, results


def list_entries(folder: Path | None, as_json: bool) -> None:
    """Print a line an entry, oldest first."""
    entries = sorted(open_store(folder).entries(), key=lambda entry: entry.created)
    if as_json:
        names = ("key", "digest", "created", "seconds", "size")
        print_json(
            {"entries": [{**entry.label, **{name: getattr(entry, name) for name in names}} for entry in entries]}
        )
        return
    table = Table("product", "dataset", "scene", "size", "age", "made in", "key", box=None)
    for entry in entries:
        label = [escape(entry.label.get(name, "")) for name in ("product", "dataset", "scene")]
        table.add_row(*label, bytes_text(entry.size), _age(entry.created), f"{entry.seconds:.2f} s", entry.key[:12])
    results().print(table)


def verify_entries(folder: Path | None, as_json: bool) -> bool:
    """Check every byte of every entry, print what is wrong; return whether nothing is."""
    store = open_store(folder)
    with Progress(console=Console(stderr=True), transient=True, disable=not Console(stderr=True).is_terminal) as bar:
        task = bar.add_task("verifying", total=None)
        report = verify(store, progress=lambda done, total: bar.update(task, completed=done, total=total))
    sound = not report.damaged
    if as_json:
        print_json(
            {"sound": len(report.sound), "damaged": dict(report.damaged), "quarantined": dict(report.quarantined)}
        )
        return sound
    console = results()
    for key, reason in report.damaged.items():
        console.print(
            f"damaged {key[:12]}: {reason}; it will be moved to quarantine and made again when it is needed",
            markup=False,
        )
    for name, reason in report.quarantined.items():
        console.print(f"in quarantine {name}: {reason}", style="dim", markup=False)
    console.print(f"{len(report.sound)} sound, {len(report.damaged)} damaged, {len(report.quarantined)} in quarantine")
    return sound


def print_sizes(folder: Path | None, as_json: bool) -> None:
    """Print how much space each product takes, and everything together."""
    store = open_store(folder)
    sizes = size(store)
    parts = {"quarantine": sizes.quarantine, "drafts": sizes.drafts, "orphans": sizes.orphans, "total": sizes.total}
    if as_json:
        print_json({"cache": str(store.root), "products": dict(sizes.stages), **parts})
        return
    console = results()
    console.print(f"{store.root}", style="bold", markup=False)
    console.print(_sizes_table(sizes.stages, parts))


def _sizes_table(products: Mapping[str, int], parts: Mapping[str, int]) -> Table:
    table = Table("product", "size", box=None)
    table.columns[1].justify = "right"
    for name, count in [*sorted(products.items(), key=lambda item: -item[1]), *parts.items()]:
        table.add_row(name, bytes_text(count))
    return table


def bytes_text(count: int) -> str:
    """Return a number of bytes for people: ``47.7 MB``."""
    value = float(count)
    for unit in ("B", "kB", "MB"):
        if value < 999.5:  # what rounds to 1000 is one of the next unit
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.4g} GB"


def _age(created: str) -> str:
    seconds = (datetime.now(UTC) - datetime.fromisoformat(created)).total_seconds()
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 0):.0f} s"
