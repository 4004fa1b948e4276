"""What the descriptor-Net is made from, and what can be set. Light: it does not load torch."""

from collections.abc import Sequence
from typing import ClassVar, Literal, NotRequired

from pydantic import Field

from semidense.stages.compute.precision import Precision
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.matching.declaration import OfSamples
from semidense.stages.stage import Images, Output, Stage, Truth

Width = Literal[32, 64, 96, 128]
"""Filters of a layer of the descriptor-Net, and numbers of a descriptor."""
WIDTH: Width = 64
"""That of the indoor weights that come with the package; the general ones have 96."""


class DescriptorNetParams(Schedule):
    """The descriptor-Net of guided and fast volumes and how it is trained."""

    transformed: ClassVar[bool] = True  # its training in float32, which decides what `precision=auto` is
    steps: int = Field(9000, ge=1, description="optimiser steps")
    peak_rate: float = Field(0.008, gt=0, description="highest learning rate")
    batch: int = Field(
        8, ge=SHARDS, multiple_of=SHARDS, description="samples in one step; a multiple of the number of shards"
    )
    ranking: float = Field(4.0, ge=0, description="weight of the ranking loss; 0: no ranking loss")
    relight: float = Field(
        1.0, ge=0, le=3, description="strength of the random change of light in each view; 0: no change"
    )
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )
    seed: int = Field(0, ge=0, description="seed of the weights and the augmentation")
    width: Width = Field(
        WIDTH, description="filters of a layer where the network is trained: 32, 64, 96 or 128; more take longer"
    )
    summed_steps: int = Field(
        0, ge=0, description="steps after these that learn from maps by costs summed along paths; 0: none"
    )
    summed_rate: float = Field(0.002, gt=0, description="highest learning rate of these further steps")
    summed_height: int = Field(128, ge=8, le=512, description="rows of the crops that costs are summed in, px")
    summed_width: int = Field(288, ge=8, le=1024, description="columns of these crops, px")

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        return ("matching_samples", "channels", *(("images", "truth") if self.summed_steps else ()))

    @property
    def parts(self) -> tuple[Schedule, ...]:
        """The steps that learn from single cells, then those that learn from summed costs."""
        summed = {"steps": self.summed_steps, "peak_rate": self.summed_rate}
        return (self, self.model_copy(update=summed)) if self.summed_steps else (self,)

    def shortened(self, share: float) -> "DescriptorNetParams":
        """Return the settings with a share of the steps, of both kinds."""
        shorter = super().shortened(share)
        return shorter.model_copy(update={"summed_steps": round(self.summed_steps * share)})


class OfSummed(OfSamples):
    """The same, with the images and the truth of every training scene where costs are summed."""

    images: NotRequired[Sequence[Images]]
    truth: NotRequired[Sequence[Truth]]


DESCRIPTOR_NET = Stage(
    product="descriptor_net",
    inputs=("matching_samples", "channels", "images", "truth"),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights and channel scales of the descriptor-Net"),
        Output("loss", ("step",), "float32", "1", "loss of each training step"),
    ),
    compute="semidense.stages.matching.descriptors.training:train_descriptor_net",
    params=DescriptorNetParams,
    scope="split",
    monitored=True,
    learnt=True,
)
