"""A small scene with a map of another matcher, and networks with nothing at zero."""

import numpy as np

from semidense.stages.evaluation.evidence.foreign.declaration import FEATURES
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.learning.parameters import initialise, to_vector
from tests.stages.evaluation.reference import random_net, scene
from tests.stages.matching.descriptors.test_volume import random_descriptor_net

DIMS = {
    "images": {"left": ("y", "x", "band"), "moments": ("view", "moment")},
    "disparity": {"disparity": ("y", "x")},
    "evaluation_net": {"parameters": ("parameter",)},
    "foreign_net": {"parameters": ("parameter",)},
    "channels": {"channels": ("view", "channel", "y", "x")},
    "descriptor_net": {"parameters": ("parameter",)},
}


def foreign_net() -> np.ndarray:
    net = EvidenceNet(len(FEATURES))
    initialise(net, 1)
    return to_vector(net)


def products(height: int = 11, width: int = 14) -> dict[str, dict[str, np.ndarray]]:
    given = scene(height=height, width=width)
    channels = np.random.default_rng(5).normal(size=(2, 3, height, width)).astype(np.float32)
    return {
        "images": {name: given["images"][name] for name in ("left", "moments")},
        "disparity": given["disparity"],
        "evaluation_net": {"parameters": to_vector(random_net())},
        "foreign_net": {"parameters": foreign_net()},
        "channels": {"channels": channels},
        "descriptor_net": {"parameters": to_vector(random_descriptor_net())},
    }
