from dataclasses import dataclass

import pytest

from semidense.cache import Recipe
from semidense.pipeline.results.settings import DEFAULTS, Settings, filter_text
from semidense.stages.catalog import STAGES
from semidense.stages.evaluation.filtering import SemidenseParams


@dataclass(frozen=True)
class Made:
    """What is asked of an entry here."""

    recipe: Recipe
    key: str = "key"
    digest: str = "digest"


@pytest.mark.parametrize(
    ("params", "text"),
    [
        pytest.param({"d_min": 0, "d_max": 9, "precision": "float32"}, DEFAULTS, id="what a run fills in by itself"),
        pytest.param(
            {"mode": "guided", "votes": 5},
            "costvolume.mode=guided costvolume.votes=5",
            id="a setting that the default's key does not have",
        ),
    ],
)
def test_the_settings_that_are_not_the_defaults_are_named(params: dict[str, object], text: str) -> None:
    entry = Made(Recipe("costvolume", {}, params, {}, {}))
    assert Settings([entry]).text(entry) == text  # type: ignore[list-item, arg-type]


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        pytest.param({}, "use.disparity=aggregated", id="its defaults, which differ from the other stage's"),
        pytest.param({"paths": 16}, "aggregated.paths=16 use.disparity=aggregated", id="a setting of its own"),
    ],
)
def test_a_stage_in_the_place_of_another_is_named_with_its_settings(changed: dict[str, int], text: str) -> None:
    params = STAGES["aggregated"].params().model_dump(mode="json") | changed
    entry = Made(Recipe("disparity", {}, params, {}, {}))
    assert Settings([entry]).text(entry) == text  # type: ignore[list-item, arg-type]


@pytest.mark.parametrize(
    ("params", "text"),
    [
        pytest.param({}, "R = 0.9", id="the paper's"),
        pytest.param({"R": 0.5, "density": 0.625}, "a density of 62.5 %", id="a density replaces R"),
        pytest.param({"max_error": 0.01}, "an expected error of 1 %", id="so does an expected error"),
        pytest.param({"R": 0.95, "calibrated": True}, "R = 0.95, calibrated", id="R as a probability"),
    ],
)
def test_what_a_map_is_filtered_by_is_told(params: dict[str, float], text: str) -> None:
    assert filter_text(SemidenseParams(**params)) == text
