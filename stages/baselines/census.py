"""The census matcher: which neighbours are darker than the centre, compared bit by bit."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import CENSUS_WINDOW, Matched, WindowParams
from semidense.stages.baselines.window import match_windows
from semidense.stages.stage import OfImages
from semidense.stages.transforms.census import census_transform, hamming
from semidense.stages.transforms.gray import gray_views


def compute_census(params: WindowParams, inputs: OfImages) -> Matched:
    """Compute the product ``census``; see ``match_windows`` and ``census_transform``."""
    left, right = (census_transform(view, CENSUS_WINDOW) for view in gray_views(inputs["images"]))

    def costs(_: int, columns: slice, seen: slice) -> NDArray[np.float32]:
        return hamming(left[:, columns], right[:, seen])

    return match_windows(costs, left.shape, params.disparities, params.window, params.tolerance)
