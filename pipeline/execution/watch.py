"""The interface of progress displays: a run calls it."""

from typing import Protocol

from semidense.cache import Store
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Step


class Watch(Protocol):
    """The interface of a progress display. A run calls it, from any thread."""

    def planned(self, plan: Plan, store: Store) -> None:
        """A run begins: it will make what the plan lacks."""

    def deployed(self, told: str) -> None:
        """The workers of a cluster are there; ``told`` is one line about them."""

    def begun(self, step: Step, tiles: int) -> None:
        """A product is being made, in so many tiles."""

    def waiting(self, step: Step, holder: str) -> None:
        """Another process, or an equal scene of this run, is making the product: ``holder`` says which."""

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        """A tile, or a training step, is done."""

    def published(self, made: Made) -> None:
        """A product is there."""


class Unwatched:
    """A watch for workers in other processes: it sees nothing."""

    def planned(self, plan: Plan, store: Store) -> None:
        """See nothing."""

    def deployed(self, told: str) -> None:
        """See nothing."""

    def begun(self, step: Step, tiles: int) -> None:
        """See nothing."""

    def waiting(self, step: Step, holder: str) -> None:
        """See nothing."""

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        """See nothing."""

    def published(self, made: Made) -> None:
        """See nothing."""
