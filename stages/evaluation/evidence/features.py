"""What is known of each pixel of a map: what the costs say, what the evaluation-Net says, and the pixels around."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.precision import Precision
from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.agreement import padded_agreement
from semidense.stages.evaluation.confidence import padded_log_odds
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import WINDOWS
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import from_vector
from semidense.stages.stage import Images, Network, StageError

STEP: Literal[4] = 4
"""Pixels from one answer of the evaluation-Net to the next: a sixteenth of the work. On training scenes its answer at
every pixel made the order of the pixels no better. A tile begins at a multiple of it."""
_AGREES = FEATURES.index("agrees")


@dataclass(frozen=True)
class Features:
    """What is known of the pixels of a map.

    Attributes:
        log_odds: (y, x) float32, of the evaluation-Net.
        agreement: (y, x) float32 in (0, 1], in the larger window.
        stacked: (feature, y, x) float32: all, each as ``sign(v) ln(1 + |v|)``; 0 where nothing is known.
    """

    log_odds: NDArray[np.float32]
    agreement: NDArray[np.float32]
    stacked: NDArray[np.float32]


def features(images: Images, disparity: Mapping[str, Any], evaluation_net: Network, precision: Precision) -> Features:
    """Return the features of a map, of arrays with 50 px of context all round.

    Args:
        images: ``left`` (y + 100, x + 100, band) and ``moments``.
        disparity: ``disparity`` (y + 100, x + 100), px, and ``evidence`` (feature, y + 100, x + 100).
        evaluation_net: ``parameters``.
        precision: arithmetic of the evaluation-Net.

    Raises:
        StageError: if the map brings no evidence of costs.
    """
    if "evidence" not in disparity:
        raise StageError("the disparity map brings no evidence of its costs: set use.disparity=aggregated")
    evidence = np.nan_to_num(disparity["evidence"].astype(np.float32))
    log_odds = network_log_odds(images, disparity["disparity"], evaluation_net, precision)
    agreements = [padded_agreement(disparity["disparity"], window) for window in WINDOWS]
    shares = [_share(evidence[_AGREES] > 0, window) for window in WINDOWS]
    own = evidence[:, RADIUS:-RADIUS, RADIUS:-RADIUS]
    stacked = np.stack([*own, log_odds, *agreements, *shares]).astype(np.float32)
    return Features(log_odds, agreements[0], np.sign(stacked) * np.log1p(np.abs(stacked)))


def of_whole_map(
    images: Images, disparity: Mapping[str, Any], evaluation_net: Network, precision: Precision
) -> Features:
    """As ``features``, of arrays without context: beyond the image lies the nearest pixel, as in a tile."""
    around = (RADIUS, RADIUS)
    views: Images = {**images, "left": np.pad(images["left"], (around, around, (0, 0)), mode="edge")}
    margins = {"disparity": (around, around), "evidence": ((0, 0), around, around)}
    padded = {name: np.pad(array, margins[name], mode="edge") for name, array in disparity.items()}
    return features(views, padded, evaluation_net, precision)


def network_log_odds(
    images: Images, disparity: NDArray[np.float32], evaluation_net: Network, precision: Precision
) -> NDArray[np.float32]:
    """Return the evaluation-Net's log-odds (y, x) of a map, of arrays with 50 px of context all round.

    It looks at every fourth pixel of a row and a column: the rest is interpolated.
    """
    net = EvaluationNet()
    from_vector(net, evaluation_net["parameters"])
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    layers = evaluation_layers(images["left"], images["moments"][0], disparity)
    return padded_log_odds(net, layers, precision, step=STEP)


def _share(flags: NDArray[np.bool_], window: int) -> NDArray[np.float32]:
    """Return the share of each window that is true, by exact counts; the map is smaller by 50 px all round."""
    cut = RADIUS - window // 2
    counts = flags[cut : flags.shape[0] - cut, cut : flags.shape[1] - cut].astype(np.int64)
    for _ in range(2):
        total = np.cumsum(np.pad(counts, ((1, 0), (0, 0))), axis=0)
        counts = (total[window:] - total[:-window]).T
    return (counts / window**2).astype(np.float32)
