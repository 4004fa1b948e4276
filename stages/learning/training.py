"""The training loop that all networks share: shards, clipping, a schedule, exact resume.

A step's loss is the mean over a fixed number of *shards*, each computed by one thread on one core,
and the gradients are added in the shards' order. So the result does not depend on how many cores
there are, and two cores work without sharing one operation (which measures slower).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.learning.optimiser import optimisers_of
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Monitor, StageError

Loss = Callable[[int, int], Tensor]
"""``loss(step, shard)``: the scalar loss of one shard of one step, a pure function of the two numbers."""


def balanced_cross_entropy(logits: Tensor, labels: Tensor) -> Tensor:
    """Return the cross-entropy with both classes of the same weight, however many samples each has.

    Args:
        logits: (2, N), of class 0 and class 1.
        labels: int64 (N,): 0, 1, or -1 for what teaches nothing. A class without samples adds nothing.
    """
    counts = torch.stack([(labels == label).sum() for label in (0, 1)]).clamp(min=1)
    return functional.cross_entropy(logits.float().T, labels, 0.5 / counts, ignore_index=-1, reduction="sum")


def fit(net: nn.Module, loss: Loss, schedule: Schedule, monitor: Monitor) -> NDArray[np.float32]:
    """Train ``net`` in place and return the loss of each step.

    A checkpoint holds the parameters, what the optimisers remember and the curve so far; since ``loss`` is a pure
    function of step and shard, a resumed training gives bit for bit what an undisturbed one gives.

    Args:
        net: the network; its parameters are changed.
        loss: the loss of one shard of one step.
        schedule: steps, rates and clipping. Each of its parts begins with optimisers that remember nothing.
        monitor: told of progress, keeps and gives back checkpoints.

    Returns:
        float32 (step,): the mean loss of each step, before its update.

    Raises:
        StageError: if the loss or its gradient is not finite.
    """
    parameters = list(net.parameters())
    optimisers = optimisers_of(net, schedule)
    curve = _resume(net, optimisers, monitor.load())
    rates = [(part.rate(step), step == 0) for part in schedule.parts for step in range(part.steps)]
    with ThreadPoolExecutor(SHARDS, initializer=keep_one_thread) as pool:
        for step in range(len(curve), len(rates)):
            rate, begins = rates[step]
            optimisers = optimisers_of(net, schedule) if begins else optimisers
            value, gradients = _gradients(parameters, loss, step, pool)
            curve.append(value)
            # In the pool, where an operation has one thread: how many share a sum decides its last bits.
            pool.submit(_update, parameters, gradients, optimisers, schedule.clip, rate).result()
            monitor.progress(step + 1, len(rates), f"loss {np.mean(curve[-50:]):.4f}")
            if (step + 1) % schedule.checkpoint_steps == 0:
                monitor.save(_checkpoint(net, optimisers, curve))
    return np.array(curve, np.float32)


def _gradients(
    parameters: Sequence[Tensor], loss: Loss, step: int, pool: ThreadPoolExecutor
) -> tuple[float, list[Tensor]]:
    """Return the loss of a step and its gradient for each parameter, both the mean over the shards."""

    def of_shard(shard: int) -> tuple[float, tuple[Tensor, ...]]:
        value = loss(step, shard)
        # Not backward(): two threads would add into the same .grad in an order nobody fixed.
        return value.item(), torch.autograd.grad(value, parameters)

    parts = list(pool.map(of_shard, range(SHARDS)))
    value = float(np.mean([part[0] for part in parts]))
    if not np.isfinite(value):
        raise StageError(f"the loss is {value} at step {step}: lower the learning rate or look at the samples")
    return value, [cast(Tensor, sum(each)) / SHARDS for each in zip(*(part[1] for part in parts), strict=True)]


def _update(
    parameters: Sequence[Tensor],
    gradients: Sequence[Tensor],
    optimisers: Sequence[torch.optim.Optimizer],
    clip: float,
    rate: float,
) -> None:
    """Move the parameters by one step.

    Raises:
        StageError: if the gradient is not finite, which no optimiser could use.
    """
    for parameter, gradient in zip(parameters, gradients, strict=True):
        parameter.grad = gradient
    norm = float(nn.utils.clip_grad_norm_(parameters, clip))
    if not np.isfinite(norm):
        raise StageError(f"the gradient's norm is {norm}: lower the learning rate or look at the samples")
    for optimiser in optimisers:
        optimiser.param_groups[0]["lr"] = rate
        optimiser.step()


def _checkpoint(net: nn.Module, optimisers: Sequence[torch.optim.Optimizer], curve: list[float]) -> bytes:
    tensors = {f"net.{name}": tensor for name, tensor in net.state_dict().items()}
    for number, optimiser in enumerate(optimisers):
        for index, state in enumerate(optimiser.state.values()):
            tensors |= {f"{number}.{index}.{name}": tensor for name, tensor in state.items()}
    tensors["curve"] = torch.tensor(curve, dtype=torch.float64)
    return save_tensors({name: tensor.contiguous() for name, tensor in tensors.items()})


def _resume(net: nn.Module, optimisers: Sequence[torch.optim.Optimizer], checkpoint: bytes | None) -> list[float]:
    """Put ``net`` and its optimisers where the checkpoint left them; return the curve so far."""
    if checkpoint is None:
        return []
    tensors = load_tensors(checkpoint)
    net.load_state_dict({name: tensors[f"net.{name}"] for name in net.state_dict()})
    for number, optimiser in enumerate(optimisers):
        for index, parameter in enumerate(optimiser.param_groups[0]["params"]):
            place = f"{number}.{index}."
            known = {name.removeprefix(place): tensor for name, tensor in tensors.items() if name.startswith(place)}
            optimiser.state[parameter] = {name: _laid_out(tensor, parameter) for name, tensor in known.items()}
    return [float(value) for value in tensors["curve"]]


def _laid_out(tensor: Tensor, parameter: Tensor) -> Tensor:
    """Return ``tensor`` in the memory order of ``parameter``: in another one, sums may end in other last bits."""
    return torch.empty_like(parameter).copy_(tensor) if tensor.shape == parameter.shape else tensor
