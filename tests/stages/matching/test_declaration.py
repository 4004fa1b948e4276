import pytest
from pydantic import ValidationError

from semidense.stages.matching.declaration import (
    COST_VOLUME,
    PATCH,
    RADIUS,
    CostVolumeParams,
    MatchingNetParams,
    MatchingSamplesParams,
    Mode,
)
from semidense.stages.stage import StageError


def test_a_patch_has_a_centre() -> None:
    assert PATCH == 2 * RADIUS + 1 == 11
    assert COST_VOLUME.halo(CostVolumeParams()) == RADIUS


@pytest.mark.parametrize(
    ("params", "crop", "disparities"),
    [
        pytest.param(MatchingSamplesParams(height=7, width=9, slots=5), (7, 9), 5, id="dense: as set"),
        pytest.param(MatchingSamplesParams(form="patch", height=7), (1, 1), 2, id="patch: one pixel, two disparities"),
    ],
)
def test_the_form_decides_the_size_of_a_sample(
    params: MatchingSamplesParams, crop: tuple[int, int], disparities: int
) -> None:
    assert params.crop == crop and params.disparities == disparities


def test_the_range_includes_both_ends() -> None:
    params = CostVolumeParams(d_min=-2, d_max=1)
    assert list(params.disparities) == [-2, -1, 0, 1]
    assert COST_VOLUME.sizes(params) == {"d": 4}


@pytest.mark.parametrize(
    ("mode", "width", "d_max", "chunks"),
    [
        pytest.param("fast", 741, 70, 4, id="fast: a wide tile has less context"),
        pytest.param("fast", 1000, 99, 3, id="fast, larger: what memory allows"),
        pytest.param("fast", 3000, 280, 1, id="fast, large: never less than a chunk"),
        pytest.param("exact", 741, 70, 1, id="exact: a tile is a chunk"),
        pytest.param("guided", 741, 70, 1, id="guided: where a tile begins decides what proposes to it"),
    ],
)
def test_a_tile_of_a_fast_volume_has_as_many_chunks_as_memory_allows(
    mode: Mode, width: int, d_max: int, chunks: int
) -> None:
    assert COST_VOLUME.chunks_a_tile(CostVolumeParams(mode=mode, d_min=0, d_max=d_max), width) == chunks


@pytest.mark.parametrize(
    ("given", "dumped"),
    [
        pytest.param({}, {}, id="exact, the default: as if there were no other mode"),
        pytest.param({"votes": 3}, {}, id="exact: what only a guided volume depends on is left out"),
        pytest.param({"mode": "guided"}, {"mode": "guided", "votes": 24}, id="guided"),
        pytest.param({"mode": "fast", "votes": 5}, {"mode": "fast"}, id="fast: nothing proposes"),
    ],
)
def test_only_what_a_volume_depends_on_is_in_its_key(given: dict[str, object], dumped: dict[str, object]) -> None:
    always = {"d_min": None, "d_max": None, "precision": "auto"}
    assert CostVolumeParams.model_validate(given).model_dump(mode="json") == always | dumped


@pytest.mark.parametrize("known", [{}, {"d_min": 0}, {"d_max": 9}])
def test_a_range_without_both_ends_is_refused(known: dict[str, int]) -> None:
    with pytest.raises(StageError, match="give d_min and d_max"):
        _ = CostVolumeParams(**known).disparities


@pytest.mark.parametrize(
    ("section", "field", "message"),
    [
        pytest.param(CostVolumeParams, {"d_min": 5, "d_max": 4}, "d_max 4 lies below d_min 5", id="range upside down"),
        pytest.param(CostVolumeParams, {"mode": "full"}, "'exact', 'guided' or 'fast'", id="unknown mode"),
        pytest.param(MatchingSamplesParams, {"slots": 2}, "greater than or equal to 3", id="too few disparities"),
        pytest.param(MatchingSamplesParams, {"height": 0}, "greater than or equal to 1", id="empty crop"),
        pytest.param(MatchingSamplesParams, {"form": "sparse"}, "'dense' or 'patch'", id="unknown form"),
        pytest.param(MatchingNetParams, {"head": "wide"}, "'compact' or 'paper'", id="unknown head"),
        pytest.param(MatchingNetParams, {"batch": 7}, "multiple of 2", id="shards of different sizes"),
        pytest.param(MatchingNetParams, {"precision": "float16"}, "'float32' or 'bfloat16'", id="unknown precision"),
        pytest.param(MatchingNetParams, {"layers": 6}, "Extra inputs are not permitted", id="unknown field"),
    ],
)
def test_refuses(section: type, field: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        section.model_validate(field)
