import numpy as np
import pytest

from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.agreement import agreement
from semidense.stages.evaluation.confidence import confidence
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import EVIDENCE_CONFIDENCE, EvidenceConfidenceParams
from semidense.stages.evaluation.evidence.features import STEP, of_whole_map
from semidense.stages.evaluation.evidence.foreign.declaration import FOREIGN_CONFIDENCE
from semidense.stages.evaluation.evidence.net import INPUTS, EvidenceNet
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.stage import Stage, StageError
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
    net = EvidenceNet()
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
    assert known.stacked.shape == (INPUTS, 11, 8) and np.isfinite(known.stacked).all()
    opened = np.sign(known.stacked) * np.expm1(np.abs(known.stacked))
    evidence, disparity = given["disparity"]["evidence"].astype(np.float32), given["disparity"]["disparity"]
    assert np.allclose(opened[: len(FEATURES)], np.nan_to_num(evidence), rtol=1e-4)
    assert (opened[: len(FEATURES), 0, 0] == 0).all(), "nothing is known where there is no evidence"
    assert np.allclose(opened[len(FEATURES)], known.log_odds, atol=1e-4)
    layers = evaluation_layers(given["images"]["left"], given["images"]["moments"][0], disparity)
    everywhere = confidence(random_net(), layers)
    assert np.allclose(known.log_odds[::4, ::4], np.log(everywhere / (1 - everywhere))[::4, ::4], atol=1e-3)
    for place, window in ((1, 25), (2, 9)):
        assert np.allclose(opened[len(FEATURES) + place], agreement(disparity, window), atol=1e-4)
    agrees = np.pad(np.nan_to_num(evidence[FEATURES.index("agrees")]), 4, mode="edge")
    shares = np.lib.stride_tricks.sliding_window_view(agrees, (9, 9)).mean(axis=(2, 3))
    assert np.allclose(opened[-1], shares, atol=1e-4)


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
    known = of_whole_map(given["images"], given["disparity"], given["evaluation_net"], "float32")
    odds = weigh(given["evidence_net"]["parameters"], known.stacked)
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
