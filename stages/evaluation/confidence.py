"""The confidence of each pixel of a raw map: the evaluation-Net at every pixel, the map's agreement, and the veto."""

from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision, autocast
from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.agreement import padded_agreement
from semidense.stages.evaluation.declaration import RADIUS, Confidence, ConfidenceParams, Judged
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.evaluation.net import EvaluationNet, evaluation_net_from_parameters
from semidense.stages.evaluation.silence.veto import vetoed
from semidense.stages.stage import StageError, require_shape


def confidence(
    net: EvaluationNet, layers: NDArray[np.float32], precision: Precision = "float32", flipped: bool = False
) -> NDArray[np.float32]:
    """Return the probability that each disparity is right, as the evaluation-Net sees it.

    Args:
        net: the evaluation-Net.
        layers: float32 (layer, y, x) from ``evaluation_layers``.
        precision: arithmetic of the convolutions.
        flipped: look at the maps upside down too, and take the mean of the two log-odds.

    Returns:
        float32 (y, x) in [0, 1]. At the border the patches see the nearest pixel beyond the image.
    """
    require_shape("layers", layers, 3)
    margin = ((0, 0), (RADIUS, RADIUS), (RADIUS, RADIUS))
    return sigmoid(padded_log_odds(net, np.pad(layers, margin, mode="edge"), precision, flipped))


@one_thread()
def padded_log_odds(
    net: EvaluationNet,
    layers: NDArray[np.float32],
    precision: Precision = "float32",
    flipped: bool = False,
    step: Literal[1, 2, 4] = 1,
) -> NDArray[np.float32]:
    """Return the log-odds of ``confidence``, of layers (layer, y + 100, x + 100) with 50 px of context all round.

    With a ``step`` the net answers at every second or fourth pixel only, from the first row and column on, and the
    pixels between are interpolated.

    Raises:
        StageError: with a step and ``flipped``: upside down the answers would be those of other rows.
    """
    if flipped and step > 1:
        raise StageError(f"a step of {step} px and flipped exclude each other")
    with torch.inference_mode(), autocast(precision):
        maps = torch.from_numpy(np.ascontiguousarray(layers)).unsqueeze(0)
        log_odds = net.dense(maps.contiguous(memory_format=torch.channels_last), step)
        if flipped:
            other = net.dense(maps.flip(2).contiguous(memory_format=torch.channels_last))
            log_odds = (log_odds + other.flip(0)) / 2
        height, width = (length - 2 * RADIUS for length in layers.shape[1:])
        result: NDArray[np.float32] = _between(log_odds, step)[:height, :width].numpy()
    return result


def _between(answers: Tensor, step: int) -> Tensor:
    """Return answers that are ``step`` px apart, and those between, linear in y and in x."""
    if step == 1:
        return answers
    size = [(length - 1) * step + 1 for length in answers.shape]
    return functional.interpolate(answers[None, None], size=size, mode="bilinear", align_corners=True)[0, 0]


def sigmoid(log_odds: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return probabilities of log-odds, float32 as they are."""
    result: NDArray[np.float32] = torch.sigmoid(torch.from_numpy(log_odds)).numpy()
    return result


def weigh_in(
    log_odds: NDArray[np.float32], agreement: NDArray[np.float32], weight: float, typical: float
) -> NDArray[np.float32]:
    """Return the confidence: the odds of the evaluation-Net times ``(agreement / typical) ** weight``.

    Args:
        log_odds: float32 (y, x) of the evaluation-Net.
        agreement: float32 (y, x) in (0, 1] of the raw map.
        weight: 0 or more; at 0 the confidence is the evaluation-Net's probability, bit for bit.
        typical: the agreement that leaves the odds as they are.

    >>> weigh_in(np.float32([0, 0]), np.float32([1, 0.5]), weight=1.0, typical=1.0).tolist()
    [0.5, 0.3333333432674408]
    """
    return sigmoid((log_odds + np.float32(weight) * np.log(agreement / np.float32(typical))).astype(np.float32))


def compute_confidence(params: ConfidenceParams, inputs: Judged) -> Confidence:
    """Return one tile of the confidence map, from a block with its halo."""
    net = evaluation_net_from_parameters(inputs["evaluation_net"]["parameters"])
    images = inputs["images"]
    disparity = inputs["disparity"]["disparity"]
    layers = evaluation_layers(images["left"], images["moments"][0], disparity)
    log_odds = padded_log_odds(net, layers, params.precision, params.flipped)
    agreeing = padded_agreement(disparity, params.window)
    weighed = weigh_in(log_odds, agreeing, params.agreement, params.typical)
    return {
        "confidence": np.where(vetoed(inputs), np.float32(0), weighed) if params.veto else weighed,
        "network": sigmoid(log_odds),
        "agreement": agreeing,
    }
