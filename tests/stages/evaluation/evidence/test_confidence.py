from pathlib import Path

import numpy as np
import pytest

import semidense.stages.weights
from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.agreement import agreement
from semidense.stages.evaluation.confidence import confidence, sigmoid
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import (
    EVIDENCE_CONFIDENCE,
    OF_MAP,
    OF_NEIGHBOURS,
    REACH,
    EvidenceConfidenceParams,
)
from semidense.stages.evaluation.evidence.features import NAMES, of_whole_map
from semidense.stages.evaluation.evidence.foreign.declaration import FOREIGN_CONFIDENCE
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.evidence.of_map import STEP, opened
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.stage import Stage, StageError
from semidense.stages.weights import read_weights
from tests.stages.evaluation.reference import random_net, scene
from tests.stages.tiling import tiled, whole

DIMS = {
    "images": {"left": ("y", "x", "band"), "moments": ("view", "moment")},
    "disparity": {"disparity": ("y", "x"), "evidence": ("feature", "y", "x")},
    "evaluation_net": {"parameters": ("parameter",)},
    "evidence_net": {"parameters": ("parameter",)},
    "distinctiveness": {"left": ("y", "x"), "right": ("y", "x")},
    "cost_margin": {"margin": ("y", "x")},
}
PARAMS = EvidenceConfidenceParams(precision="float32")


def evidence_net() -> np.ndarray:
    net = EvidenceNet(len(NAMES))
    initialise(net, 1)
    return to_vector(net)


def products(height: int = 11, width: int = 8) -> dict[str, dict[str, np.ndarray]]:
    given, rng = scene(height=height, width=width), np.random.default_rng(3)
    evidence = rng.uniform(0, 20, (len(FEATURES), height, width)).astype(np.float16)
    evidence[FEATURES.index("agrees")] = rng.random((height, width)) < 0.5
    evidence[:, 0, 0] = np.nan
    return {
        "images": {name: given["images"][name] for name in ("left", "moments")},
        "disparity": {**given["disparity"], "evidence": evidence},
        "evaluation_net": {"parameters": to_vector(random_net())},
        "evidence_net": {"parameters": evidence_net()},
        "distinctiveness": {view: np.full((height, width), 9, np.float32) for view in ("left", "right")},
        "cost_margin": {"margin": np.full((height, width), 5, np.float32)},
    }


def test_the_features_are_what_they_are_called() -> None:
    given = products()
    known = of_whole_map(given["images"], given["disparity"], given["evaluation_net"], "float32")
    assert known.shape == (len(NAMES), 11, 8) and np.isfinite(known).all()
    told = dict(zip((*OF_MAP, *FEATURES, *OF_NEIGHBOURS), opened(known), strict=True))
    evidence, disparity = given["disparity"]["evidence"].astype(np.float32), given["disparity"]["disparity"]
    for name, values in zip(FEATURES, np.nan_to_num(evidence), strict=True):
        assert np.allclose(told[name], values, rtol=1e-4), name
        assert told[name][0, 0] == 0, "nothing is known where there is no evidence"
    for window in (9, 25):
        assert np.allclose(told[f"agreement {window}"], agreement(disparity, window), atol=1e-4)
    beyond = np.pad(evidence, ((0, 0), (4, 4), (4, 4)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(beyond, (9, 9), axis=(1, 2))
    margin, difference, agrees = (
        windows[FEATURES.index(name)] for name in ("aggregated_margin", "left_right", "agrees")
    )
    assert np.allclose(told["aggregated_margin 9"], np.nanmean(margin, axis=(2, 3)), rtol=1e-4)
    differs = np.where(np.isnan(difference), np.nan, difference > 1)
    assert np.allclose(told["left_right 9"], np.nanmean(differs, axis=(2, 3)), atol=1e-4)
    assert np.allclose(told["agrees 9"], np.nanmean(agrees, axis=(2, 3)), atol=1e-4)


def with_a_hole(said: dict[str, float]) -> dict[str, dict[str, np.ndarray]]:
    """Return a scene of one plane whose costs say the same of each pixel, and whose left columns have no disparity."""
    given = products(height=40, width=90)
    disparity = np.full((40, 90), 9, np.float32)
    evidence = np.zeros((len(FEATURES), 40, 90), np.float16)
    for name, value in said.items():
        evidence[FEATURES.index(name)] = value
    disparity[:, :30] = evidence[:, :, :30] = np.nan
    return {**given, "disparity": {"disparity": disparity, "evidence": evidence}}


def test_what_costs_say_around_a_pixel_is_told_of_those_with_a_disparity() -> None:
    given = with_a_hole({"aggregated_margin": 3, "left_right": 3, "agrees": 1})
    known = of_whole_map(given["images"], given["disparity"], given["evaluation_net"], "float32")
    around = opened(known[-len(OF_NEIGHBOURS) :])[:, :, 30:]
    assert np.allclose(around, np.float32([3, 3, 1, 1, 1, 1])[:, None, None], atol=1e-4)


def scored(folder: str, said: dict[str, float]) -> np.ndarray:
    """Return what a set of weights answers, of pixels away from the hole and beside it."""
    weights, given = Path(semidense.stages.weights.__file__).parent / folder, with_a_hole(said)
    nets = {
        product: read_weights(product, (weights / f"{product}.safetensors").read_bytes())
        for product in ("evaluation_net", "evidence_net")
    }
    known = of_whole_map(given["images"], given["disparity"], nets["evaluation_net"], "float32", REACH)
    made = sigmoid(weigh(nets["evidence_net"]["parameters"], known))
    return np.concatenate([made[:, 30:45], made[:, 60:80]], axis=1)


@pytest.mark.parametrize("folder", ["", "general/"])
@pytest.mark.parametrize("difference", [2, 4, 8])
def test_what_is_dropped_is_dropped_beside_a_hole_too(folder: str, difference: float) -> None:
    """The pixels of a range far from 0 begin beside a band without disparities, which no training scene has.

    The costs are those of a wrong surface with little texture: nothing stands out. The single costs and the right view
    say something else.
    """
    margins = {"aggregated_margin": 0.5, "single_margin": 0.1, "single_excess": 3, "left_right": difference}
    said = {**margins, "aggregated_flatness": 0.1, "single_flatness": 0.3, "single_minima": 6}
    assert scored(folder, said).max() < 0.9


@pytest.mark.parametrize("folder", ["", "general/"])
@pytest.mark.parametrize("margin", [0.5, 2, 8])
def test_what_costs_cannot_say_together_is_dropped(folder: str, margin: float) -> None:
    """Nothing stands out or the right view differs, and yet no other disparity is nearly as good."""
    said = {**dict.fromkeys(("aggregated_margin", "single_margin", "left_right"), margin), "agrees": 1}
    assert scored(folder, said).max() < 0.9


SOUND = {
    "aggregated_margin": 38,
    "single_margin": 6,
    "single_cost": -8,
    "agrees": 1,
    "aggregated_flatness": 0.01,
    "single_flatness": 0.01,
    "single_minima": 1,
}
"""What costs say of a pixel that is right."""
CONTRADICTIONS = {
    "the right view differs": {"left_right": 8},
    "nothing stands out": {"aggregated_margin": 1, "single_margin": 0.1},
    "the single costs differ": {"agrees": 0, "single_excess": 8},
    "many minima": {"single_minima": 8, "single_flatness": 0.3, "aggregated_flatness": 0.1},
}


@pytest.mark.parametrize("folder", ["", "general/"])
def test_one_kind_of_bad_evidence_is_enough_whatever_the_others_say(folder: str) -> None:
    away = slice(15, None)  # columns that the hole is not beside
    assert scored(folder, SOUND)[:, away].min() > 0.9
    found = {name: scored(folder, {**SOUND, **said})[:, away].max() for name, said in CONTRADICTIONS.items()}
    assert max(found.values()) < 0.9, found


def test_the_evaluation_net_answers_at_every_fourth_pixel() -> None:
    given = products()
    known = of_whole_map(given["images"], given["disparity"], given["evaluation_net"], "float32")
    layers = evaluation_layers(given["images"]["left"], given["images"]["moments"][0], given["disparity"]["disparity"])
    everywhere = confidence(random_net(), layers)
    expected = np.log(everywhere / (1 - everywhere))[::4, ::4]
    assert np.allclose(opened(known[OF_MAP.index("network")])[::4, ::4], expected, atol=1e-3)


@pytest.mark.parametrize("rows", [pytest.param(4, id="parts"), pytest.param(8, id="nearly all")])
def test_tiles_equal_the_whole(rows: int) -> None:
    one, other = (
        make(EVIDENCE_CONFIDENCE, PARAMS, products(), DIMS, *more) for make, more in ((tiled, [rows]), (whole, []))
    )
    for name in ("confidence", "network"):
        assert one[name].dtype == other[name].dtype == np.float32
        assert np.abs(one[name] - other[name]).max() <= 1e-5
        assert np.ptp(other[name]) > 0.01
    assert np.array_equal(one["agreement"], other["agreement"])


@pytest.mark.parametrize("stage", [EVIDENCE_CONFIDENCE, FOREIGN_CONFIDENCE], ids=lambda stage: stage.product)
def test_a_tile_begins_where_the_evaluation_net_answers(stage: Stage) -> None:
    assert stage.tile_rows and stage.tile_rows % STEP == 0


def test_the_stage_weighs_the_features_of_the_whole_map() -> None:
    given = products()
    known = of_whole_map(given["images"], given["disparity"], given["evaluation_net"], "float32", REACH)
    odds = weigh(given["evidence_net"]["parameters"], known)
    made = whole(EVIDENCE_CONFIDENCE, PARAMS, given, DIMS)
    assert list(made) == [output.name for output in EVIDENCE_CONFIDENCE.outputs]
    assert np.abs(made["confidence"] - 1 / (1 + np.exp(-odds))).max() <= 1e-5


def test_no_confidence_where_views_or_costs_say_nothing() -> None:
    given = products()
    given["distinctiveness"]["left"][2, 3] = 0.5
    given["cost_margin"]["margin"][8, 1] = 0
    vetoed = whole(EVIDENCE_CONFIDENCE, PARAMS, given, DIMS)["confidence"]
    assert np.argwhere(vetoed == 0).tolist() == [[2, 3], [8, 1]]
    pure = PARAMS.model_copy(update={"veto": False})
    assert whole(EVIDENCE_CONFIDENCE, pure, given, DIMS)["confidence"].min() > 0
    assert pure.inputs == ("images", "disparity", "evaluation_net", "evidence_net")


def test_a_map_by_single_costs_is_refused() -> None:
    given = products()
    del given["disparity"]["evidence"]
    with pytest.raises(StageError, match=r"set use\.disparity=aggregated"):
        whole(EVIDENCE_CONFIDENCE, PARAMS, given, DIMS)
