"""Weights as safetensors files: named tensors and the loss curve; what they are and how they were made in the metadata.

They hold all that the trained product holds, so what was made with the one is found again with the other.

No pickle is ever read. A file that is not exactly a network of this package is refused.
"""

import json
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import nn

from semidense.stages.evaluation.evidence.features import NAMES
from semidense.stages.evaluation.evidence.foreign.declaration import FEATURES
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import count, from_vector, to_vector, unset
from semidense.stages.matching.descriptors.net import descriptor_nets
from semidense.stages.matching.net import HEADS, MatchingNet
from semidense.stages.stage import Arrays, StageError

LOSS = "loss"
"""The tensor of a file that is no part of the network: float32 (step,)."""
LARGEST = 64 * 2**20
"""Bytes; a larger file is refused before it is parsed."""
_CHANNELS = (3, 2, 1)


def candidates(product: str) -> Iterator[nn.Module]:
    """Yield every network that a product's parameters may belong to, yet to be set, the usual ones first.

    Raises:
        StageError: if the product is no network.
    """
    if product == "evaluation_net":
        yield unset(EvaluationNet)
    elif product == "matching_net":
        yield from (unset(partial(MatchingNet, channels, head)) for head in HEADS for channels in _CHANNELS)
    elif product == "descriptor_net":
        yield from (net for channels in _CHANNELS for net in descriptor_nets(channels))
    elif product == "evidence_net":
        yield unset(partial(EvidenceNet, len(NAMES)))
    elif product == "foreign_net":
        yield unset(partial(EvidenceNet, len(FEATURES)))
    else:
        raise StageError(
            f"{product} is no network: weights are those of matching_net, descriptor_net, evaluation_net, "
            "evidence_net or foreign_net"
        )


def save_weights(product: str, arrays: Arrays, metadata: Mapping[str, Any]) -> bytes:
    """Return a trained network as a safetensors file.

    Args:
        product: ``matching_net``, ``descriptor_net``, ``evaluation_net``, ``evidence_net`` or ``foreign_net``.
        arrays: those of the product: ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
        metadata: JSON that says how they were made, such as the training configuration.

    Raises:
        StageError: if no network of the product has so many parameters, one is not finite, or the loss is no curve.
    """
    parameters = arrays["parameters"]
    for net in candidates(product):
        if count(net) == parameters.size:
            from_vector(net, parameters)
            tensors = {name: tensor.contiguous() for name, tensor in net.state_dict().items()}
            tensors[LOSS] = torch.from_numpy(_curve(product, torch.from_numpy(arrays["loss"])))
            texts = {"product": product} | {name: json.dumps(value, sort_keys=True) for name, value in metadata.items()}
            return save_tensors(tensors, metadata=texts)
    raise StageError(f"{product}: no network has {parameters.size} parameters")


def read_weights(product: str, data: bytes) -> dict[str, NDArray[np.float32]]:
    """Return what is in a safetensors file as the product holds it: see ``save_weights``.

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
    loss = tensors.pop(LOSS, torch.zeros(()))
    for net in candidates(product):
        expected = net.state_dict()
        if {name: tensor.shape for name, tensor in tensors.items()} == {n: t.shape for n, t in expected.items()}:
            return {"parameters": _vector(product, net, tensors), "loss": _curve(product, loss)}
    names = _one_line(", ".join(sorted(tensors)[:4]))
    raise StageError(f"the weights of {product} have other tensors than its network, or of other shapes: {names}…")


def read_metadata(data: bytes) -> dict[str, Any]:
    """Return what a file of ``save_weights`` says of how it was made.

    Args:
        data: the file's bytes, which ``read_weights`` accepts.
    """
    length = int.from_bytes(data[:8], "little")  # of the JSON that a safetensors file begins with
    written: dict[str, str] = json.loads(data[8 : 8 + length]).get("__metadata__", {})
    return {name: json.loads(value) for name, value in written.items() if name != "product"}


def _one_line(text: str, longest: int = 120) -> str:
    """Return text that a file may have chosen, fit for a message: printable, on one line, not endless."""
    return "".join(letter if letter.isprintable() else " " for letter in text[:longest])


def _vector(product: str, net: nn.Module, tensors: Mapping[str, torch.Tensor]) -> NDArray[np.float32]:
    if not all(map(_is_finite, tensors.values())):
        raise StageError(f"the weights of {product} must all be finite float32")
    net.load_state_dict(tensors)
    return to_vector(net)


def _curve(product: str, loss: torch.Tensor) -> NDArray[np.float32]:
    if loss.ndim != 1 or not _is_finite(loss):
        raise StageError(f"the weights of {product} need the training's `{LOSS}`, finite float32 (step,)")
    curve: NDArray[np.float32] = loss.numpy()
    return curve


def _is_finite(tensor: torch.Tensor) -> bool:
    return tensor.dtype == torch.float32 and bool(torch.isfinite(tensor).all())
