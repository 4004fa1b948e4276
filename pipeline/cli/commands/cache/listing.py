"""List, verify and measure a cache, or a part of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from semidense.cache import Entry, Store
from semidense.cache.keys.recipe import short
from semidense.cache.upkeep.verify import size, verify
from semidense.pipeline.api import open_store
from semidense.pipeline.cli.console import print_json
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.settings import Settings
from semidense.pipeline.results.text import bytes_text, counted, print_table, results


@dataclass(frozen=True)
class Selection:
    """The entries that a command works on: all, or only those of some keys, a product or a scene."""

    keys: tuple[str, ...] = ()
    product: str | None = None
    scene: str | None = None

    def of(self, store: Store) -> list[Entry]:
        """Return the entries selected, oldest first.

        Raises:
            UsageError: if a key is the start of none, or of several.
        """
        entries = sorted(store.entries(), key=lambda entry: entry.created)
        wanted = {_only(entries, start).key for start in self.keys} if self.keys else None
        return [entry for entry in entries if (wanted is None or entry.key in wanted) and self._fits(entry)]

    def require(self, store: Store) -> list[Entry]:
        """Return the entries selected, at least one.

        Raises:
            UsageError: if there is none.
        """
        if not (found := self.of(store)):
            raise UsageError(f"no entry of {store.root} is selected: `pipeline cache ls` shows what there is")
        return found

    def _fits(self, entry: Entry) -> bool:
        scene = entry.label.get("scene", "")
        return self.product in (None, entry.label.get("product")) and self.scene in (
            None,
            scene,
            scene.rsplit("/", 1)[-1],
        )

    @property
    def is_all(self) -> bool:
        """Whether all entries are selected."""
        return self == Selection()


LONGEST = 60
"""Letters of an entry's settings in a table."""


def _only(entries: Iterable[Entry], start: str) -> Entry:
    found = [entry for entry in entries if entry.key.startswith(start)] if start else []
    if len(found) != 1:
        raise UsageError(f"key {start!r}: {len(found)} entries begin so; `pipeline cache ls --json` shows whole keys")
    return found[0]


def list_entries(folder: str | None, selection: Selection, as_json: bool) -> None:
    """Print a line an entry, oldest first, with the settings that it belongs to.

    Raises:
        UsageError: if a part of the cache is asked for, and there is nothing in it.
    """
    store = open_store(folder)
    entries = selection.of(store) if selection.is_all else selection.require(store)
    settings, used = Settings(store.entries()), store.last_used()
    if as_json:
        names = ("key", "digest", "created", "seconds")
        rows = [
            {**entry.label, **{name: getattr(entry, name) for name in names}, "bytes": entry.size}
            | {"last_used": _time(used(entry.key)), "settings": settings.text(entry)}
            for entry in entries
        ]
        print_json({"entries": rows})
        return
    table = Table("product", "dataset", "scene", "size", "age", "last used", "made in", "key", "settings", box=None)
    for column in table.columns:
        column.no_wrap = True
    for column in table.columns[3:7]:
        column.justify = "right"
    for entry in entries:
        label = [escape(entry.label.get(name, "")) for name in ("product", "dataset", "scene")]
        times = (_age(entry.created), _age(_time(used(entry.key))), f"{entry.seconds:.2f} s")
        table.add_row(*label, bytes_text(entry.size), *times, short(entry.key), escape(_cut(settings.text(entry))))
    console = results()
    print_table(table, console, ("settings", "last used", "dataset", "made in", "age"))
    console.print(f"{counted(len(entries), 'entry', 'entries')}, {bytes_text(sum(entry.size for entry in entries))}")


def _cut(text: str) -> str:
    """Return a text that leaves the other columns their room; --json gives all of it."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def _time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")


def verify_entries(folder: str | None, selection: Selection, as_json: bool) -> bool:
    """Check every byte of the entries, print what is wrong; return whether nothing is."""
    store = open_store(folder)
    keys = None if selection.is_all else [entry.key for entry in selection.require(store)]
    with Progress(console=Console(stderr=True), transient=True, disable=not Console(stderr=True).is_terminal) as bar:
        task = bar.add_task("verifying", total=None)
        report = verify(store, keys, progress=lambda done, total: bar.update(task, completed=done, total=total))
    sound = not report.damaged
    if as_json:
        print_json(
            {"sound": len(report.sound), "damaged": dict(report.damaged), "quarantined": dict(report.quarantined)}
        )
        return sound
    console = results()
    for key, reason in report.damaged.items():
        console.print(
            f"damaged {short(key)}: {reason}; it will be moved to quarantine and made again when it is needed",
            markup=False,
        )
    for name, reason in report.quarantined.items():
        console.print(f"in quarantine {name}: {reason}", style="dim", markup=False)
    console.print(f"{len(report.sound)} sound, {len(report.damaged)} damaged, {len(report.quarantined)} in quarantine")
    return sound


def print_sizes(folder: str | None, as_json: bool) -> None:
    """Print how much space each product takes, and everything together."""
    store = open_store(folder)
    sizes = size(store)
    names = ("quarantine", "drafts", "orphans", "bookkeeping", "total")
    parts = {name: getattr(sizes, name) for name in names}
    if as_json:
        print_json({"cache": str(store.root), "products": dict(sizes.stages), **parts})
        return
    console = results()
    console.print(f"{store.root}", style="bold", markup=False)
    print_table(_sizes_table(sizes.stages, parts), console)


def _sizes_table(products: Mapping[str, int], parts: Mapping[str, int]) -> Table:
    table = Table("product", "size", box=None)
    table.columns[1].justify = "right"
    for name, count in [*sorted(products.items(), key=lambda item: -item[1]), *parts.items()]:
        table.add_row("records and sources" if name == "bookkeeping" else name, bytes_text(count))
    return table


def _age(created: str) -> str:
    seconds = (datetime.now(UTC) - datetime.fromisoformat(created)).total_seconds()
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 0):.0f} s"
