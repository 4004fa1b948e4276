"""What ``score`` refuses before anything is made; ``tests/system/test_score.py`` scores maps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.datasets import DatasetError
from semidense.pipeline.pairs.score import score
from semidense.pipeline.plan.errors import UsageError

VIEW = np.zeros((4, 20), np.uint8)
MAP = np.full((4, 20), 3, np.float32)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        pytest.param((VIEW, None, VIEW), {}, "the disparity map is None: was its file read", id="no map"),
        pytest.param(("left.png", None, "right.png"), {}, "map is None", id="no map beside files"),
        pytest.param((VIEW, "map.pfm"), {}, "map is the path 'map.pfm', no array", id="a file and an array"),
        pytest.param((VIEW, MAP), {"none": "5"}, "none = '5': give a number", id="none as a text"),
        pytest.param((VIEW, MAP), {"unit": "inch"}, "unit 'inch'", id="a unit without a calibration"),
        pytest.param((VIEW, MAP), {"R": 0.5, "settings": {"semidense.density": 0.5}}, "give one of them", id="R"),
    ],
)
def test_what_cannot_be_scored_is_refused_in_one_line(
    tmp_path: Path, arguments: tuple[Any, ...], options: dict[str, Any], message: str
) -> None:
    with pytest.raises((UsageError, DatasetError), match=message):
        score(*arguments, **options, cache=tmp_path / "cache")
    assert not (tmp_path / "cache").exists()
