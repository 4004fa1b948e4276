"""Tell when a loop is compiled: that happens once a machine, and is kept on disk."""

from collections.abc import Callable

from numba.core.event import Event, Listener, register, unregister

_KIND = "numba:compile"


class Compiling(Listener):
    """Call a function when the first loop is compiled, from any thread; a loop found on disk is not compiled."""

    def __init__(self, tell: Callable[[], None]) -> None:
        """Listen until ``stop``.

        Args:
            tell: called once at most.
        """
        self._tell = tell
        self._told = False
        register(_KIND, self)  # type: ignore[no-untyped-call]

    def on_start(self, event: Event) -> None:
        """Tell, unless that was done."""
        if not self._told:
            self._told = True
            self._tell()

    def on_end(self, event: Event) -> None:
        """See nothing."""

    def stop(self) -> None:
        """Listen no more."""
        unregister(_KIND, self)  # type: ignore[no-untyped-call]
