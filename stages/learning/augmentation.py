"""Random changes of the gray channel, a view at a time: what other lighting and another camera would do.

The rank and companion channels stay as they are: a monotone change of the gray values does not move
ranks, which is the paper's reason for having them. ``strength`` 0 is the paper's "none".
"""

import numpy as np
from numpy.typing import NDArray

SPAN = 2.5
"""Standardised gray values are mapped from [-SPAN, SPAN] to [0, 1] for the gamma curve, and back."""


def relight(view: NDArray[np.float32], strength: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return ``view`` with a random gamma, gain, offset, slope and noise on its gray channel.

    Args:
        view: float32 (channel, y, x); the first channel is gray, and standardised.
        strength: 0 changes nothing; 1 is gamma 0.7-1.4, gain 0.8-1.25, offset and slope up to 0.4
            standard deviations, noise up to 0.06.
        rng: source of randomness.

    Returns:
        float32 (channel, y, x): a copy, or at strength 0 the view itself. NaN stays NaN.
    """
    if strength == 0:
        return view
    result = view.copy()
    unit = np.clip((result[0] + SPAN) / (2 * SPAN), 0.0, 1.0)
    curved = unit ** np.exp(strength * rng.uniform(-0.35, 0.35)) * (2 * SPAN) - SPAN
    slope = strength * rng.uniform(-0.4, 0.4, 2)
    rows, columns = (np.linspace(-0.5, 0.5, length, dtype=np.float32) for length in curved.shape)
    light = strength * rng.uniform(-0.4, 0.4) + slope[0] * rows[:, None] + slope[1] * columns
    noise = rng.normal(0, strength * rng.uniform(0, 0.06), curved.shape)
    result[0] = curved * np.exp(strength * rng.uniform(-0.22, 0.22)) + light + noise
    return result
