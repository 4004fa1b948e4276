from dataclasses import replace

import numpy as np
import pytest

from semidense.datasets import open_dataset
from semidense.datasets.scene import MaskKind
from semidense.pipeline.plan.images_and_truth import IMAGES, MASK_KINDS, TRUTH, read_images, read_truth
from semidense.stages.stage import StageError

SCENE = open_dataset("synthetic:train=0,test=1,height=32,width=40,disparities=8").scenes[0]


def test_images_are_as_in_the_file_with_the_moments_of_each_view() -> None:
    made = read_images(SCENE, {})
    left, right = SCENE.load_images()
    assert np.array_equal(made["left"], left)
    assert np.array_equal(made["right"], right)
    assert (made["moments"].shape, made["moments"].dtype) == ((2, 2), np.float64)
    assert 0 < made["moments"][0, 0] < 255
    assert set(made) == {output.name for output in IMAGES.outputs}


def test_a_gray_view_has_one_band(monkeypatch: pytest.MonkeyPatch) -> None:
    gray = np.arange(12, dtype=np.uint16).reshape(3, 4)
    monkeypatch.setattr(type(SCENE), "load_images", lambda _: (gray, gray))
    made = read_images(SCENE, {})
    assert (made["left"].shape, made["left"].dtype) == ((3, 4, 1), np.uint16)


def test_the_truth_is_of_both_views() -> None:
    made, truth = read_truth(SCENE, {}), SCENE.load_truth()
    assert truth is not None
    assert np.array_equal(made["disparity"], truth.disparity, equal_nan=True)
    assert np.array_equal(made["nonocc"], truth.nonocc)
    assert made["range"].tolist() == [0, 8]
    assert MASK_KINDS[int(made["mask_kind"][0])] == "exact"
    assert 0.5 < made["right_nonocc"].mean() < 1
    assert set(made) == {output.name for output in TRUTH.outputs}


def test_what_the_right_view_sees_lands_on_an_equal_disparity_in_the_left() -> None:
    made = read_truth(SCENE, {})
    rows, columns = np.nonzero(made["right_nonocc"])
    right = made["right_disparity"][rows, columns]
    left = made["disparity"][rows, np.rint(columns + right).astype(int)]
    assert np.nanmax(np.abs(left - right)) <= 1


def test_where_no_right_truth_is_published_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = SCENE.load_truth()
    assert truth is not None
    monkeypatch.setattr(type(SCENE), "load_truth", lambda _: replace(truth, right=None))
    made = read_truth(SCENE, {})
    assert np.isnan(made["right_disparity"]).all()
    assert not made["right_nonocc"].any()


def test_a_scene_without_truth_is_refused() -> None:
    with pytest.raises(StageError, match="test-0 has no ground truth"):
        read_truth(replace(SCENE, has_truth=False), {})


def test_every_kind_of_mask_has_a_number() -> None:
    assert set(MASK_KINDS) == set(MaskKind.__args__)  # type: ignore[attr-defined]
