"""Declare the two products that can veto a confidence. Light: it loads no numba."""

from operator import attrgetter
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from semidense.stages.stage import DisparityMap, Output, RangeParams, Stage
from semidense.stages.transforms.window import require_window

NEAREST_REPETITION = 4
"""Least shift of a patch that counts as a repetition, px. Smooth shading looks alike 2 or 3 px away."""
MOST_DISTINCT = 100.0
"""Distinctiveness beyond which nothing changes, and of pixels near which no patch with a shifted one fits."""
LARGEST_MARGIN = 40.0
"""Margin of a pixel whose costs have no rival of the winner, log-odds."""


class DistinctivenessParams(RangeParams):
    """From which difference on a patch can be told from the patches beside it."""

    window: int = Field(9, ge=3, le=101, description="side of the patch, px, odd")
    noise: float = Field(0.1, gt=0, le=255, description="mean difference that tells nothing, gray levels")
    share: float = Field(
        0.1, ge=0, le=1, description="mean difference that tells nothing, as a share of the patch's contrast"
    )
    margin: int = Field(6, ge=0, le=101, description="pixels around such a patch that are held to tell nothing too")

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_window(window)

    @property
    def halo(self) -> int:
        """Pixels of context that a tile needs on each side."""
        return self.window - 1 + self.margin

    @property
    def reach(self) -> int:
        """Largest shift at which a repetition matters, px: the disparities lie no further apart.

        Raises:
            StageError: if an end of the range is open.
        """
        return len(self.disparities) - 1


class Distinctiveness(TypedDict):
    """The product ``distinctiveness``: (y, x) of each view."""

    left: NDArray[np.float32]
    right: NDArray[np.float32]


class CostMargin(TypedDict):
    """The product ``cost_margin``: (y, x) log-odds, NaN: no winner."""

    margin: NDArray[np.float32]


class Vetoing(TypedDict):
    """What a veto is read off."""

    disparity: DisparityMap
    distinctiveness: Distinctiveness
    cost_margin: CostMargin


DISTINCTIVENESS = Stage(
    product="distinctiveness",
    inputs=("images",),
    outputs=(
        Output("left", ("y", "x"), "float32", "1", "left view: difference from what lies beside; below 1: no texture"),
        Output(
            "right", ("y", "x"), "float32", "1", "right view: difference from what lies beside; below 1: no texture"
        ),
    ),
    compute="semidense.stages.evaluation.silence.distinctiveness:compute_distinctiveness",
    params=DistinctivenessParams,
    tile_rows=256,
    halo=attrgetter("halo"),
)
"""Where the views themselves cannot tell a disparity, whatever matches them."""

COST_MARGIN = Stage(
    product="cost_margin",
    inputs=("costvolume",),
    outputs=(
        Output(
            "margin", ("y", "x"), "float32", "1", "log-odds by which the winner's best rival costs more; NaN: no winner"
        ),
    ),
    compute="semidense.stages.evaluation.silence.cost_margin:compute_cost_margin",
    tile_rows=64,
)
"""Where the costs cannot tell it. A tile has the rows of two chunks of the volume, so that each chunk is read once."""
