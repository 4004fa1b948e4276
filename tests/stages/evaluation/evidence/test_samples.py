import numpy as np
import pytest

from semidense.stages.evaluation.evidence.declaration import EVIDENCE_SAMPLES, REACH, EvidenceSamplesParams
from semidense.stages.evaluation.evidence.features import of_whole_map
from semidense.stages.evaluation.evidence.samples import compute_evidence_samples
from semidense.stages.stage import StageError
from tests.stages.evaluation.evidence.test_train import evident_scenes

PARAMS = EvidenceSamplesParams(precision="float32")


def test_makes_what_it_declares_what_is_known_and_which_pixels_are_right() -> None:
    scene = evident_scenes()[0]
    scene["disparity"]["disparity"][9, 9] = np.nan
    made = compute_evidence_samples(PARAMS, scene)
    declared = {output.name: output.dtype for output in EVIDENCE_SAMPLES.outputs}
    assert declared == {name: str(array.dtype) for name, array in made.items()}
    known = of_whole_map(scene["images"], scene["disparity"], scene["evaluation_net"], "float32")
    assert made["features"].shape == (32, 20 + 2 * REACH, 24)
    assert np.array_equal(made["features"][:, REACH:-REACH], known.astype(np.float16))
    error = np.abs(scene["disparity"]["disparity"] - scene["truth"]["disparity"])
    assert np.array_equal(made["right"], np.where(np.isfinite(error), error <= 1, -1))
    assert set(np.unique(made["right"])) == {-1, 0, 1}


@pytest.mark.parametrize(("known", "right"), [(1.0, False), (0.3, True)])
def test_a_sparse_truth_is_not_held_to_the_last_half_pixel(known: float, right: bool) -> None:
    scene = evident_scenes()[0]
    is_known = np.random.default_rng(0).random((20, 24)) < known
    scene["truth"]["disparity"] = np.where(
        is_known, scene["disparity"]["disparity"] + np.float32(1.2), np.float32(np.nan)
    )
    labels = compute_evidence_samples(PARAMS, scene)["right"]
    assert set(labels[labels != -1].tolist()) == {int(right)}


def test_a_scene_without_anything_to_judge_is_refused() -> None:
    scene = evident_scenes()[0]
    scene["truth"]["disparity"][:] = np.nan
    with pytest.raises(StageError, match="no pixel with a disparity and a known truth"):
        compute_evidence_samples(PARAMS, scene)


def test_a_map_without_evidence_is_refused() -> None:
    scene = evident_scenes()[0]
    scene["disparity"] = {"disparity": scene["disparity"]["disparity"]}
    with pytest.raises(StageError, match=r"set use\.disparity=aggregated"):
        compute_evidence_samples(PARAMS, scene)
