"""How long and how fast a network learns: the part of their settings that both networks share."""

from pydantic import Field

from stages.stage import Params

SHARDS = 2
"""Parts of a training step that may run at once; a constant, since it decides the order of the sums."""


class Schedule(Params):
    """How long and how fast a network learns."""

    steps: int = Field(1500, ge=1, description="optimiser steps")
    first_rate: float = Field(0.002, gt=0, description="learning rate of the first step")
    last_rate: float = Field(0.0001, gt=0, description="learning rate of the last step; it falls exponentially")
    clip: float = Field(1.0, gt=0, description="largest norm of a step's gradient")
    checkpoint_steps: int = Field(50, ge=1, description="steps between two checkpoints", exclude=True)

    def rate(self, step: int) -> float:
        """Return the learning rate of a step, falling exponentially from the first rate to the last."""
        share = step / max(self.steps - 1, 1)
        return float(self.first_rate * (self.last_rate / self.first_rate) ** share)
