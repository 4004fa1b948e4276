"""What the baselines are made from, and what can be set. Light: it loads none of the packages that they need."""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Always, Output, Params, RangeParams, Stage

_DENSE = Output("dense", ("y", "x"), "float32", "px", "disparity of every pixel, before anything is filtered")
_CHECKED = Output("disparity", ("y", "x"), "float32", "px", "disparity after the matcher's own checks; NaN: dropped")


class CheckedParams(RangeParams):
    """A matcher whose two views are compared."""

    tolerance: float = Field(1.0, ge=0, description="largest left-right difference that is kept, px")


class WindowParams(CheckedParams):
    """A matcher that sums what single pixels say over a window."""

    window: int = Field(9, ge=1, le=99, description="side of the square over which costs are averaged, px, odd")

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_odd(window)


class SgmParams(RangeParams):
    """OpenCV's semi-global block matching."""

    window: int = Field(3, ge=1, le=11, description="side of the matched block, px, odd")
    p1: int = Field(72, ge=0, description="penalty of a step of 1 px between neighbours")
    p2: int = Field(288, ge=1, description="penalty of a larger step; above p1")
    uniqueness: int = Field(10, ge=0, le=100, description="percent by which the best cost must be lower than the next")
    speckle: int = Field(
        100, ge=0, description="size of the largest isolated patch that is dropped, px; 0: drop no patch"
    )
    tolerance: int = Field(
        1, ge=1, description="largest left-right difference that is kept, px; OpenCV has none below 1"
    )

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_odd(window)

    @model_validator(mode="after")
    def _rising(self) -> "SgmParams":
        if self.p2 <= self.p1:
            raise ValueError(f"p2 {self.p2} must be above p1 {self.p1}")
        return self


class CostConfidenceParams(Params):
    """Confidence read off the cost volume."""

    window: int = Field(5, ge=1, le=99, description="side of the square over which APKR averages, px, odd")

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_odd(window)


def require_odd(window: int) -> int:
    """Return the side of a window.

    Raises:
        ValueError: if it is even: such a window has no centre.
    """
    if window % 2 == 0:
        raise ValueError(f"a window of {window} px has no centre: take an odd number")
    return window


CENSUS_WINDOW = (7, 9)
"""Rows and columns of the census window: 62 neighbours, so that a pixel's signature fits 64 bits."""
NCC_WINDOW = 3
"""Side of the inner window of SNCC, as published."""


def _census_halo(params: WindowParams) -> int:
    return CENSUS_WINDOW[0] // 2 + params.window // 2


def _ncc_halo(params: WindowParams) -> int:
    return NCC_WINDOW // 2 + params.window // 2


class Matched(TypedDict):
    """The product of a matcher: (y, x) disparities in px, NaN: none. ``disparity`` passed the matcher's own checks."""

    dense: NDArray[np.float32]
    disparity: NDArray[np.float32]


SGM = Stage(
    product="sgm",
    inputs=("images",),
    outputs=(_DENSE, _CHECKED),
    compute="semidense.stages.baselines.sgm:compute_sgm",
    params=SgmParams,
    needs=("opencv-python-headless",),
)
"""OpenCV's SGBM with 8 paths. Not tiled: its paths run over the whole image."""

CENSUS = Stage(
    product="census",
    inputs=("images",),
    outputs=(_DENSE, _CHECKED),
    compute="semidense.stages.baselines.census:compute_census",
    params=WindowParams,
    tile_rows=64,
    halo=_census_halo,
)
"""Census transform, Hamming distance, mean over a window, winner takes all."""

SNCC = Stage(
    product="sncc",
    inputs=("images",),
    outputs=(_DENSE, _CHECKED),
    compute="semidense.stages.baselines.sncc:compute_sncc",
    params=WindowParams,
    tile_rows=64,
    halo=_ncc_halo,
)
"""Summed normalised cross-correlation, winner takes all."""


def _window_halo(params: CostConfidenceParams) -> int:
    return params.window // 2


class CostMeasures(TypedDict):
    """The product ``cost_confidence``: (y, x) each, higher is surer, NaN: none."""

    apkr: NDArray[np.float32]
    pkrn: NDArray[np.float32]
    lrd: NDArray[np.float32]
    msm: NDArray[np.float32]


COST_CONFIDENCE = Stage(
    product="cost_confidence",
    inputs=("costvolume",),
    outputs=(
        Output("apkr", ("y", "x"), "float32", "1", "mean ratio of the rival's cost to the least, over a window"),
        Output("pkrn", ("y", "x"), "float32", "1", "ratio of the second least cost to the least"),
        Output("lrd", ("y", "x"), "float32", "1", "margin of the least cost over its left-right difference"),
        Output("msm", ("y", "x"), "float32", "1", "the least cost itself, with the sign turned"),
    ),
    compute="semidense.stages.baselines.cost_confidence:compute_cost_confidence",
    params=CostConfidenceParams,
    tile_rows=32,
    halo=_window_halo,
)
"""Four confidence measures of the raw disparity, from its cost volume alone; higher is surer, NaN: none."""


class ForestParams(Params):
    """The random forest of O1 and what it learns from."""

    samples: int = Field(100_000, ge=2, description="number of pixels to learn from, the same from every scene")
    trees: int = Field(10, ge=1, le=1000, description="number of trees")
    depth: int = Field(25, ge=1, le=100, description="depth of a tree, at most")
    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as correct, px")
    seed: int = Field(0, ge=0, description="seed of the random draw and of the trees")


class CcnnParams(Schedule):
    """The CCNN and how it is trained."""

    peak_rate: float = Field(0.002, gt=0, description="highest learning rate")
    crop: int = Field(64, ge=1, le=512, description="side of a training crop, px")
    batch: int = Field(
        4, ge=SHARDS, multiple_of=SHARDS, description="crops in one step; a multiple of the number of shards"
    )
    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as correct, px")
    seed: int = Field(0, ge=0, description="seed of the weights and the crops")


class Scored(TypedDict):
    """The product of a confidence measure: (y, x) probability that the disparity is right."""

    confidence: NDArray[np.float32]


_CONFIDENCE = Output("confidence", ("y", "x"), "float32", "1", "probability that the disparity is right, in [0, 1]")
O1_SIDES = (5, 7, 9, 11)
"""Sides of the windows over which O1's features are taken, px."""
CCNN_RADIUS = 4
"""Half of CCNN's patch of 9 x 9 px."""

MC_CNN_RADIUS = 5
"""Half of MC-CNN's patch of 11 x 11 px."""

MC_CNN = Stage(
    product="mc_cnn",
    inputs=("images",),
    outputs=(_DENSE, _CHECKED),
    compute="semidense.stages.baselines.mc_cnn:compute_mc_cnn",
    params=CheckedParams,
    needs=("mccnn",),
)
"""MC-CNN fast with its Middlebury weights, winner takes all. Not tiled: it standardises whole views."""

MC_CNN_ACCURATE = Stage(
    product="mc_cnn_accurate",
    inputs=("images",),
    outputs=(_DENSE, _CHECKED),
    compute="semidense.stages.baselines.mc_cnn:compute_mc_cnn_accurate",
    params=CheckedParams,
    tile_rows=32,
    halo=Always(MC_CNN_RADIUS),
    needs=("mccnn",),
)
"""MC-CNN accurate with its Middlebury weights, winner takes all; as slow as an exact cost volume."""


class Forest(TypedDict):
    """The product ``o1_forest``: (tree,) first nodes; (node,) what is compared, children and shares."""

    root: NDArray[np.int32]
    feature: NDArray[np.int32]
    threshold: NDArray[np.float64]
    lower: NDArray[np.int32]
    upper: NDArray[np.int32]
    right: NDArray[np.float32]


O1_FOREST = Stage(
    product="o1_forest",
    inputs=("disparity", "truth"),
    outputs=(
        Output("root", ("tree",), "int32", "1", "first node of each tree"),
        Output("feature", ("node",), "int32", "1", "which feature is compared; negative at a leaf"),
        Output("threshold", ("node",), "float64", "1", "up to this a sample goes to the lower child"),
        Output("lower", ("node",), "int32", "1", "node of the lower child"),
        Output("upper", ("node",), "int32", "1", "node of the upper child"),
        Output("right", ("node",), "float32", "1", "share of right disparities among the node's samples"),
    ),
    compute="semidense.stages.baselines.o1:train_forest",
    params=ForestParams,
    scope="split",
    needs=("scikit-learn",),
)

O1 = Stage(
    product="o1",
    inputs=("disparity", "o1_forest"),
    outputs=(_CONFIDENCE,),
    compute="semidense.stages.baselines.o1:compute_o1",
    tile_rows=128,
    halo=Always(O1_SIDES[-1] // 2),
)

CCNN_NET = Stage(
    product="ccnn_net",
    inputs=("disparity", "truth"),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights of the CCNN"),
        Output("loss", ("step",), "float32", "1", "class-balanced cross-entropy of each training step"),
    ),
    compute="semidense.stages.baselines.ccnn:train_ccnn",
    params=CcnnParams,
    scope="split",
    monitored=True,
)

CCNN = Stage(
    product="ccnn",
    inputs=("disparity", "ccnn_net"),
    outputs=(_CONFIDENCE,),
    compute="semidense.stages.baselines.ccnn:compute_ccnn",
    tile_rows=128,
    halo=Always(CCNN_RADIUS),
    border="edge",
)

MATCHED = (SGM, CENSUS, SNCC, MC_CNN, MC_CNN_ACCURATE)
"""Other matchers, which are made from the images alone."""
BASELINES = (COST_CONFIDENCE, O1_FOREST, O1, CCNN_NET, CCNN)
"""Other confidence measures, in an order in which each comes after what it is made from."""
