import numpy as np
import pytest

from semidense.stages.evaluation.evidence.declaration import EVIDENCE_SAMPLES, EvidenceSamplesParams
from semidense.stages.evaluation.evidence.features import of_whole_map
from semidense.stages.evaluation.evidence.samples import draw_evidence_samples
from semidense.stages.stage import StageError
from tests.stages.evaluation.evidence.test_train import evident_scenes

PARAMS = EvidenceSamplesParams(pixels=100, precision="float32")


def test_makes_what_it_declares_and_one_seed_makes_it_again() -> None:
    one, again = (draw_evidence_samples(PARAMS, evident_scenes()[0]) for _ in range(2))
    assert list(one) == [output.name for output in EVIDENCE_SAMPLES.outputs]
    assert all(np.array_equal(one[name], again[name]) and one[name].dtype == np.float32 for name in one)
    other = draw_evidence_samples(PARAMS.model_copy(update={"seed": 1}), evident_scenes()[0])
    assert not np.array_equal(one["error"], other["error"])


def test_all_pixels_of_known_truth_are_drawn_once_where_there_are_few() -> None:
    scene = evident_scenes()[0]
    made = draw_evidence_samples(PARAMS.model_copy(update={"pixels": 10**6}), scene)
    error = np.abs(scene["disparity"]["disparity"] - scene["truth"]["disparity"])
    known = np.isfinite(error)
    stacked = of_whole_map(scene["images"], scene["disparity"], scene["evaluation_net"], "float32")
    assert np.array_equal(np.sort(made["error"]), np.sort(error[known]))
    rows = {tuple(row) for row in np.column_stack([made["features"], made["error"]]).tolist()}
    assert rows == {tuple(row) for row in np.column_stack([stacked[:, known].T, error[known]]).tolist()}


def test_a_map_without_evidence_is_refused() -> None:
    scene = evident_scenes()[0]
    scene["disparity"] = {"disparity": scene["disparity"]["disparity"]}
    with pytest.raises(StageError, match=r"set use\.disparity=aggregated"):
        draw_evidence_samples(PARAMS, scene)
