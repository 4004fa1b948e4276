"""What a training needs of its scenes: made when a sample asks for it, and kept as long as there is room."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class _HasBytes(Protocol):
    @property
    def nbytes(self) -> int: ...


T = TypeVar("T", bound=_HasBytes)
MOST_BYTES = 1 << 30
"""What is kept at most: enough for the 29 Middlebury scenes of a third of the size; more scenes are made again."""


class Scenes(Generic[T]):
    """One array, or a few, a training scene, by the scene's number; those that were asked for last are kept.

    Args:
        make: returns what is needed of a scene; the same for the same number, so that nothing depends on what was kept.
        count: how many scenes there are.
    """

    def __init__(self, make: Callable[[int], T], count: int) -> None:
        self._make, self._count = make, count
        self._kept: OrderedDict[int, T] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, scene: int) -> T:
        """Return what is needed of a scene.

        Raises:
            IndexError: if there is no such scene.
        """
        if not 0 <= scene < self._count:
            raise IndexError(scene)
        with self._lock:
            found = self._kept.pop(scene, None)
            if found is not None:
                self._kept[scene] = found
        return self._add(scene) if found is None else found

    def _add(self, scene: int) -> T:
        """Make what is needed of a scene, without the lock, and drop those that were not asked for for longest."""
        made = self._make(scene)
        with self._lock:
            self._kept[scene] = made
            while len(self._kept) > 1 and sum(each.nbytes for each in self._kept.values()) > MOST_BYTES:
                self._kept.popitem(last=False)
        return made
