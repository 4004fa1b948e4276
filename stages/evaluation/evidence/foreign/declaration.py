"""Declare what scores maps that another matcher made. Light: it does not load torch."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import MEANS, OF_MAP, REACH
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Always, DisparityMap, Images, Network, Output, Params, Stage, Truth
from semidense.stages.transforms.declaration import Channels

MATCHERS = ("sgm", "sncc", "census", "mc_cnn")
"""Other matchers whose maps are learnt from, by the names of their products."""
KINDS = (
    *(f"{matcher}, dense" for matcher in MATCHERS),
    "sgm, checked",
    "sgm, checked and filled",
    "mc_cnn, checked",
    "mc_cnn, checked and filled",
    "summed costs",
    "summed costs, whole disparities",
    "summed costs, smoothed",
    "summed costs, blurred",
)
"""The kinds of maps that are learnt from."""

OF_CELLS = (
    "cost",
    *(f"cost {side}" for side in MEANS),
    "excess",
    *(f"excess {side}" for side in MEANS),
    "beside",
    "rival",
    "rival 9",
    "judged",
)
"""What our costs at the map's disparities tell, the last on the feature axis; 0 without a right view.

- ``cost``: log-odds of a mismatch at the disparity, between the two cells beside it; and its means.
- ``excess``: by how much that lies above the least of the cells from 2 px below to 3 px above; and its means.
- ``beside``: how much more the outer two of these cells cost in the mean, 2 px below and 3 px above a whole disparity.
- ``rival``: by how much the cost lies above that of another pixel of the map that leads to the same right pixel.
- ``judged``: 1 with a right view, else 0.
"""
FEATURES = (*OF_MAP, *OF_CELLS)
"""The order of the feature axis."""


class ForeignSamplesParams(Params):
    """Which crops of each map the net learns from."""

    crops: int = Field(4, ge=1, description="crops of each map, around random pixels that have a disparity and a truth")
    height: int = Field(96, ge=2, multiple_of=2, description="rows of a crop that are judged, px")
    width: int = Field(96, ge=2, description="columns of a crop, px")
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )
    seed: int = Field(0, ge=0, description="seed of the random draw")


class ForeignNetParams(Schedule):
    """How the net that scores foreign maps learns."""

    steps: int = Field(2000, ge=1, description="optimiser steps")
    optimiser: Literal["muon", "adam"] = Field("adam", description="what makes a step of a large kernel's gradient")
    batch: int = Field(8, ge=SHARDS, multiple_of=SHARDS, description="crops a step; a multiple of the shards")
    blind: float = Field(0.5, ge=0, le=1, description="share of the crops that are seen without a right view")
    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as right, px")
    seed: int = Field(0, ge=0, description="seed of the weights and of the draw")


class ForeignConfidenceParams(Params):
    """What the confidence of a foreign map is made from."""

    right: bool | None = Field(
        None, description="let the costs of both views judge the map too; default: if the scene has a right view"
    )
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        judging = ("channels", "descriptor_net") if self.right else ()
        return ("images", "disparity", "evaluation_net", "foreign_net", *judging)


class ForeignSamples(TypedDict):
    """The product ``foreign_samples``: crops of the maps of a scene.

    ``features`` (crop, feature, seen, column) has ``REACH`` more rows than ``error`` (crop, row, column) above and
    below; ``kind`` (crop,) is the map's.
    """

    features: NDArray[np.floating]
    error: NDArray[np.float32]
    kind: NDArray[np.int8]


class OfForeignSamples(TypedDict):
    """The samples of every training scene."""

    foreign_samples: Sequence[ForeignSamples]


class Sampled(TypedDict):
    """A training scene, the maps of all matchers, and the networks that say what is known of them."""

    images: Images
    truth: Truth
    channels: Channels
    sgm: Mapping[str, Any]
    sncc: Mapping[str, Any]
    census: Mapping[str, Any]
    mc_cnn: Mapping[str, Any]
    aggregated: DisparityMap
    evaluation_net: Network
    descriptor_net: Network


class Foreign(TypedDict):
    """What the confidence of a foreign map is made from; the last two only where the right view is looked at."""

    images: Images
    disparity: DisparityMap
    evaluation_net: Network
    foreign_net: Network
    channels: NotRequired[Channels]
    descriptor_net: NotRequired[Network]


FOREIGN_SAMPLES = Stage(
    product="foreign_samples",
    inputs=("images", "truth", "channels", *MATCHERS, "aggregated", "evaluation_net", "descriptor_net"),
    outputs=(
        Output("features", ("crop", "feature", "seen", "column"), "float16", "1", "what is known: sign(v) ln(1 + |v|)"),
        Output("error", ("crop", "row", "column"), "float32", "px", "difference to the truth; NaN: unknown"),
        Output("kind", ("crop",), "int8", "1", "kind of its map: index into " + "; ".join(KINDS)),
    ),
    compute="semidense.stages.evaluation.evidence.foreign.samples:draw_foreign_samples",
    params=ForeignSamplesParams,
)
"""Crops of the maps of several matchers, checked, filled, smoothed: what is learnt from. One a scene, so that a
training that was stopped goes on with the scenes that are left."""

FOREIGN_NET = Stage(
    product="foreign_net",
    inputs=("foreign_samples",),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights of the net, and the scale of its inputs"),
        Output("loss", ("step",), "float32", "1", "cross-entropy of each training step"),
    ),
    compute="semidense.stages.evaluation.evidence.foreign.train:train_foreign_net",
    params=ForeignNetParams,
    scope="split",
    monitored=True,
    learnt=True,
)

FOREIGN_CONFIDENCE = Stage(
    product="foreign_confidence",
    inputs=("images", "disparity", "evaluation_net", "foreign_net", "channels", "descriptor_net"),
    outputs=(
        Output("confidence", ("y", "x"), "float32", "1", "probability that the disparity is right, in [0, 1]"),
        Output("network", ("y", "x"), "float32", "1", "probability by the evaluation-Net alone, in [0, 1]"),
        Output("agreement", ("y", "x"), "float32", "1", "share of the window with the same disparity, in (0, 1]"),
    ),
    compute="semidense.stages.evaluation.evidence.foreign.confidence:compute_foreign_confidence",
    params=ForeignConfidenceParams,
    tile_rows=256,
    halo=Always(RADIUS + REACH),
    border="edge",
    one_view=True,
)
"""The confidence of a map that another matcher made; ``use.confidence=foreign_confidence``. Only those inputs are made
that the settings need."""
