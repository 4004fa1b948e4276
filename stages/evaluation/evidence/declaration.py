"""Declare the net that weighs the evidence, and the confidence that it gives. Light: it does not load torch."""

from collections.abc import Sequence
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.declaration import RADIUS, Judged
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import DisparityMap, Images, Network, Output, Params, Stage, Truth

AGREEMENTS = (5, 9, 25)
"""Sides of the windows in which neighbours that agree are counted, px."""
MEANS = (9, 25)
"""Sides of the windows over which what is known of single pixels is averaged, px."""
OF_MAP = (
    "network",
    *(f"agreement {side}" for side in AGREEMENTS),
    *(f"known {side}" for side in MEANS),
    "step",
    *(f"step {side}" for side in MEANS),
    "overlap",
    *(f"overlap {side}" for side in MEANS),
    "column",
    "edge",
    "support",
    "distinctiveness",
    "distinctiveness 9",
)
"""What the map and the left view tell, in their order on the feature axis.

- ``network``: log-odds of the evaluation-Net.
- ``agreement``: share of a window within 1 px of the pixel's own disparity; ``known``: share that has a disparity.
- ``step``: largest difference to one of the four neighbours, at most 10 px, and its means.
- ``overlap``: see ``overlap.overlap``; and the share of a window that overlaps by more than 1 px.
- ``column``: distance of the right pixel from the left border of the right view, at most 50 px.
- ``edge``: distance to the next step of more than 1 px or hole, at most 50 px.
- ``support``: share of the neighbours of like colour that agree; see ``likeness.support``.
- ``distinctiveness``: see ``likeness.distinctiveness``; and its mean. How much texture there is, as such, is not told:
  on scenes that a net had not seen it made the order of the pixels worse.
"""
OF_NEIGHBOURS = tuple(f"{name} {side}" for name in ("aggregated_margin", "left_right", "agrees") for side in MEANS)
"""What the costs say in a window: the mean margin, the share whose left-right difference is above 1 px, and the share
where the single costs agree; see ``stages.disparity.evidence``."""


class EvidenceNetParams(Schedule):
    """How the net that weighs the evidence learns."""

    steps: int = Field(4000, ge=1, description="optimiser steps")
    optimiser: Literal["muon", "adam"] = Field("adam", description="what makes a step of a large kernel's gradient")
    peak_rate: float = Field(0.01, gt=0, description="highest learning rate")
    checkpoint_steps: int = Field(500, ge=1, description="steps between two checkpoints", exclude=True)
    batch: int = Field(4096, ge=SHARDS, multiple_of=SHARDS, description="pixels a step; a multiple of the shards")
    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as right, px")
    seed: int = Field(0, ge=0, description="seed of the weights")


class EvidenceSamplesParams(Params):
    """Which pixels of a training scene the net that weighs the evidence learns from."""

    pixels: int = Field(20000, ge=1, description="pixels of each training scene, drawn at random")
    precision: Precision = Field("auto", description="arithmetic of the evaluation-Net: float32 or bfloat16")
    seed: int = Field(0, ge=0, description="seed of the draw")


class EvidenceConfidenceParams(Params):
    """How the confidence is computed from the evidence, and what vetoes it."""

    precision: Precision = Field("auto", description="arithmetic of the evaluation-Net: float32 or bfloat16")
    veto: bool = Field(
        True,
        description="confidence 0 where the costs have no clear winner, or a view is blank or repeats itself along "
        "its rows",
    )

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        vetoing = ("distinctiveness", "cost_margin") if self.veto else ()
        return ("images", "disparity", "evaluation_net", "evidence_net", *vetoing)


class EvidentScene(TypedDict):
    """A training scene whose pixels are drawn, and the evaluation-Net that scores them."""

    images: Images
    disparity: DisparityMap
    truth: Truth
    evaluation_net: Network


class EvidenceSamples(TypedDict):
    """The product ``evidence_samples``: (pixel, feature) what is known of each, (pixel,) error of its disparity, px."""

    features: NDArray[np.float32]
    error: NDArray[np.float32]


class OfEvidenceSamples(TypedDict):
    """What the net that weighs the evidence learns from: the drawn pixels of every training scene."""

    evidence_samples: Sequence[EvidenceSamples]


class WithEvidence(Judged):
    """What a confidence is made from, and what weighs it."""

    evidence_net: Network


EVIDENCE_SAMPLES = Stage(
    product="evidence_samples",
    inputs=("images", "disparity", "truth", "evaluation_net"),
    outputs=(
        Output("features", ("pixel", "feature"), "float32", "1", "what is known of each pixel: sign(v) ln(1 + |v|)"),
        Output("error", ("pixel",), "float32", "px", "distance of the disparity from the truth"),
    ),
    compute="semidense.stages.evaluation.evidence.samples:draw_evidence_samples",
    params=EvidenceSamplesParams,
)
"""``disparity`` brings the array ``evidence`` (feature, y, x): ``use.disparity=aggregated``."""

EVIDENCE_NET = Stage(
    product="evidence_net",
    inputs=("evidence_samples",),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights of the net, and the scale of its inputs"),
        Output("loss", ("step",), "float32", "1", "cross-entropy of each training step"),
    ),
    compute="semidense.stages.evaluation.evidence.train:train_evidence_net",
    params=EvidenceNetParams,
    scope="split",
    monitored=True,
    learnt=True,
)

EVIDENCE_CONFIDENCE = Stage(
    product="evidence_confidence",
    inputs=("images", "disparity", "evaluation_net", "evidence_net", "distinctiveness", "cost_margin"),
    outputs=(
        Output(
            "confidence", ("y", "x"), "float32", "1", "how sure it is that the disparity is right, in [0, 1]; 0: veto"
        ),
        Output("network", ("y", "x"), "float32", "1", "probability by the evaluation-Net alone, in [0, 1]"),
        Output("agreement", ("y", "x"), "float32", "1", "share of the window with the same disparity, in (0, 1]"),
    ),
    compute="semidense.stages.evaluation.evidence.confidence:compute_evidence_confidence",
    params=EvidenceConfidenceParams,
    tile_rows=256,
    halo=lambda _: RADIUS,
    border="edge",
)
"""``use.confidence=evidence_confidence`` puts it in the place of ``confidence``."""
