"""The data that tasks of a run take and pass on, and the messages of their errors."""

import threading
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semidense.cache import Draft, Store
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.cluster.proof import require_same
from semidense.pipeline.execution.cluster.sharing import ROOM
from semidense.pipeline.execution.tiles import Labelled, labelled, own
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.errors import StageFailed, StageRefused, told_of_stage
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step
from semidense.stages.compute.allocator import keep_freed_memory
from semidense.stages.stage import Array

Span = tuple[float, float]
"""When work began and ended, in seconds since the epoch."""


MOST_BYTES = 64 << 20
"""What is kept at most."""
LARGE = MOST_BYTES // 4
"""A product of more bytes is read each time."""


class Recent:
    """The products read last, or made, by one process in one run; sent to another process, it arrives empty."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, dict[str, Labelled]] = OrderedDict()
        self._size = 0
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type["Recent"], tuple[()]]:
        return Recent, ()

    def read(self, store: Store, key: str) -> dict[str, Array]:
        """Return all arrays of an entry, in memory, the caller's own.

        Raises:
            CacheError: if the entry is missing or damaged.
        """
        return {name: own(array.values) for name, array in self.open(store, key).items()}

    def open(self, store: Store, key: str) -> Mapping[str, Labelled]:
        """Return all arrays of an entry, not to be changed: a small one in memory, which all its tiles share.

        Raises:
            CacheError: if the entry is missing or damaged.
        """
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
        return self._open(store, key) if found is None else found

    def _open(self, store: Store, key: str) -> dict[str, Labelled]:
        """Return the arrays of an entry that is not kept; keep a small one."""
        arrays = store.arrays(key)
        found = labelled(arrays)
        if _bytes(found) > LARGE:
            return found
        from semidense.cache.entries.reader import values_of

        found = {name: Labelled(values_of(array), found[name].dims) for name, array in arrays.items()}
        self.keep(key, found)
        return found

    def keep(self, key: str, arrays: dict[str, Labelled]) -> None:
        """Keep a small product, whose arrays nobody changes, and drop those that were not used for longest."""
        with self._lock:
            self._size += _bytes(arrays) - _bytes(self._kept.get(key, {}))
            self._kept[key] = arrays
            while self._size > MOST_BYTES:
                self._size -= _bytes(self._kept.popitem(last=False)[1])


def _bytes(arrays: dict[str, Labelled]) -> int:
    return sum(array.values.nbytes for array in arrays.values())


class Unread(Mapping[str, Array]):
    """The arrays of an entry by name, each read from the cache whenever it is asked for; none is kept."""

    def __init__(self, store: Store, key: str) -> None:
        self._store, self._key = store, key

    def __getitem__(self, name: str) -> Array:
        """Return an array, in memory.

        Raises:
            KeyError: if there is none of this name.
            CacheError: if the entry is missing or damaged.
        """
        return np.asarray(self._store.arrays(self._key)[name][...])

    def __iter__(self) -> Iterator[str]:
        return iter(self._store.arrays(self._key))

    def __len__(self) -> int:
        return len(self._store.arrays(self._key))


@dataclass(frozen=True)
class Context:
    """What every task is given.

    Attributes:
        store: the cache.
        watch: told how it goes on.
        extras: stored beside each result.
        claims: who makes what.
        recent: what was read last, or made.
        runner: hashes of the code that carries out tasks, for workers to prove theirs; None in the planning process.
    """

    store: Store
    watch: Watch
    extras: Mapping[str, Any]
    claims: Claims
    recent: Recent = field(default_factory=Recent)
    runner: Mapping[str, str] | None = None

    def admit(self, step: Step) -> None:
        """Refuse to work on a step in a process that would make another result; make a worker's process ready for it.

        Raises:
            UsageError: naming what differs here.
        """
        if self.runner is not None:
            require_same(step, self.runner)
            keep_freed_memory()

    def room(self, step: Step) -> AbstractContextManager[None]:
        """Return the context in which a step's work is done: on a cluster, a training has its worker to itself."""
        if self.runner is None:
            return nullcontext()
        return ROOM.alone() if step.stage.monitored else ROOM.together()


@dataclass(frozen=True)
class Job:
    """A product in the making.

    Attributes:
        step: what is made.
        inputs: keys of the entries it is made from, by product.
        draft: where it is written; None if an equal result was there already.
        made: the result that was there already, else None.
    """

    step: Step
    inputs: Mapping[str, tuple[str, ...]]
    draft: Draft | None
    made: Made | None


def flat(results: Iterable[Made | Sequence[Made]]) -> list[Made]:
    """Return what tasks made: some made one product, some several."""
    return [made for each in results for made in ([each] if isinstance(each, Made) else each)]


def explained(step: Step, where: str = "") -> AbstractContextManager[None]:
    """Name product, scene and tile in whatever goes wrong."""
    return explained_at(f"{step.name}, {where}" if where else step.name)


@contextmanager
def explained_at(place: str) -> Iterator[None]:
    """Name a place in whatever goes wrong there."""
    try:
        yield
    except (StageFailed, StageRefused):
        raise
    except Exception as error:
        if line := told_of_stage(error):
            raise StageRefused(f"{place}: {line}") from error
        raise StageFailed(f"{place}: {type(error).__name__}{f': {error}' if str(error) else ''}") from error
