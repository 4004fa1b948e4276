"""Small pairs whose disparity is known."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.transforms.gray import gray_moments

SHIFT = 3


def shifted_pair(height: int = 40, width: int = 64, shift: int = SHIFT, seed: int = 0) -> dict[str, NDArray[Any]]:
    """Return the product ``images`` of a plane at one disparity, with a random texture."""
    texture = np.random.default_rng(seed).integers(0, 256, (height, width + shift, 1), dtype=np.uint8)
    left, right = texture[:, :width], texture[:, shift:]
    return {"left": left, "right": right, "moments": np.array([gray_moments(view[..., 0]) for view in (left, right)])}
