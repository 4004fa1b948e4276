"""What OpenCV gives, in OpenCV's order of the bands."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

from semidense import pipeline
from semidense.datasets import DatasetError, read_image
from semidense.pipeline.pairs import opencv
from semidense.pipeline.plan.errors import UsageError


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The views that the matcher passes on, instead of a match."""
    found: list[Any] = []

    class _Found:
        disparity = np.zeros((1, 1), np.float32)
        confidence = np.full((1, 1), 0.5, np.float32)

    monkeypatch.setattr(opencv, "match", lambda *views, **_: found.extend(views) or _Found())
    return found


@pytest.mark.parametrize("flag", [cv2.IMREAD_COLOR, cv2.IMREAD_UNCHANGED], ids=["BGR", "BGRA"])
def test_the_colours_are_those_of_the_file(given: list[Any], tmp_path: Path, flag: int) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (4, 5, 4)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    view = cv2.imread(str(tmp_path / "a.png"), flag)
    pipeline.StereoMatcher().compute(view, view)
    assert given[0].tolist() == given[1].tolist() == read_image(tmp_path / "a.png").tolist()


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 1)])
def test_gray_stays(given: list[Any], shape: tuple[int, ...]) -> None:
    view = np.arange(20, dtype=np.uint8).reshape(shape)
    pipeline.StereoMatcher().compute(view, view)
    assert given[0].tolist() == view.tolist()


@pytest.mark.parametrize("bands", [2, 5])
def test_other_bands_are_refused(tmp_path: Path, bands: int) -> None:
    view = np.zeros((4, 5, bands), np.uint8)
    with pytest.raises(DatasetError, match=f"4 x 5 x {bands}"):
        pipeline.StereoMatcher(numDisparities=2, cache=tmp_path).compute(view, view)


@pytest.mark.parametrize("number", [64, 64.0, np.int64(64), np.uint8(64), np.float32(64)], ids=repr)
def test_whole_numbers_of_every_kind_are_taken(number: int) -> None:
    assert pipeline.StereoMatcher(number, number).getNumDisparities() == 64


@pytest.mark.parametrize(
    ("given", "words"),
    [
        pytest.param({"numDisparities": 0}, "at least 1", id="nothing to search"),
        pytest.param({"numDisparities": 16.5}, "whole number", id="half a disparity"),
        pytest.param({"numDisparities": float("nan")}, "whole number", id="no number"),
        pytest.param({"minDisparity": "0"}, "whole number", id="a text"),
        pytest.param({"numDisparties": 64}, "did you mean numDisparities", id="a typing mistake"),
        pytest.param({"blockSize": 5}, "no counterpart", id="of another matcher"),
        pytest.param({"preset": "papr"}, "no preset", id="an unknown preset"),
        pytest.param({"R": 2}, "semidense.R = 2", id="R above 1"),
        pytest.param({"R": 0.5, "density": 0.5}, "give one of them", id="two wishes"),
        pytest.param({"disp12MaxDiff": None}, "disp12MaxDiff = None: give a number", id="no difference"),
        pytest.param({"disp12MaxDiff": "1"}, "disp12MaxDiff = '1': give a number", id="a difference as a text"),
        pytest.param({"disp12MaxDiff": float("nan")}, "disp12MaxDiff = nan", id="NaN is no difference"),
        pytest.param({"disp12MaxDiff": 1, "tolerance": 3}, "disp12MaxDiff and tolerance both", id="two tolerances"),
        pytest.param({"cache": 3}, "cache = 3: give a folder", id="no cache"),
        pytest.param({"settings": ["costvolume.mod=fast"]}, "did you mean", id="an unknown setting"),
        pytest.param({"settings": {"costvolume.mode": "quick"}}, "costvolume.mode", id="an unknown value"),
    ],
)
def test_a_mistake_is_told_at_construction(given: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        pipeline.StereoMatcher(**given)


def test_a_consistency_check_is_named_as_in_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    how: dict[str, Any] = {}

    class _Found:
        disparity = confidence = np.zeros((1, 1), np.float32)

    monkeypatch.setattr(opencv, "match", lambda *_, **named: how.update(named) or _Found())
    view = np.zeros((4, 5), np.uint8)
    pipeline.StereoMatcher(disp12MaxDiff=2).compute(view, view)
    assert (how["left_right"], how["tolerance"]) == (True, 2.0)
    how.clear()
    pipeline.StereoMatcher().compute(view, view)
    assert "left_right" not in how


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda matcher: pickle.loads(pickle.dumps(matcher))])
def test_a_matcher_is_copied_with_its_confidence(given: list[Any], again: Callable[..., Any]) -> None:
    matcher = pipeline.StereoMatcher(-4, 16, R=0.8)
    view = np.zeros((4, 5), np.uint8)
    matcher.compute(view, view)
    same = again(matcher)
    assert (same.getMinDisparity(), same.getNumDisparities()) == (-4, 16)
    assert same.confidence.tolist() == [[0.5]]
    assert same.compute(view, view).shape == (1, 1)
    assert len(given) == 4


@pytest.mark.parametrize("kind", [np.ndarray.tolist, torch.from_numpy], ids=["lists", "torch"])
def test_lists_and_tensors_have_opencvs_bands_too(given: list[Any], kind: Callable[..., Any]) -> None:
    view = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    pipeline.StereoMatcher().compute(kind(view), kind(view))
    assert given[0].tolist() == view[..., ::-1].tolist()


@pytest.mark.parametrize(("view", "message"), [(None, "was its file read"), ("left.png", "is the path")])
def test_what_is_no_array_is_told(view: Any, message: str) -> None:  # noqa: ANN401
    with pytest.raises(DatasetError, match=message):
        pipeline.StereoMatcher().compute(view, view)
