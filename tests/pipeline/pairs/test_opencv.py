"""What OpenCV gives, in OpenCV's order of the bands."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from semidense import pipeline
from semidense.datasets import DatasetError, read_image
from semidense.pipeline.pairs import opencv


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The views that the matcher passes on, instead of a match."""
    found: list[Any] = []

    class _Found:
        disparity = np.zeros((1, 1), np.float32)

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
