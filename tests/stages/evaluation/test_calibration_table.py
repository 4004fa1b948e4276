import numpy as np
import pytest

from stages.evaluation.calibration_declaration import BINS, LARGEST
from stages.evaluation.calibration_table import EDGES, Table, choices, choose, log_odds, probability, tally
from stages.stage import StageError

N = np.nan
HALF = BINS // 2
"""The bin from log-odds 0, confidence 0.5, upwards."""


def table(*scenes: dict[int, tuple[int, int]]) -> Table:
    """A table with right and wrong pixels in a few bins of each scene."""
    counts = np.zeros((2, len(scenes), BINS), np.int64)
    for row, scene in enumerate(scenes):
        for bin, (right, wrong) in scene.items():
            counts[:, row, bin] = right, wrong
    return Table(*counts)


def test_log_odds_and_probability_undo_each_other() -> None:
    p = np.array([0, 1e-6, 0.3, 0.5, 0.999, 1])
    assert np.allclose(probability(log_odds(p)), p, atol=1e-12)
    assert log_odds(np.float32([0, 0.5, 1])).tolist() == [-np.inf, 0, np.inf]
    assert np.isnan(log_odds(np.float32([N]))).all()


@pytest.mark.parametrize(
    ("confidence", "disparity", "truth", "bin", "right"),
    [
        pytest.param(0.5, 4, 4, HALF, True, id="as sure as a coin"),
        pytest.param(0.0, 4, 4, 0, True, id="no chance: the first bin"),
        pytest.param(1.0, 4, 4, BINS - 1, True, id="certain: the last bin"),
        pytest.param(1e-7, 4, 4, 0, True, id="below the first edge"),
        pytest.param(0.5, 4, 5, HALF, True, id="off by the tolerance"),
        pytest.param(0.5, 4, 5.1, HALF, False, id="off by more"),
        pytest.param(0.9, 4, 4, HALF + int(np.log(9) / (2 * LARGEST) * BINS), True, id="ln 9 above the middle"),
        pytest.param(0.9, 4, N, None, True, id="no truth: not counted"),
        pytest.param(0.9, N, 4, None, True, id="no disparity: never kept"),
        pytest.param(N, 4, 4, None, True, id="no confidence: never kept"),
    ],
)
def test_a_pixel_is_counted_once_where_it_belongs(
    confidence: float, disparity: float, truth: float, bin: int | None, right: bool
) -> None:
    maps = (np.full((1, 1), value, np.float32) for value in (confidence, disparity, truth))
    found = dict(zip((True, False), tally(*maps, tolerance=1.0), strict=True))
    assert found[not right].sum() == 0
    assert np.flatnonzero(found[right]).tolist() == ([] if bin is None else [bin])


def test_the_counts_are_those_of_filtering_at_each_edge() -> None:
    rng = np.random.default_rng(0)
    confidence = probability(rng.normal(0, 4, (40, 50))).astype(np.float32)
    error = rng.random((40, 50)).astype(np.float32) * 2
    right, wrong = tally(confidence, error, np.zeros((40, 50), np.float32), 1.0)
    for choice in choices(Table(right[None], wrong[None]))[::37]:
        kept = confidence >= np.float32(choice.R)
        assert choice.kept == pytest.approx(kept.mean())
        assert choice.error == pytest.approx((error[kept] > 1).mean())


def test_the_smallest_threshold_that_keeps_the_error_by_hand() -> None:
    #                      R = 0: 25 % wrong         above 0.5: 1 of 5      above the next edge: none of 2
    given = table({10: (1, 1), HALF: (2, 1), HALF + 1: (3, 0)})
    assert choose(given, 0.25).R == 0
    above_the_wrong_one, above_all_wrong = probability(EDGES[[11, HALF + 1]])
    assert np.isclose(choose(given, 0.2).R, above_the_wrong_one)
    tight = choose(given, 0.1)
    assert (tight.error, tight.kept, tight.scenes) == (0, 3 / 8, 1)
    assert np.isclose(tight.R, above_all_wrong)


def test_every_scene_weighs_the_same() -> None:
    given = table({HALF: (1000, 0)}, {HALF: (1, 1)})
    assert choose(given, 0.26).error == 0.25
    with pytest.raises(StageError, match="the least over 2 training scenes that the network had not seen is 25 %"):
        choose(given, 0.2)


def test_a_threshold_counts_only_while_every_scene_keeps_something() -> None:
    given = table({HALF: (9, 1), HALF + 5: (10, 0)}, {HALF: (10, 0)})
    with pytest.raises(StageError, match=r"no R keeps the error to 1 %: the least .* is 2\.5 %, at R = 0\.000"):
        choose(given, 0.01)


def test_the_words_say_what_the_choice_rests_on() -> None:
    expected = "2 % of the pixels kept were wrong by more than 1 px in 1 training scenes that the network had not seen"
    assert choose(table({HALF: (49, 1)}), 0.05).words == expected


def test_a_scene_without_truth_tells_no_error() -> None:
    with pytest.raises(StageError, match="a scene without any pixel of known truth"):
        choose(table({HALF: (1, 0)}, {}), 0.5)
