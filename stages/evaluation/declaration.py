"""What the evaluation-Net's three products are made from, and what can be set. Light: it does not load torch."""

from collections.abc import Sequence
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.silence.declaration import Vetoing
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.stage import Always, DisparityMap, Images, Network, Output, Params, Stage, Truth
from semidense.stages.transforms.window import require_window

PATCH = 101
"""Side of the square patch that one answer of the evaluation-Net stands for, in pixels."""
RADIUS = PATCH // 2
STRIDE = 16
"""Pixels between the answers of the pooled network."""


class EvaluationSamplesParams(Params):
    """What the evaluation-Net learns from."""

    form: Literal["strided", "patch"] = Field(
        "strided", description="strided: grids of pixels; patch: the paper's single pixels"
    )
    samples: int = Field(16000, ge=1, description="number of grids, the same from every map (strided)")
    rows: int = Field(12, ge=1, le=64, description="rows of a grid, 16 px apart (strided)")
    columns: int = Field(16, ge=1, le=64, description="columns of a grid, 16 px apart (strided)")
    mirror: bool = Field(
        True, description="also learn from the right views' maps, mirrored, where their truth is known"
    )
    tolerance: float = Field(1.0, gt=0, description="T_e: largest error of a disparity that counts as correct, px")
    seed: int = Field(0, ge=0, description="seed of the random draw")


class EvaluationNetParams(Schedule):
    """The evaluation-Net and how it is trained."""

    steps: int = Field(1600, ge=1, description="optimiser steps")
    peak_rate: float = Field(0.002, gt=0, description="highest learning rate")
    batch: int = Field(
        8, ge=SHARDS, multiple_of=SHARDS, description="samples in one step; a multiple of the number of shards"
    )
    flip: bool = Field(True, description="turn half of the samples upside down at random")
    relight: float = Field(
        1.0, ge=0, le=3, description="strength of the random change of light; 0: no change, as in the paper"
    )
    prior: bool = Field(
        True, description="use the share of correct disparities in the samples as the prior; false: use 0.5"
    )
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )
    seed: int = Field(0, ge=0, description="seed of the weights and the augmentation")


class ConfidenceParams(Params):
    """How the evaluation-Net runs, how much the map's agreement weighs beside it, and what vetoes both."""

    agreement: float = Field(
        4.0,
        ge=0,
        le=100,
        description="weight of the agreement with neighbours, as a power; 0: the network alone, as in the paper",
    )
    typical: float = Field(
        0.82,
        gt=0,
        le=1,
        description="agreement that leaves the confidence as it is: the mean of correct disparities in training",
    )
    window: int = Field(25, ge=3, le=PATCH, description="side of the window in which neighbours are compared, px, odd")
    flipped: bool = Field(
        False, description="also score the image upside down, and take the mean; takes twice the time"
    )
    veto: bool = Field(
        True,
        description="confidence 0 where the costs have no clear winner, or a view is blank or repeats itself along "
        "its rows; false: no veto, as in the paper",
    )
    precision: Precision = Field(
        "auto", description="number format: float32, bfloat16, or auto: the one that is faster on this CPU"
    )

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_window(window)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        return ("images", "disparity", "evaluation_net", *(("distinctiveness", "cost_margin") if self.veto else ()))


class EvaluationSamples(TypedDict):
    """The product ``evaluation_samples``: (sample, row, column) labels and where each grid lies."""

    labels: NDArray[np.int8]
    y: NDArray[np.int32]
    x: NDArray[np.int32]
    scene: NDArray[np.int32]
    mirrored: NDArray[np.bool_]


class LabelledMaps(TypedDict):
    """The maps of both views of every training scene, and their truth."""

    disparity: Sequence[DisparityMap]
    right_disparity: Sequence[DisparityMap]
    truth: Sequence[Truth]


class ScoredScenes(TypedDict):
    """What the evaluation-Net learns from: samples, and what it sees of every training scene."""

    evaluation_samples: EvaluationSamples
    images: Sequence[Images]
    disparity: Sequence[DisparityMap]
    right_disparity: Sequence[DisparityMap]


EVALUATION_SAMPLES = Stage(
    product="evaluation_samples",
    inputs=("disparity", "right_disparity", "truth"),
    outputs=(
        Output("scene", ("sample",), "int32", "1", "training scene, in the order of the split"),
        Output("mirrored", ("sample",), "bool", "1", "of the right view, with both views flipped and exchanged"),
        Output("y", ("sample",), "int32", "px", "row of the grid's first pixel"),
        Output("x", ("sample",), "int32", "px", "column of the grid's first pixel"),
        Output("labels", ("sample", "row", "column"), "int8", "1", "1 right, 0 wrong, -1 unknown"),
    ),
    compute="semidense.stages.evaluation.samples:draw_samples",
    params=EvaluationSamplesParams,
    scope="split",
)

EVALUATION_NET = Stage(
    product="evaluation_net",
    inputs=("evaluation_samples", "images", "disparity", "right_disparity"),
    outputs=(
        Output("parameters", ("parameter",), "float32", "1", "weights of the evaluation-Net"),
        Output("loss", ("step",), "float32", "1", "class-balanced cross-entropy of each training step"),
    ),
    compute="semidense.stages.evaluation.train:train_evaluation_net",
    params=EvaluationNetParams,
    scope="split",
    monitored=True,
    learnt=True,
)


class Judged(Vetoing):
    """What a confidence is made from."""

    images: Images
    evaluation_net: Network


class Confidence(TypedDict):
    """The product ``confidence``: (y, x) each; ``network`` and ``agreement`` are what it is made of."""

    confidence: NDArray[np.float32]
    network: NDArray[np.float32]
    agreement: NDArray[np.float32]


CONFIDENCE = Stage(
    product="confidence",
    inputs=("images", "disparity", "evaluation_net", "distinctiveness", "cost_margin"),
    outputs=(
        Output(
            "confidence", ("y", "x"), "float32", "1", "how sure it is that the disparity is right, in [0, 1]; 0: veto"
        ),
        Output("network", ("y", "x"), "float32", "1", "probability by the evaluation-Net alone, in [0, 1]"),
        Output("agreement", ("y", "x"), "float32", "1", "share of the window with the same disparity, in (0, 1]"),
    ),
    compute="semidense.stages.evaluation.confidence:compute_confidence",
    params=ConfidenceParams,
    tile_rows=256,
    halo=Always(RADIUS),
    border="edge",
    one_view=True,
)
