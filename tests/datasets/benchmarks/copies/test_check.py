"""A sound scene passes; a truth of the wrong scale, direction or image does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.benchmarks.copies import check
from semidense.datasets.benchmarks.copies.check import check_scene
from semidense.datasets.benchmarks.copies.consistency import SCALES, best_scale, fits
from semidense.datasets.scene import DisparityRange, Scene, SceneSource, Truth

SHIFT = 6


def scene_of(disparity: float = SHIFT, brightness: float = 1.0) -> Scene:
    """A texture whose right view is shifted by 6 px, with a constant truth; right views may be darker."""
    texture = np.random.default_rng(5).integers(20, 220, (60, 120), np.uint8)
    left, right = texture[:, :100], (texture[:, SHIFT : 100 + SHIFT] * brightness).astype(np.uint8)
    truth = np.full(left.shape, disparity, np.float32)
    return Scene("made", left, right, Truth(truth, np.ones(left.shape, bool), "exact"), DisparityRange(0, 20))


class Made(SceneSource):
    """A source of a scene that is already there."""

    scene: Scene

    def load(self) -> Scene:
        return self.scene


def source_of(scene: Scene, largest: int = 20) -> SceneSource:
    made = Made("made", "d", "test", scene.left.shape[:2], DisparityRange(0, largest), "none", {}, has_truth=True)  # type: ignore[arg-type]
    object.__setattr__(made, "scene", scene)
    return made


@pytest.mark.parametrize("brightness", [1.0, 0.5])
def test_the_right_truth_is_sound_under_another_exposure_too(brightness: float) -> None:
    found = check_scene(source_of(scene_of(brightness=brightness)))
    assert (found.problems, found.scale, found.known, found.visible) == ((), 1, 1, 1)
    assert found.fit is not None and found.fit > 0.99


@pytest.mark.parametrize("scale", [scale for scale in SCALES if scale != 1])
def test_a_wrong_scale_or_direction_is_told(scale: float) -> None:
    found = check_scene(source_of(scene_of(SHIFT / scale), largest=30))
    assert found.scale == scale
    assert any("carries the right view onto the left one better" in problem for problem in found.problems)
    assert ("mirror image" in found.problems[-1]) == (scale == -1)


def test_a_truth_outside_the_range_is_told() -> None:
    found = check_scene(source_of(scene_of(), largest=5))
    assert found.problems == ("the truth reaches from 6 to 6 px, but 0 to 5 px are searched",)


def test_a_truth_that_nothing_can_be_told_of_is_told() -> None:
    scene = scene_of()
    assert scene.truth is not None
    unseen = replace(scene.truth, nonocc=np.zeros((60, 100), bool))
    found = check_scene(source_of(replace(scene, truth=unseen)))
    assert found.problems == (
        "no pixel of the truth is seen by both views: whether it is of these images cannot be told",
    )
    unknown = Truth(np.full((60, 100), np.nan, np.float32), np.zeros((60, 100), bool), "none")
    assert check_scene(source_of(replace(scene, truth=unknown))).problems == ("the truth is unknown everywhere",)


def test_a_flat_image_correlates_with_nothing() -> None:
    scene = scene_of()
    flat = replace(scene, left=np.full_like(scene.left, 9), right=np.full_like(scene.right, 9))
    assert scene.truth is not None
    assert set(fits(flat, scene.truth).values()) == {0.0}


def test_a_scene_that_cannot_be_loaded_is_told_and_not_raised(tmp_path: Path) -> None:
    gone = SceneSource(
        "gone", "d", "test", (6, 8), DisparityRange(0, 3), "semidense.datasets.benchmarks.eth3d",
        {"left": tmp_path / "im0.png", "right": tmp_path / "im1.png"},
    )  # fmt: skip
    found = check.check_scene(gone)
    assert len(found.problems) == 1 and "im0.png" in found.problems[0]


def test_the_best_scale_passes_over_what_is_not_known() -> None:
    assert best_scale({1.0: float("nan"), 2.0: 0.1}) == 2
