"""What the products up to the cost volume are made from, and what can be set. Light: it does not load torch."""

from collections.abc import Sequence
from operator import attrgetter
from typing import Any, ClassVar, Literal, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from semidense.stages.compute.precision import Precision
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Network, Output, Params, RangeParams, Stage, Truth
from semidense.stages.transforms.declaration import Channels

Form = Literal["dense", "patch"]
Head = Literal["compact", "paper"]
Mode = Literal["exact", "guided", "fast"]
PATCH = 11
"""Side of the square patch that one answer of the matching-Net depends on, in pixels."""
RADIUS = PATCH // 2
DILATIONS = (1, 1, 2, 4)
"""Distance of the taps of each of the descriptor-Net's kernels, px."""
REACH = sum(DILATIONS)
"""Pixels that a descriptor looks away from its own."""
MARGIN = 4 + REACH
"""Pixels around a tile that propose to it in a guided volume, and what their descriptors see."""
CHUNK = 32
"""Rows of a chunk of the volume."""
NUMBERS = 3 << 24
"""Most numbers of a fast volume's tile that has more than one chunk: 192 MB."""
_BESIDE = 4 * 96
"""Numbers a pixel beside its costs: 96 each for the descriptors of both views and for two layers on the way to one."""


class MatchingSamplesParams(Params):
    """What the matching-Net learns from."""

    form: Form = Field(
        "dense", description="dense: crops of many pixels and disparities; patch: the paper's single patches"
    )
    samples: int = Field(18000, ge=1, description="number of samples, the same from every scene")
    dense_share: float | None = Field(
        None,
        gt=0,
        lt=1,
        description="share of the samples from scenes with a dense truth, where others have a sparse one; "
        "default: the same number from every scene",
    )
    height: int = Field(16, ge=1, le=256, description="rows of a dense crop, px")
    width: int = Field(32, ge=1, le=256, description="columns of a dense crop, px")
    slots: int = Field(12, ge=3, le=512, description="disparities at which a dense crop is compared, at most")
    mirror: bool = Field(
        True, description="take half of the samples from mirrored, exchanged views where the right view has a truth"
    )
    seed: int = Field(0, ge=0, description="seed of the random draw")

    @property
    def crop(self) -> tuple[int, int]:
        """Rows and columns of a sample."""
        return (1, 1) if self.form == "patch" else (self.height, self.width)

    @property
    def disparities(self) -> int:
        """Disparities of a sample."""
        return 2 if self.form == "patch" else self.slots


class MatchingNetParams(Schedule):
    """The matching-Net and how it is trained."""

    transformed: ClassVar[bool] = True  # its training in float32, which decides what `precision=auto` is
    steps: int = Field(4500, ge=1, description="optimiser steps")
    head: Head = Field("compact", description="hidden layers: 128 units, or the paper's 1600 and 128")
    batch: int = Field(
        4, ge=SHARDS, multiple_of=SHARDS, description="samples in one step; a multiple of the number of shards"
    )
    ranking: float = Field(4.0, ge=0, description="weight of the ranking loss; 0: no ranking loss, as in the paper")
    relight: float = Field(
        1.0,
        ge=0,
        le=3,
        description="strength of the random change of light in each view; 0: no change, as in the paper",
    )
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )
    seed: int = Field(0, ge=0, description="seed of the weights and the augmentation")


class CostVolumeParams(RangeParams):
    """Which cells are computed, and in which arithmetic."""

    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )
    mode: Mode = Field(
        "exact",
        description="exact: every cell by the matching-Net; guided: only proposed cells; fast: products of descriptors",
    )
    votes: int = Field(
        24,
        ge=1,
        le=144,
        description="pixels that must propose a disparity before it is computed, of 144 in and around a tile (guided)",
    )

    @property
    def transformed(self) -> bool:
        """Whether its convolutions are transformed in float32 alone, which decides what ``precision=auto`` is."""
        return self.mode == "fast"

    @property
    def context(self) -> int:
        """Pixels that a cell looks away from its own."""
        return {"exact": RADIUS, "guided": MARGIN, "fast": REACH}[self.mode]

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that the mode needs."""
        return ("channels", *_NETS[self.mode])

    @model_serializer(mode="wrap")
    def _that_matter(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what the volume does not depend on: it is in no key of one."""
        fields: dict[str, Any] = dump(self)
        return {name: value for name, value in fields.items() if name not in _WITHOUT[self.mode]}


_NETS = {
    "exact": ("matching_net",),
    "guided": ("matching_net", "descriptor_net"),
    "fast": ("descriptor_net",),
}
"""The networks that a volume of each mode takes."""
_WITHOUT = {"exact": ("mode", "votes"), "guided": (), "fast": ("votes",)}
"""The settings that a volume of each mode does not depend on."""


class MatchingSamples(TypedDict):
    """The product ``matching_samples``: where each crop lies, its disparities (sample, slot) and its truth."""

    scene: NDArray[np.int32]
    mirrored: NDArray[np.bool_]
    y: NDArray[np.int32]
    x: NDArray[np.int32]
    disparities: NDArray[np.int32]
    truth: NDArray[np.float32]


class OfTruths(TypedDict):
    """The truth of every training scene."""

    truth: Sequence[Truth]


class OfSamples(TypedDict):
    """What the networks of the costs learn from: samples, and the channels of every training scene."""

    matching_samples: MatchingSamples
    channels: Sequence[Channels]


class OfNetworks(TypedDict):
    """What a cost volume is made from; of the networks only those that its mode takes are there."""

    channels: Channels
    matching_net: NotRequired[Network]
    descriptor_net: NotRequired[Network]


MATCHING_SAMPLES = Stage(
    product="matching_samples",
    inputs=("truth",),
    outputs=(
        Output("scene", ("sample",), "int32", "1", "training scene, in the order of the split"),
        Output("mirrored", ("sample",), "bool", "1", "views flipped and exchanged"),
        Output("y", ("sample",), "int32", "px", "top row of the crop"),
        Output("x", ("sample",), "int32", "px", "left column of the crop"),
        Output(
            "disparities", ("sample", "slot"), "int32", "px", "disparities the crop is compared at, then -2147483648"
        ),
        Output("truth", ("sample", "row", "column"), "float32", "px", "true disparity where both views see the pixel"),
    ),
    compute="semidense.stages.matching.samples:draw_samples",
    params=MatchingSamplesParams,
    scope="split",
)

MATCHING_NET = Stage(
    product="matching_net",
    inputs=("matching_samples", "channels"),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights and channel scales of the matching-Net"),
        Output("loss", ("step",), "float32", "1", "loss of each training step"),
    ),
    compute="semidense.stages.matching.train:train_matching_net",
    params=MatchingNetParams,
    scope="split",
    monitored=True,
    learnt=True,
)


def _chunks_a_tile(params: CostVolumeParams, width: int) -> int:
    """Return how many chunks of rows a tile of the volume makes.

    Of a fast one as many as ``NUMBERS`` allows, at most 4: a tile computes all layers for its context anew.
    """
    if params.mode != "fast":
        return 1
    return min(4, max(1, NUMBERS // (CHUNK * width * (len(params.disparities) + _BESIDE))))


def _sizes(params: CostVolumeParams) -> dict[str, int]:
    return {"d": len(params.disparities)}


COST_VOLUME = Stage(
    product="costvolume",
    inputs=("channels", "matching_net", "descriptor_net"),
    outputs=(
        Output("cost", ("y", "x", "d"), "float16", "1", "log-odds of a mismatch; lower is better", {"x": 256}),
        Output("d", ("d",), "int16", "px", "disparity: x_right = x_left - d"),
    ),
    compute="semidense.stages.matching.cost_volume:compute_costs",
    params=CostVolumeParams,
    tile_rows=CHUNK,
    chunks_a_tile=_chunks_a_tile,
    halo=attrgetter("context"),
    border="edge",
    sizes=_sizes,
)
