"""Declare the alignment of the views, the disparity maps of both and what follows them. Loads no numba."""

from typing import Literal, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from semidense.stages.stage import CostVolume, DisparityMap, Output, Params, Stage

ALIGNMENT = Stage(
    product="alignment",
    inputs=("images", "survey"),
    outputs=(
        Output("rows", ("y",), "float32", "px", "how far the right view lies below the left one: the part of a row"),
        Output("columns", ("x",), "float32", "px", "the part of a column of the right view; the offset is their sum"),
        Output("offsets", ("match", "place"), "float32", "px", "row and column in the right view, and offset measured"),
    ),
    compute="semidense.stages.disparity.alignment:compute_alignment",
)
"""What ``channels.align`` shifts the right view's rows by. Not tiled: a plane is one of the whole image."""


class DisparityParams(Params):
    """How a disparity is read off the cost volume."""

    subpixel: bool = Field(
        default=False,
        description="refine the disparity below a pixel, by a parabola through three costs; off in the paper",
    )


DISPARITY = Stage(
    product="disparity",
    inputs=("costvolume",),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "raw disparity of the left view; NaN: no valid cost"),),
    compute="semidense.stages.disparity.winner_takes_all:compute_disparity",
    params=DisparityParams,
    tile_rows=32,
)
"""The raw disparity. ``costvolume`` has ``cost`` (y, x, d) float16 and its coordinate ``d`` (d,) int16, px. A tile has
the rows of one chunk of the volume, so that each chunk is read once."""


class AggregatedParams(Params):
    """How costs are summed along paths, and how a disparity is read off the sums."""

    paths: Literal[8, 16] = Field(8, description="directions that costs are summed along")
    p1: float = Field(
        110, ge=0, le=900, description="penalty of a step of 1 px along a path, log-odds; larger: smoother surfaces"
    )
    oblique: float = Field(
        0.25, ge=0, le=1, description="share of p1 along paths that are neither row nor column: these follow slopes"
    )
    p2: float = Field(  # sums of 16 paths fit 16 bits up to 900
        900, ge=0, le=900, description="penalty of a larger step, log-odds; larger: fewer jumps and fewer small objects"
    )
    edge: float = Field(
        1.5,
        ge=0.01,
        le=100_000,
        description="the penalties are halved where the smoothed gray differs by so much, of 255",
    )
    passes: Literal[1, 2] = Field(
        1, description="2: add the mean of the first path costs to the cost of each cell, and sum once more"
    )
    subpixel: bool = Field(
        True, description="refine the disparity below a pixel, to the tip of a V through three summed costs"
    )
    median: Literal[1, 3, 5] = Field(
        3, description="side of the square window, px, whose median takes the place of each disparity; 1: no median"
    )

    @model_validator(mode="after")
    def _rising(self) -> "AggregatedParams":
        if self.p2 < self.p1:
            raise ValueError(f"p2 {self.p2:g} must be at least p1 {self.p1:g}")
        return self


class RefinedParams(Params):
    """What is done to the filtered map; nothing by default."""

    left_right: bool = Field(False, description="drop disparities that the right view's own map contradicts")
    tolerance: float = Field(1.0, ge=0, description="largest left-right difference that still counts as agreement, px")
    subpixel: bool = Field(
        False, description="refine each disparity below a pixel, to the lowest point of a parabola through three costs"
    )

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        right = ("right_disparity",) if self.left_right else ()
        return ("semidense", *right, *(("costvolume",) if self.subpixel else ()))


RIGHT_DISPARITY = Stage(
    product="right_disparity",
    inputs=("costvolume",),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "raw disparity of the right view: x_left = x_right + d"),
    ),
    compute="semidense.stages.disparity.right_view:compute_right_disparity",
    tile_rows=32,
)
"""The right view's raw disparity, from the same cost volume. A tile has the rows of one chunk of the volume."""

_EVIDENCE = Output(
    "evidence", ("feature", "y", "x"), "float16", "1", "what the costs say of each pixel; NaN: no disparity", {"y": 256}
)

AGGREGATED = Stage(
    product="aggregated",
    inputs=("images", "costvolume"),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "disparity of the left view by costs summed along paths"),
        _EVIDENCE,
    ),
    compute="semidense.stages.disparity.aggregation.stage:compute_aggregated",
    params=AggregatedParams,
    lazy=("costvolume",),
)
"""The left view's disparity of least aggregated cost, after a median, and what the costs say of it before the median.
``use.disparity=aggregated`` puts it in the place of ``disparity``. Not tiled: paths run over the whole image; the
volume is read in strips."""

RIGHT_AGGREGATED = Stage(
    product="right_aggregated",
    inputs=("images", "costvolume"),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "disparity of the right view by costs summed along paths"),
        _EVIDENCE,
    ),
    compute="semidense.stages.disparity.aggregation.stage:compute_right_aggregated",
    params=AggregatedParams,
    section="aggregated",
    lazy=("costvolume",),
)
"""The same of the right view, from the same volume; ``use.right_disparity=right_aggregated``."""


class OfFiltered(TypedDict):
    """What a map is refined with; of the last two only those that the settings need are there."""

    semidense: DisparityMap
    right_disparity: NotRequired[DisparityMap]
    costvolume: NotRequired[CostVolume]


REFINED = Stage(
    product="refined",
    inputs=("semidense", "right_disparity", "costvolume"),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "filtered disparity, checked and refined as asked"),),
    compute="semidense.stages.disparity.refinement:compute_refined",
    params=RefinedParams,
    tile_rows=32,
)
"""The filtered map after the steps that were asked for; with none of them, the filtered map itself. Only those inputs
are made that the settings need."""


class OfRefined(TypedDict):
    """The map whose holes are filled."""

    refined: DisparityMap


class Filled(TypedDict):
    """The product ``filled``: (y, x) disparities in px, and which of them are guesses."""

    disparity: NDArray[np.float32]
    guessed: NDArray[np.bool_]


FILLED = Stage(
    product="filled",
    inputs=("refined",),
    outputs=(
        Output(
            "disparity", ("y", "x"), "float32", "px", "disparity without holes; NaN only where there is none at all"
        ),
        Output("guessed", ("y", "x"), "bool", "1", "pixels that were filled: guesses, not measurements"),
    ),
    compute="semidense.stages.disparity.filling:compute_filled",
)
"""The refined map with its holes filled. Not tiled: a hole may be as high as the image."""
