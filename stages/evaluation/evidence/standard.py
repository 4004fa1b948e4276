"""Networks that keep the mean and the deviation of their inputs with their weights."""

import torch
from torch import Tensor, nn

CONSTANT, UNSEEN = 1e-3, 1e9
"""A number whose deviation in training is below the first tells nothing: its scale is the second, so that it never
counts. With its own scale it would outweigh all others in a map where it does vary."""


class Standardised(nn.Module):
    """A network whose inputs lie on the second axis.

    Args:
        inputs: numbers that are known of a pixel.
    """

    centre: Tensor
    scale: Tensor

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))

    def keep(self, mean: Tensor, deviation: Tensor) -> None:
        """Keep the mean and the deviation of each input in training."""
        self.centre.copy_(mean)
        self.scale.copy_(deviation.where(deviation > CONSTANT, torch.tensor(UNSEEN)))

    def standardised(self, features: Tensor) -> Tensor:
        """Return features (n, feature, …) less their mean, in their deviations."""
        shape = (-1, *(1,) * (features.ndim - 2))
        return (features - self.centre.view(shape)) / self.scale.view(shape)
