"""Check every entry of a cache, and measure what takes up its space. Nothing is changed."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.entries.check import read_plain
from semidense.cache.errors import DamagedEntry, EntryNotFound
from semidense.cache.files import THREADS, reading, walk
from semidense.cache.objects.requests import Objects, connect
from semidense.cache.store import Store
from semidense.cache.upkeep.objects_gc import view

Progress = Callable[[int, int], None]
"""Called with the number of entries done and their total."""


@dataclass(frozen=True)
class Report:
    """What ``verify`` found.

    Attributes:
        sound: keys of the entries that are, to the byte, what was published.
        damaged: what is wrong, by key.
        quarantined: why each thing in quarantine is there, by the name of its folder.
    """

    sound: tuple[str, ...]
    damaged: Mapping[str, str]
    quarantined: Mapping[str, str]


@dataclass(frozen=True)
class Sizes:
    """Where the bytes of a cache are.

    Attributes:
        stages: bytes of the entries of each stage.
        quarantine: bytes of damaged entries that were moved aside.
        drafts: bytes of work in progress, or left by processes that are gone.
        orphans: bytes of data that have no well-formed record.
        total: bytes of all files in the cache.
    """

    stages: Mapping[str, int]
    quarantine: int
    drafts: int
    orphans: int
    total: int

    @property
    def bookkeeping(self) -> int:
        """Bytes of all else: records of the entries, sources of the stages, locks."""
        return max(0, self.total - sum(self.stages.values()) - self.quarantine - self.drafts - self.orphans)


def verify(store: Store, keys: Iterable[str] | None = None, progress: Progress | None = None) -> Report:
    """Read every byte of every entry again, whatever the store's policy, and list what is in quarantine.

    Args:
        store: the cache.
        keys: the entries to look at; all of them if None.
        progress: told after each entry.

    Returns:
        The report. An entry that is deleted meanwhile is in neither list, one that ``keys`` names and
        that never was there is among the damaged.

    Raises:
        InvalidKey: if one of ``keys`` is not a key.
        CacheUnavailable: if the file system refuses.
    """
    store.backend.require_cache()
    wanted = sorted(set(store.backend.record_keys() if keys is None else keys))
    findings: dict[str, str | None] = {}
    with ThreadPoolExecutor(THREADS) as pool:
        for key, finding in zip(wanted, pool.map(lambda key: _finding(store, key, keys is None), wanted), strict=True):
            findings[key] = finding
            if progress:
                progress(len(findings), len(wanted))
    sound = tuple(key for key, finding in findings.items() if finding is None)
    return Report(sound, {key: finding for key, finding in findings.items() if finding}, _quarantined(store))


def _finding(store: Store, key: str, may_vanish: bool) -> str | None:
    """Return what is wrong with an entry, None if it is sound, nothing ("") if it is gone and may be."""
    try:
        store.backend.verify(key)
    except EntryNotFound as error:
        return "" if may_vanish else str(error)
    except DamagedEntry as error:
        return str(error)
    return None


def _quarantined(store: Store) -> dict[str, str]:
    """Return the reason of each thing in quarantine, by folder, or by key in an object store."""
    if isinstance(store.root, str):
        return {key: aside.reason for key, aside in view(connect(store.root)).asides.items()}
    reasons = {}
    for path in store.layout.things(store.layout.quarantine):
        reasons[path.name] = "unknown: its reason was never written"
        with reading(path), suppress(FileNotFoundError, NotADirectoryError, DamagedEntry):
            reasons[path.name] = read_plain(path / "reason.txt").decode("utf-8", "replace").strip()
    return reasons


def size(store: Store) -> Sizes:
    """Add up the bytes of a cache, by what they are; a cache that does not exist has none.

    Raises:
        CacheUnavailable: if the place refuses.
    """
    stages: dict[str, int] = {}
    recorded = set()
    for entry in store.entries():
        recorded.add(entry.key)
        stages[entry.recipe.stage] = stages.get(entry.recipe.stage, 0) + entry.size
    if isinstance(store.root, str):
        return _sizes_of_objects(connect(store.root), stages)
    layout = store.layout
    orphans = sum(_bytes(layout.entry(key)) for key in layout.entry_keys() if key not in recorded)
    return Sizes(stages, _bytes(layout.quarantine), _bytes(layout.drafts), orphans, _bytes(layout.root))


def _sizes_of_objects(objects: Objects, stages: Mapping[str, int]) -> Sizes:
    found = view(objects)
    drafts = {each.path.removeprefix("drafts/") for each in objects.below("drafts")}
    asides = {aside.place for aside in found.asides.values()}
    unpublished = {place: data.size for place, data in found.places.items() if place not in found.referred}
    return Sizes(
        stages,
        quarantine=sum(data.size for place, data in found.places.items() if place in asides),
        drafts=sum(size for place, size in unpublished.items() if place in drafts),
        orphans=sum(size for place, size in unpublished.items() if place not in drafts),
        total=sum(each.size for each in objects.below("")),
    )


def _bytes(path: Path) -> int:
    """Return the bytes of all files in a folder; a file that vanishes meanwhile counts nothing."""
    total = 0
    with reading(path), suppress(FileNotFoundError):
        for _, thing in walk(path) if path.is_dir() else ():
            with suppress(FileNotFoundError):
                total += 0 if thing.is_dir(follow_symlinks=False) else thing.stat(follow_symlinks=False).st_size
    return total
