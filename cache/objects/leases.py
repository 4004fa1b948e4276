"""What running processes use: each run keeps a list of keys, and no cleaning deletes what is on a living list.

A run writes a key on its list, and then looks whether a cleaning is about to delete it. A cleaning says what it will
delete, and then reads the lists. Whichever comes second sees the other: the run waits, or the cleaning leaves the key.
"""

import secrets
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from semidense.cache.errors import CacheUnavailable
from semidense.cache.files import in_threads
from semidense.cache.layout import is_key, require_key
from semidense.cache.objects import names
from semidense.cache.objects.draft import discard
from semidense.cache.objects.living import EXPIRY, content_of, is_alive, take
from semidense.cache.objects.requests import Listed, Objects, connect

_PAUSE = 0.5
"""Seconds between two looks at a cleaning that is under way."""


@dataclass(frozen=True)
class ObjectLease:
    """The list of keys that a run uses; other processes that work for it can add to it.

    Attributes:
        url: of the cache.
        name: of the lease.
    """

    url: str
    name: str

    def discard_drafts(self) -> None:
        """Delete all drafts of its run, see ``Lease``."""
        objects = connect(self.url)
        for each in objects.names(f"drafts/{self.name}"):
            discard(objects, f"{self.name}/{each}")

    def add(self, keys: Iterable[str]) -> None:
        """Keep the entries of these keys, see ``Lease``."""
        wanted = {require_key(key) for key in keys}
        if not wanted:
            return
        objects = connect(self.url)
        objects.create(f"leases/{self.name}/keys/{secrets.token_hex(8)}", "\n".join(sorted(wanted)).encode("ascii"))
        if not self.is_seen():
            raise CacheUnavailable(
                f"the lease of this run in {self.url} has ended: the run's first process is gone, or was cut off from "
                f"the store for more than {EXPIRY:.0f} s; run again: what was made before is kept"
            )
        _wait_for_cleaning(objects, wanted)

    def is_seen(self) -> bool:
        """Return whether this process sees the lease: whether it works on the same cache as the run."""
        return connect(self.url).head(alive(self.name)) is not None


def alive(lease: str) -> str:
    """Return the object that says that a run is alive."""
    return f"leases/{lease}/alive"


@contextmanager
def leased(objects: Objects) -> Iterator[ObjectLease]:
    """Open a lease and end it with the block; its list of keys stays, and says when they were used."""
    name = names.new_lease()
    living = take(objects, alive(name))
    try:
        yield ObjectLease(objects.url, name)
    finally:
        if living:
            living.release()


def _wait_for_cleaning(objects: Objects, keys: set[str]) -> None:
    """Wait while a cleaning may be deleting one of these keys: what is there afterwards stays."""
    while (found := objects.get(names.CLEANING)) and keys & set(content_of(found).get("keys", ())):
        if not is_alive(objects, found):
            return
        time.sleep(_PAUSE)


@dataclass(frozen=True)
class Uses:
    """What the leases of a cache say.

    Attributes:
        living: names of the leases of living runs.
        dead: the objects that said that a run was alive, of runs that were killed.
        keys: keys on the lists of these.
        used: when a run last used a key, by the store's clock, in seconds since the epoch.
        lists: the objects of lists by the name of their lease, and the keys on each.
    """

    living: frozenset[str]
    dead: tuple[Listed, ...]
    keys: frozenset[str]
    used: Callable[[str], float]
    lists: tuple[tuple[Listed, frozenset[str]], ...]


def uses(objects: Objects) -> Uses:
    """Return what all leases say, those of runs that are gone too."""
    listed = list(objects.below("leases"))
    now = objects.now()
    signs = [each for each in listed if each.path.endswith("/alive")]
    dead = tuple(each for each in signs if now - each.modified >= EXPIRY)
    living = {_lease(each) for each in signs if each not in dead}
    found = [each for each in listed if "/keys/" in each.path]
    lists = tuple(zip(found, in_threads(lambda each: _keys(objects, each), found), strict=True))
    times: dict[str, float] = {}
    for each, keys in lists:
        times.update((key, each.modified) for key in keys if times.get(key, 0.0) < each.modified)
    in_use = frozenset(key for each, keys in lists if _lease(each) in living for key in keys)
    return Uses(frozenset(living), dead, in_use, lambda key: times.get(key, 0.0), lists)


def _lease(listed: Listed) -> str:
    return listed.path.split("/")[1]


def _keys(objects: Objects, listed: Listed) -> frozenset[str]:
    found = objects.get(listed.path)
    return frozenset(filter(is_key, found.data.decode("ascii", "replace").split())) if found else frozenset()
