"""Let a training have its worker to itself, however many threads that has: it uses all cores of its process.

Dask's resources would need workers that were started with them, on every deployment. The threads of a process can tell
each other.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Room:
    """Where the tasks of one process are: many together, or one alone."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._inside = 0
        self._closed = False

    @contextmanager
    def together(self) -> Iterator[None]:
        """Return a context that is beside others, and waits for one that is alone or about to be."""
        with self._changed:
            self._changed.wait_for(lambda: not self._closed)
            self._inside += 1
        try:
            yield
        finally:
            with self._changed:
                self._inside -= 1
                self._changed.notify_all()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Return a context that begins when all others have ended, and lets none begin until it ends."""
        with self._changed:
            self._changed.wait_for(lambda: not self._closed)
            self._closed = True
            self._changed.wait_for(lambda: not self._inside)
        try:
            yield
        finally:
            with self._changed:
                self._closed = False
                self._changed.notify_all()


ROOM = Room()
"""Of this process."""
