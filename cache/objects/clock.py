"""The store's clock, as this machine knows it: by it, all machines agree on who is alive."""

import time
from dataclasses import dataclass

AGREE = 1.0
"""Seconds by which this machine's clock may run away from its counter before the store's clock is read again."""


@dataclass(frozen=True)
class Clock:
    """What the store's clock said, and when.

    Attributes:
        store: what it said, in seconds since the epoch.
        counter: of this machine then, in seconds: nobody sets it, and it stands still while the machine sleeps.
        wall: this machine's own clock then, in seconds since the epoch.
    """

    store: float
    counter: float
    wall: float

    @classmethod
    def read(cls, store: float) -> "Clock":
        """Return a clock by which it is ``store`` now."""
        return cls(store, time.monotonic(), time.time())

    def now(self) -> float:
        """Return what the store's clock says now, in seconds since the epoch."""
        return self.store + time.monotonic() - self.counter

    def is_right(self) -> bool:
        """Return whether the machine neither slept since then nor had its own clock set."""
        return abs((time.time() - self.wall) - (time.monotonic() - self.counter)) < AGREE
