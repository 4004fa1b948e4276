"""How long and how fast a network learns: the part of their settings that all networks share."""

from collections.abc import Sequence
from math import cos, pi
from typing import Literal, Self

from pydantic import Field

from semidense.stages.stage import Params

SHARDS = 2
"""Parts of a training step that may run at once; a constant, since it decides the order of the sums."""


class Schedule(Params):
    """How long and how fast a network learns."""

    steps: int = Field(1500, ge=1, description="optimiser steps")
    optimiser: Literal["muon", "adam"] = Field(
        "muon", description="optimiser of the large kernels: muon or adam; the other parameters use adam"
    )
    peak_rate: float = Field(0.004, gt=0, description="highest learning rate; the paper's is 0.002")
    last_rate: float = Field(0.0001, gt=0, description="learning rate of the last step")
    warm_up: float = Field(
        0.08, ge=0, lt=1, description="share of the steps in which the learning rate rises; 0: it starts at its peak"
    )
    clip: float = Field(1.0, gt=0, description="largest norm of the gradient; a larger one is scaled down")
    checkpoint_steps: int = Field(50, ge=1, description="steps between two checkpoints", exclude=True)

    @property
    def parts(self) -> Sequence["Schedule"]:
        """The schedules that the steps follow, one after the other: here only this one."""
        return (self,)

    def shortened(self, share: float) -> Self:
        """Return the same schedule with a share of its steps, one at least."""
        return self.model_copy(update={"steps": max(1, round(self.steps * share))})

    def rate(self, step: int) -> float:
        """Return the learning rate of a step: it rises in proportion, and falls from the peak along half a cosine."""
        share = step / max(self.steps - 1, 1)
        falling = self.last_rate + (self.peak_rate - self.last_rate) * (1 + cos(pi * share)) / 2
        rising = self.warm_up * self.steps
        return falling * min(1.0, (step + 1) / rising) if rising else falling
