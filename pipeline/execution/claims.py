"""Who makes what: one product is made by one process, where waiting for it is cheaper than making it again.

A process that is to make a product claims its key. Where another has the claim, it says for whom it waits, and
when the claim is free, by the product's being there or by the other's death, it looks again and takes over.

It does not wait where two processes might wait for each other: a run with unfinished products of its own keeps
at least one thread at work on them, and makes twice what it would have to wait for. Publishing then compares.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from semidense.cache import Claim, Lease, Store
from semidense.cache.owner import describe, owner
from semidense.pipeline.plan.errors import PipelineError

SHORTEST, LONGEST = 0.01, 0.25
"""Seconds between two looks at a claim that another process has."""


class RunStopped(PipelineError, RuntimeError):  # noqa: N818 - it says what happened
    """The run ended while one of its tasks was waiting."""


class Claims:
    """Notes what a run uses and claims nothing: for a cluster, whose scheduler has each step made once."""

    def __init__(self, lease: Lease) -> None:
        self.lease = lease

    def take(self, key: str, waiting: Callable[[str], None]) -> None:
        """Prepare for making ``key``; see ``LocalClaims``."""
        self.lease.add([key])

    def opening(self) -> AbstractContextManager[None]:
        """Return a context in which a draft is begun and told to who deletes the drafts of a run that ends early."""
        return nullcontext()

    def release(self, key: str) -> None:
        """Say that ``key`` is made, or will not be."""

    def stop(self) -> None:
        """Wake all that wait, and have no draft begun any more: the run ends early, or is done."""

    def close(self) -> None:
        """Give all claims back."""


class LocalClaims(Claims):
    """The claims of a run on the threads of this process."""

    def __init__(self, lease: Lease, store: Store, threads: int) -> None:
        super().__init__(lease)
        self._store, self._threads = store, threads
        self._claimed: dict[str, Claim] = {}
        self._waiting = 0
        self._closed = threading.Event()
        self._lock = threading.Lock()
        self._opening = threading.Lock()

    def take(self, key: str, waiting: Callable[[str], None]) -> None:
        """Claim ``key``, after waiting for a process that has it where that is safe.

        Args:
            key: of the product to make.
            waiting: told once for whom this waits.

        Raises:
            RunStopped: if the run ends meanwhile.
            CacheUnavailable: if the file system refuses.
        """
        super().take(key, waiting)
        claim = self._store.claim(key)
        if claim is None and self._may_wait():
            try:
                claim = self._wait(key, waiting)
            finally:
                with self._lock:
                    self._waiting -= 1
        if claim:
            with self._lock:
                self._claimed[key] = claim

    def _may_wait(self) -> bool:
        """Count this thread among those that wait, unless the run's own products would then stand still."""
        with self._lock:
            if self._claimed and self._waiting + 1 >= self._threads:
                return False
            self._waiting += 1
            return True

    def _wait(self, key: str, waiting: Callable[[str], None]) -> Claim:
        pause, told = SHORTEST, False
        while (claim := self._store.claim(key)) is None:
            if self._closed.wait(pause):
                raise RunStopped("the run ended while this was waiting")
            pause = min(2 * pause, LONGEST)
            if not told and pause >= LONGEST:
                told = True
                waiting(self._holder(key))
        return claim

    def _holder(self, key: str) -> str:
        """Return who makes a product; scenes of one run share products that have the same inputs."""
        holder = self._store.claimant(key)
        return "an equal scene of this run" if holder == describe(owner()) else holder or "another process"

    @contextmanager
    def opening(self) -> Iterator[None]:
        """Return a context that ``stop`` waits for, so that a draft that is just being made is not left behind.

        Raises:
            RunStopped: if the run ended.
        """
        with self._opening:
            if self._closed.is_set():
                raise RunStopped("the run ended before this was begun")
            yield

    def release(self, key: str) -> None:
        """Give a claim back; nothing happens to one that was never taken."""
        with self._lock:
            claim = self._claimed.pop(key, None)
        if claim:
            claim.release()

    def stop(self) -> None:
        """Wake all that wait, and have no draft begun any more: the run ends early, or is done."""
        with self._opening:
            self._closed.set()

    def close(self) -> None:
        """Give all claims back."""
        for key in list(self._claimed):
            self.release(key)
