"""The confidence of each pixel of a raw disparity map: the evaluation-Net at every pixel at once."""

import numpy as np
import torch
from numpy.typing import NDArray

from stages.allocator import keep_freed_memory
from stages.evaluation.declaration import RADIUS, ConfidenceParams
from stages.evaluation.layers import evaluation_layers
from stages.evaluation.net import EvaluationNet
from stages.parameters import from_vector
from stages.precision import Precision, autocast
from stages.stage import Array, Inputs, require_shape
from stages.training import one_thread


def confidence(
    net: EvaluationNet, layers: NDArray[np.float32], precision: Precision = "float32", flipped: bool = False
) -> NDArray[np.float32]:
    """Return the probability that each disparity is right.

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
    return padded_confidence(net, np.pad(layers, margin, mode="edge"), precision, flipped)


def padded_confidence(
    net: EvaluationNet, layers: NDArray[np.float32], precision: Precision = "float32", flipped: bool = False
) -> NDArray[np.float32]:
    """As ``confidence``, for layers (layer, y + 100, x + 100) that bring 50 px of context on every side."""
    keep_freed_memory()
    one_thread()
    with torch.inference_mode(), autocast(precision):
        maps = torch.from_numpy(np.ascontiguousarray(layers)).unsqueeze(0)
        log_odds = net.dense(maps.contiguous(memory_format=torch.channels_last))
        if flipped:
            other = net.dense(maps.flip(2).contiguous(memory_format=torch.channels_last))
            log_odds = (log_odds + other.flip(0)) / 2
    result: NDArray[np.float32] = torch.sigmoid(log_odds).numpy()
    return result


def compute_confidence(params: ConfidenceParams, inputs: Inputs) -> dict[str, NDArray[np.float32]]:
    """Return one tile of the confidence map, from a block with its halo."""
    net = EvaluationNet()
    from_vector(net, inputs["evaluation_net"]["parameters"])
    images: dict[str, Array] = inputs["images"]
    layers = evaluation_layers(images["left"], images["moments"][0], inputs["disparity"]["disparity"])
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return {"confidence": padded_confidence(net, layers, params.precision, params.flipped)}
