"""Weights as safetensors files: named tensors, with what they are and how they were made in the metadata.

No pickle is ever read. A file that is not exactly a network of this package is refused.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import nn

from stages.evaluation.net import EvaluationNet
from stages.matching.net import HEADS, MatchingNet
from stages.parameters import count, from_vector, to_vector
from stages.stage import StageError

LARGEST = 64 * 2**20
"""Bytes; a larger file is refused before it is parsed."""
MOST_CHANNELS = 3


def candidates(product: str) -> list[nn.Module]:
    """Return every network that a product's parameters may belong to.

    Raises:
        StageError: if the product is no network.
    """
    if product == "evaluation_net":
        return [EvaluationNet()]
    if product == "matching_net":
        return [MatchingNet(channels, head) for head in HEADS for channels in range(1, MOST_CHANNELS + 1)]
    raise StageError(f"{product} is no network: weights are those of matching_net or evaluation_net")


def save_weights(product: str, parameters: NDArray[np.float32], metadata: Mapping[str, Any]) -> bytes:
    """Return a network's parameters as a safetensors file.

    Args:
        product: ``matching_net`` or ``evaluation_net``.
        parameters: float32 (parameter,), as the product holds them.
        metadata: JSON that says how they were made, such as the training configuration.

    Raises:
        StageError: if no network of the product has so many parameters, or one is not finite.
    """
    for net in candidates(product):
        if count(net) == parameters.size:
            from_vector(net, parameters)
            tensors = {name: tensor.contiguous() for name, tensor in net.state_dict().items()}
            texts = {"product": product} | {name: json.dumps(value, sort_keys=True) for name, value in metadata.items()}
            return save_tensors(tensors, metadata=texts)
    raise StageError(f"{product}: no network has {parameters.size} parameters")


def read_weights(product: str, data: bytes) -> NDArray[np.float32]:
    """Return the parameters in a safetensors file, as the product holds them: float32 (parameter,).

    Raises:
        StageError: if it is no such file, or its tensors are not those of the product's network, in
            float32 and finite.
    """
    if len(data) > LARGEST:
        raise StageError(f"the weights of {product} have {len(data)} bytes, at most {LARGEST} are read")
    try:
        tensors = load_tensors(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise StageError(f"the weights of {product} are no safetensors file: {_one_line(str(error))}") from None
    for net in candidates(product):
        expected = net.state_dict()
        if {name: tensor.shape for name, tensor in tensors.items()} == {n: t.shape for n, t in expected.items()}:
            return _vector(product, net, tensors)
    names = _one_line(", ".join(sorted(tensors)[:4]))
    raise StageError(f"the weights of {product} have other tensors than its network, or of other shapes: {names}…")


def _one_line(text: str, longest: int = 120) -> str:
    """Return text that a file may have chosen, fit for a message: printable, on one line, not endless."""
    return "".join(letter if letter.isprintable() else " " for letter in text[:longest])


def _vector(product: str, net: nn.Module, tensors: Mapping[str, torch.Tensor]) -> NDArray[np.float32]:
    if any(tensor.dtype != torch.float32 or not bool(torch.isfinite(tensor).all()) for tensor in tensors.values()):
        raise StageError(f"the weights of {product} must all be finite float32")
    net.load_state_dict(tensors)
    return to_vector(net)
