"""Scenes of the rig: two views of noise, three pixels apart."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semidense.datasets import DisparityRange, SceneSource


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the rig's one scene."""
    parameters = {"seed": int(argument or 0)}
    return (SceneSource("noise", "rig", "test", (40, 48), DisparityRange(0, 5), __name__, {}, parameters),)


def read_images(_: Mapping[str, Path], parameters: Mapping[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Draw both views."""
    wide = np.random.default_rng(parameters["seed"]).integers(0, 256, (40, 51), np.uint8)
    return wide[:, :48], wide[:, 3:]
