"""What the tasks of a run are given and hand on, and how their errors are told."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from semidense.cache import Draft, Store
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.proof import require_same
from semidense.pipeline.execution.recent_inputs import Recent
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.errors import StageFailed, StageRefused, told_of_stage
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step

Span = tuple[float, float]
"""When work began and ended, in seconds since the epoch."""


@dataclass(frozen=True)
class Context:
    """What every task is given.

    Attributes:
        store: the cache.
        watch: told how it goes on.
        extras: stored beside each result.
        claims: who makes what.
        recent: what was read last.
        runner: hashes of the code that carries out tasks, for workers to prove theirs; None in the planning process.
    """

    store: Store
    watch: Watch
    extras: Mapping[str, Any]
    claims: Claims
    recent: Recent = field(default_factory=Recent)
    runner: Mapping[str, str] | None = None

    def admit(self, step: Step) -> None:
        """Refuse to work on a step in a process that would make another result.

        Raises:
            UsageError: naming what differs here.
        """
        if self.runner is not None:
            require_same(step, self.runner)


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


@contextmanager
def explained(step: Step, where: str = "") -> Iterator[None]:
    """Name product, scene and tile in whatever goes wrong."""
    try:
        yield
    except (StageFailed, StageRefused):
        raise
    except Exception as error:
        place = f"{step.name}, {where}" if where else step.name
        if line := told_of_stage(error):
            raise StageRefused(f"{place}: {line}") from error
        raise StageFailed(f"{place}: {error}" if str(error) else f"{place}: {type(error).__name__}") from error
