"""A network's parameters as one flat vector: how they are cached, and how they come back."""

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semidense.stages.stage import StageError

N = TypeVar("N", bound=nn.Module)


def initialise(net: nn.Module, seed: int) -> None:
    """Draw the weights of every convolution and linear layer for ReLU (He et al. 2015); zero the biases.

    The output layer ``out`` gets a tenth of that, so that the first losses are those of a coin.
    The same seed gives the same weights, whatever has been drawn from torch's global generator.
    """
    generator = torch.Generator().manual_seed(seed)
    for module in net.modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu", generator=generator)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
    with torch.no_grad():
        net.get_parameter("out.weight").mul_(0.1)


def unset(build: Callable[[], N]) -> N:
    """Return a network whose parameters are yet to be set: none is drawn, so torch's global generator is left alone."""
    with torch.device("meta"):
        net = build()
    return net.to_empty(device="cpu")


def count(net: nn.Module) -> int:
    """Return the number of values that ``to_vector`` gives."""
    return sum(tensor.numel() for tensor in net.state_dict().values())


def to_vector(net: nn.Module) -> NDArray[np.float32]:
    """Return all parameters and buffers, flattened in the order of the state dict: float32 (parameter,)."""
    return np.concatenate([tensor.detach().reshape(-1).numpy() for tensor in net.state_dict().values()])


def from_vector(net: nn.Module, vector: NDArray[np.float32]) -> None:
    """Set all parameters and buffers of ``net`` from a vector made by ``to_vector``.

    Raises:
        StageError: if the length does not fit the network or a value is not finite.
    """
    expected = count(net)
    if vector.shape != (expected,):
        raise StageError(
            f"{type(net).__name__} has {expected} parameters, the weights hold {vector.size}: "
            "they were made with another head or other channels"
        )
    if not np.isfinite(vector).all():
        raise StageError(f"the weights for {type(net).__name__} hold a value that is not finite")
    net.load_state_dict(dict(_split(net, torch.from_numpy(np.array(vector)))))


def _split(net: nn.Module, vector: Tensor) -> Iterator[tuple[str, Tensor]]:
    start = 0
    for name, tensor in net.state_dict().items():
        yield name, vector[start : start + tensor.numel()].reshape(tensor.shape)
        start += tensor.numel()
