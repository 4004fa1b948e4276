"""Products that many steps of a run read: kept in memory after the first reading, which checked every byte."""

import threading
from collections import OrderedDict

from semidense.cache import Store
from semidense.stages.stage import Array

MOST_BYTES = 64 << 20
"""What is kept at most."""
LARGE = MOST_BYTES // 4
"""A product of more bytes is read each time."""


class Recent:
    """The products read last by one process in one run; sent to another process, it arrives empty."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, dict[str, Array]] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type["Recent"], tuple[()]]:
        return Recent, ()

    def read(self, store: Store, key: str) -> dict[str, Array]:
        """Return all arrays of an entry, in memory, the caller's own.

        Raises:
            CacheError: if the entry is missing or damaged.
        """
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
        if found is None:
            found = store.read(key)
            if _bytes(found) > LARGE:
                return found
            self._keep(key, found)
        return {name: array.copy() for name, array in found.items()}

    def _keep(self, key: str, arrays: dict[str, Array]) -> None:
        """Keep a product, and drop those that were not read for longest."""
        with self._lock:
            self._kept[key] = arrays
            while sum(map(_bytes, self._kept.values())) > MOST_BYTES:
                self._kept.popitem(last=False)


def _bytes(arrays: dict[str, Array]) -> int:
    return sum(array.nbytes for array in arrays.values())
