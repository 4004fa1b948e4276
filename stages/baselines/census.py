"""The census matcher: which neighbours are darker than the centre, compared bit by bit."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import CENSUS_WINDOW, WindowParams
from semidense.stages.baselines.window import match_windows
from semidense.stages.stage import Arrays, Inputs
from semidense.stages.transforms.census import census_transform, hamming
from semidense.stages.transforms.gray import to_gray


def compute_census(params: WindowParams, inputs: Inputs) -> Arrays:
    """Compute the product ``census``; see ``match_windows`` and ``census_transform``."""
    left, right = (census_transform(to_gray(inputs["images"][view]), CENSUS_WINDOW) for view in ("left", "right"))

    def costs(_: int, columns: slice, seen: slice) -> NDArray[np.float32]:
        return hamming(left[:, columns], right[:, seen])

    return match_windows(costs, left.shape, params.disparities, params.window, params.tolerance)
