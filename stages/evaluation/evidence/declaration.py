"""Declare the net that weighs the evidence, and the confidence that it gives. Light: it does not load torch."""

from collections.abc import Sequence
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.declaration import RADIUS, Judged
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Always, DisparityMap, Images, Network, Output, Params, Stage, Truth

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


DILATIONS = (1, 2, 4)
"""Distance of the taps of each of the kernels of the net that weighs the evidence, in pixels of half the size."""
REACH = 2 * (sum(DILATIONS) + 1)
"""Rows that this net looks away from a pixel's own, px; even, since it looks at half the size."""


class EvidenceNetParams(Schedule):
    """How the net that weighs the evidence learns."""

    steps: int = Field(2000, ge=1, description="optimiser steps")
    optimiser: Literal["muon", "adam"] = Field("adam", description="what makes a step of a large kernel's gradient")
    batch: int = Field(8, ge=SHARDS, multiple_of=SHARDS, description="crops a step; a multiple of the shards")
    height: int = Field(96, ge=2, multiple_of=2, description="rows of a crop that are judged, px")
    width: int = Field(96, ge=2, description="columns of a crop, px")
    contradicted: float = Field(
        0.1,
        ge=0,
        le=1,
        description="share of the crops in which a region gets, for each kind of evidence, that of other pixels, "
        "where it is bad",
    )
    seed: int = Field(0, ge=0, description="seed of the weights and of what is drawn")


class EvidenceSamplesParams(Params):
    """What counts as right in a training scene."""

    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as right, px")
    laser_error: float = Field(
        0.25, ge=0, description="what is allowed beside it where the truth is sparse: a laser measured it, px"
    )
    precision: Precision = Field("auto", description="arithmetic of the evaluation-Net: float32 or bfloat16")


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
    """A training scene, and the evaluation-Net that scores them."""

    images: Images
    disparity: DisparityMap
    truth: Truth
    evaluation_net: Network


class EvidenceSamples(TypedDict):
    """The product ``evidence_samples``: what is known of each pixel of a scene, and whether its disparity is right.

    ``features`` has ``REACH`` more rows than ``right`` above and below.
    """

    features: NDArray[np.floating]
    right: NDArray[np.int8]


class OfEvidenceSamples(TypedDict):
    """What the net that weighs the evidence learns from: the pixels of every training scene."""

    evidence_samples: Sequence[EvidenceSamples]


class WithEvidence(Judged):
    """What a confidence is made from, and what weighs it."""

    evidence_net: Network


EVIDENCE_SAMPLES = Stage(
    product="evidence_samples",
    inputs=("images", "disparity", "truth", "evaluation_net"),
    outputs=(
        Output("features", ("feature", "seen", "column"), "float16", "1", "what is known: sign(v) ln(1 + |v|)"),
        Output("right", ("row", "column"), "int8", "1", "1 right, 0 wrong, -1 unknown"),
    ),
    compute="semidense.stages.evaluation.evidence.samples:compute_evidence_samples",
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
    halo=Always(RADIUS + REACH),
    border="edge",
)
"""``use.confidence=evidence_confidence`` puts it in the place of ``confidence``."""
