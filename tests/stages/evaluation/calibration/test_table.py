import numpy as np
import pytest

from semidense.stages.evaluation.calibration.declaration import BINS, LARGEST
from semidense.stages.evaluation.calibration.table import Table, choices, log_odds, outcome, probability, tally

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


def test_a_wanted_error_by_hand() -> None:
    """Of bins that are right with 0.5, 0.8 and 1 the expected error says how far down to go, scene by scene."""
    mapped = np.full(BINS + 1, 50.0)
    mapped[: HALF + 1] = np.log(0.8 / 0.2)
    mapped[:11] = 0.0
    easy, hard = {5: (1, 1), 20: (2, 0), HALF + 1: (6, 0)}, {5: (0, 8), 20: (1, 1)}
    found = outcome(table(easy, hard), mapped, 0.21, np.ones(2))
    # Easy: 1.4 of 10 are expected to be wrong, so all are kept; of the hard one, 0.4 of its two surer pixels.
    assert (found.error, found.kept, found.scenes) == (pytest.approx((0.1 + 0.5) / 2), pytest.approx((1 + 0.2) / 2), 2)
    strict = outcome(table(easy, hard), mapped, 0.1, np.ones(2))
    assert (strict.error, strict.kept) == (0, pytest.approx(0.8 / 2)), "the hard scene keeps nothing"


def test_a_vetoed_pixel_is_not_kept_and_counts_as_one_of_the_scene() -> None:
    found = outcome(table({0: (250, 40), HALF: (700, 10)}), np.full(BINS + 1, 4.0), 0.35, np.ones(1))
    assert (found.kept, found.error) == (pytest.approx(0.71), pytest.approx(10 / 710))


def test_without_a_sure_pixel_nothing_is_kept() -> None:
    found = outcome(table({HALF: (9, 1)}), np.zeros(BINS + 1), 0.1, np.ones(1))
    assert found.kept == 0 and np.isnan(found.error)
    assert found.words == "in 1 training scenes that the networks had not seen no pixel was sure enough for that error"


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        ([1.0, 1.0], "1 px"),
        ([1.0, 1.25], "1 px (1.25 px where a laser measured the truth)"),
        ([1.25, 1.25], "1.25 px"),
    ],
)
def test_the_words_say_what_the_wish_came_to(tolerance: list[float], words: str) -> None:
    given = table({HALF: (49, 1)}, {HALF: (49, 1)})
    assert outcome(given, np.full(BINS + 1, 4.0), 0.05, np.array(tolerance)).words == (
        "in 2 training scenes that the networks had not seen the same wish kept 100 % of the pixels, 2 % of them "
        f"wrong by more than {words}"
    )


def test_a_scene_without_truth_keeps_nothing() -> None:
    assert outcome(table({HALF: (1, 0)}, {}), np.full(BINS + 1, 4.0), 0.5, np.ones(2)).kept == 0.5
