"""What a disparity map and its left view tell of each pixel, whoever made the map."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.agreement import padded_agreement
from semidense.stages.evaluation.confidence import padded_log_odds
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import AGREEMENTS, MEANS, OF_MAP
from semidense.stages.evaluation.evidence.likeness import distinctiveness, support
from semidense.stages.evaluation.evidence.overlap import overlap
from semidense.stages.evaluation.evidence.windows import window_mean
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.evaluation.net import evaluation_net_from_parameters
from semidense.stages.stage import Images, Network
from semidense.stages.transforms.gray import to_gray

STEP: Literal[4] = 4
"""Pixels from one answer of the evaluation-Net to the next: a sixteenth of the work. On training scenes its answer at
every pixel made the order of the pixels no better. A tile begins at a multiple of it."""
LARGEST_STEP = 10.0
"""Steps beyond it are told alike, px."""
NETWORK, AGREEMENT = OF_MAP.index("network"), OF_MAP.index("agreement 25")


def of_map(
    images: Images, disparity: NDArray[np.float32], evaluation_net: Network, precision: Precision
) -> NDArray[np.float32]:
    """Return the features of a map, of arrays with 50 px of context all round.

    Args:
        images: ``left`` (y + 100, x + 100, band) and ``moments``.
        disparity: (y + 100, x + 100) float32, px; NaN: none.
        evaluation_net: ``parameters``.
        precision: arithmetic of the evaluation-Net.

    Returns:
        (feature, y, x) float32, in the order of ``OF_MAP``; NaN where nothing is known.
    """
    steps = np.minimum(_largest_step(disparity), np.float32(LARGEST_STEP))
    own = disparity[:, RADIUS:-RADIUS]
    hidden = np.pad(overlap(own), ((0, 0), (RADIUS, RADIUS)), mode="edge")
    known = np.isfinite(disparity).astype(np.float32)
    gray = to_gray(images["left"])
    distinct = distinctiveness(gray)
    column = np.arange(own.shape[1], dtype=np.float32) - own[RADIUS:-RADIUS]
    return np.stack(
        [
            _network_log_odds(images, disparity, evaluation_net, precision),
            *(padded_agreement(disparity, side) for side in AGREEMENTS),
            *(window_mean(known, side) for side in MEANS),
            middle(steps),
            *(window_mean(steps, side) for side in MEANS),
            middle(hidden),
            *(window_mean((hidden > 1).astype(np.float32), side) for side in MEANS),
            np.minimum(column, np.float32(RADIUS)),
            middle(_distance_to_step(steps)),
            support(disparity, gray),
            middle(distinct),
            window_mean(distinct, MEANS[0]),
        ]
    )


def compressed(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return features as a net takes them: ``sign(v) ln(1 + |v|)``; 0 where nothing is known."""
    size = np.abs(features)  # one array for all steps: the features of a tile do not fit the processor's cache
    np.fmax(size, 0, out=size)  # NaN becomes 0
    np.minimum(size, np.finfo(np.float32).max, out=size)
    np.log1p(size, out=size)
    result: NDArray[np.float32] = np.copysign(size, features, out=size)
    return result


def opened(feature: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what a feature was before it was compressed."""
    result: NDArray[np.float32] = np.sign(feature) * np.expm1(np.abs(feature))
    return result


def _network_log_odds(
    images: Images, disparity: NDArray[np.float32], evaluation_net: Network, precision: Precision
) -> NDArray[np.float32]:
    """Return the evaluation-Net's log-odds (y, x): it looks at every fourth pixel of every fourth row."""
    net = evaluation_net_from_parameters(evaluation_net["parameters"])
    layers = evaluation_layers(images["left"], images["moments"][0], disparity)
    return padded_log_odds(net, layers, precision, step=STEP)


def middle(block: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return an array (…, y + 100, x + 100) without its context."""
    return block[..., RADIUS:-RADIUS, RADIUS:-RADIUS]


def _distance_to_step(steps: NDArray[np.float32]) -> NDArray[np.float32]:
    is_smooth = steps <= 1  # a hole is not
    far = np.full(steps.shape, RADIUS) if is_smooth.all() else distance_transform_edt(is_smooth)
    nearest: NDArray[np.float32] = np.minimum(far, RADIUS).astype(np.float32)
    return nearest


def _largest_step(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest difference to one of the four neighbours, px; NaN where there is no disparity."""
    steps = np.zeros_like(disparity)
    across, down = np.abs(np.diff(disparity, axis=1)), np.abs(np.diff(disparity, axis=0))
    for part, difference in (
        (steps[:, 1:], across),
        (steps[:, :-1], across),
        (steps[1:], down),
        (steps[:-1], down),
    ):
        np.fmax(part, difference, out=part)
    return np.where(np.isnan(disparity), np.float32(np.nan), steps)
