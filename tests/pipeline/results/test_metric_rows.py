from typing import Any

import pytest

from semidense.pipeline.results.metric_rows import FIGURES, averaged, mean_rows, with_means
from semidense.stages.metrics.stage import FIGURES as STORED

SAME = {"mask": "nonocc", "threshold_px": 1.0, "R": 0.9}
A = SAME | {"scene": "A", "pixels": 100, "raw_bad": 20.0, "bad": 4.0}
B = SAME | {"scene": "B", "pixels": 50, "raw_bad": 30.0}


def test_a_figure_that_a_scene_lacks_has_no_mean() -> None:
    assert mean_rows([A, B]) == [SAME | {"scene": "mean of 2", "pixels": 150, "raw_bad": 25.0}]


def test_a_mean_says_over_how_many_scenes_it_is() -> None:
    rows = [A, B, A | {"R": 0.5}]
    assert [(row["R"], row["scene"]) for row in mean_rows(rows)] == [(0.9, "mean of 2"), (0.5, "mean of 1")]


@pytest.mark.parametrize(
    ("name", "other"),
    [("experiment", "raw"), ("method", "sgm"), ("variant", "x"), ("mask", "all"), ("threshold_px", 2.0), ("R", 0.1)],
)
def test_rows_that_differ_in_more_than_the_scene_are_not_mixed(name: str, other: object) -> None:
    rows = [A, B, A | {name: other}, B | {name: other}]
    assert [row.get(name) for row in mean_rows(rows)] == [A.get(name), other]


def test_only_several_scenes_have_their_means_beside_them() -> None:
    one: list[dict[str, Any]] = [A, A | {"threshold_px": 2.0}]
    assert with_means(one) == averaged(one) == one
    assert with_means([A, B]) == [A, B, *mean_rows([A, B])]
    assert averaged([A, B]) == mean_rows([A, B])
    assert with_means([]) == averaged([]) == []


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        pytest.param("pixels", 341321, "341,321", id="a count"),
        pytest.param("bad", 18.895, "18.89", id="percent"),
        pytest.param("auc", 0.04836, "0.0484", id="an area"),
        pytest.param("rms", None, "-", id="none"),
        pytest.param("rms", float("nan"), "-", id="not a number"),
    ],
)
def test_text_of_a_figure(name: str, value: float | None, text: str) -> None:
    assert FIGURES[name].text(value) == text


def test_every_figure_that_is_stored_has_a_name_and_a_meaning() -> None:
    assert [name for name in FIGURES if name != "bad_dual_cnn"] == list(STORED)
    assert all(about.head and about.meaning for about in FIGURES.values())
