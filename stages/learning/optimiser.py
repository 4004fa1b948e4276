"""How gradients become a training step: Muon for the large kernels, Adam for all else.

Muon (Jordan et al., "Muon: an optimizer for hidden layers in neural networks", 2024) takes the momentum of a layer's
gradient as a matrix, a row for each filter, and steps along its orthogonal part: ``U V'`` of the singular value
decomposition ``U S V'``. So a layer learns in all directions alike, where the few that dominate its gradient would
decide. The orthogonal part is scaled to the size of Adam's steps (Liu et al., "Muon is scalable for LLM training",
2025), so that one learning rate serves both.

torch has a Muon as well. It finds the orthogonal part in bfloat16, which on a CPU without such units takes as long as
the gradients themselves; here it comes in float32 from the eigenvectors of a small matrix.
"""

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from semidense.stages.learning.schedule import Schedule

MOMENTUM = 0.95
SIZE = 0.2
"""Root mean square of a step of Adam, in learning rates, as it is found in practice (Liu et al. 2025)."""
LARGE = 32
"""Fewest filters, and fewest inputs of one, of a layer whose gradient is worth its directions."""
FLOOR = 1e-6
"""Share of the largest squared singular value below which a direction is rounding, not gradient."""


class Muon(torch.optim.Optimizer):
    """Steps along the orthogonal part of each parameter's momentum.

    Args:
        parameters: each with two or more dimensions; the first counts the filters.
        lr: learning rate.
    """

    def __init__(self, parameters: Iterable[Tensor], lr: float) -> None:
        super().__init__(parameters, {"lr": lr})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """Move every parameter that has a gradient."""
        for group in self.param_groups:
            for parameter in group["params"]:
                state = self.state[parameter]
                if not state:
                    state["momentum"] = torch.zeros_like(parameter)
                momentum = state["momentum"].lerp_(parameter.grad, 1 - MOMENTUM)
                ahead = parameter.grad.lerp(momentum, MOMENTUM)  # Nesterov's: where the momentum is about to be
                rows = ahead.reshape(len(ahead), -1)
                step = orthogonal(rows) * (SIZE * max(rows.shape) ** 0.5)
                parameter.sub_(group["lr"] * step.reshape(ahead.shape))


def orthogonal(matrix: Tensor) -> Tensor:
    """Return ``U V'`` of a matrix ``U S V'``: what is nearest to it of all whose singular values are 1.

    Args:
        matrix: float32 (row, column).

    Returns:
        float32 (row, column). Directions in which the matrix has next to nothing stay small; zeros stay zeros.
    """
    if matrix.shape[0] > matrix.shape[1]:
        return orthogonal(matrix.T).T
    scaled = matrix / matrix.norm().clamp(min=torch.finfo(matrix.dtype).tiny)
    squares, directions = _eigh(scaled @ scaled.T)
    floor = max(FLOOR * float(squares[-1]), torch.finfo(matrix.dtype).tiny)
    part: Tensor = (directions * squares.clamp(min=floor).rsqrt()) @ (directions.T @ scaled)
    return part


def _eigh(matrix: Tensor) -> tuple[Tensor, Tensor]:
    """Return the eigenvalues and eigenvectors of a symmetric float32 matrix.

    LAPACK's float32 can answer NaN for one of low rank, such as that of a layer with dead units; float64 then does not.
    """
    values, vectors = torch.linalg.eigh(matrix)
    if not (values.isfinite().all() and vectors.isfinite().all()):
        values, vectors = (each.to(matrix.dtype) for each in torch.linalg.eigh(matrix.double()))
    return values, vectors


def optimisers_of(net: nn.Module, schedule: Schedule) -> list[torch.optim.Optimizer]:
    """Return what trains ``net``, each parameter with one optimiser."""
    large = [each for each in net.parameters() if schedule.optimiser == "muon" and _is_large(each)]
    chosen = {id(each) for each in large}
    rest = [each for each in net.parameters() if id(each) not in chosen]
    adam: list[torch.optim.Optimizer] = [torch.optim.Adam(rest, lr=schedule.peak_rate)] if rest else []
    return [*adam, Muon(large, schedule.peak_rate)] if large else adam


def _is_large(parameter: Tensor) -> bool:
    return parameter.ndim > 1 and min(len(parameter), parameter[0].numel()) >= LARGE
