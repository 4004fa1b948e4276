import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.stages.evaluation.calibration.declaration import BINS, MAPS
from semidense.stages.evaluation.calibration.maps import FITS, brier_score, calibrate, cross_validate
from semidense.stages.evaluation.calibration.table import EDGES, Table, probability

CENTRES = (EDGES[1:] + EDGES[:-1]) / 2


def sampled(true: np.ndarray, scenes: int = 4, pixels: int = 400) -> Table:
    """A table whose share of right pixels is a known function of the confidence."""
    right = np.tile(np.round(pixels * true), (scenes, 1)).astype(np.int64)
    return Table(right, pixels - right)


OVERSURE = sampled(probability(0.5 * CENTRES - 0.4))
"""Half as sure as it says, and less sure in all."""


@pytest.mark.parametrize("name", MAPS)
@given(counts=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=BINS, max_size=BINS))
@settings(max_examples=15, deadline=None)
def test_every_map_is_finite_and_rises(name: str, counts: list[tuple[int, int]]) -> None:
    mapped = FITS[name](Table(*np.array(counts, np.int64).T[:, None]))
    assert mapped.shape == EDGES.shape
    assert np.isfinite(mapped).all()
    assert (np.diff(mapped) > 0).all()


@pytest.mark.parametrize("name", MAPS)
def test_a_table_without_pixels_or_with_right_ones_alone_gives_a_map(name: str) -> None:
    for right in (np.zeros((1, BINS), np.int64), np.ones((1, BINS), np.int64)):
        mapped = FITS[name](Table(right, np.zeros((1, BINS), np.int64)))
        assert np.isfinite(mapped).all() and (np.diff(mapped) > 0).all()


def test_platt_finds_a_straight_line() -> None:
    assert np.allclose(FITS["platt"](OVERSURE), 0.5 * EDGES - 0.4, atol=0.02)


def test_isotonic_follows_a_bend_that_no_line_can() -> None:
    bent = sampled(probability(np.where(CENTRES < 0, 0.2, 1.0) * CENTRES))
    mapped = FITS["isotonic"](bent)
    middle = np.abs(EDGES) < 3
    assert np.abs(probability(mapped) - probability(np.where(EDGES < 0, 0.2, 1.0) * EDGES))[middle].max() < 0.02
    assert brier_score(bent, mapped) < brier_score(bent, FITS["platt"](bent))


def test_isotonic_pools_what_does_not_rise_by_hand() -> None:
    right, wrong = np.zeros((2, 1, BINS), np.int64)
    right[0, [100, 200, 300]], wrong[0, [100, 200, 300]] = (1, 3, 9), (3, 1, 1)
    right[0, 250], wrong[0, 250] = 1, 3  # below its neighbour: the two are one pool of 4 in 8
    mapped = FITS["isotonic"](Table(right, wrong))
    at = dict(zip(EDGES.round(6).tolist(), probability(mapped).tolist(), strict=True))
    assert at[CENTRES[100].round(6) - 0.025] == pytest.approx(0.25, abs=0.02)
    assert probability(np.interp(np.array([CENTRES[225]]), EDGES, mapped))[0] == pytest.approx(0.5, abs=0.01)


def test_the_brier_score_by_hand_is_lowest_for_the_truth() -> None:
    right, wrong = np.zeros((2, 1, BINS), np.int64)
    right[0, 1], wrong[0, 1] = 3, 1
    truth = np.full(EDGES.size, np.log(3.0))
    assert brier_score(Table(right, wrong), truth) == pytest.approx(0.75 * 0.25**2 + 0.25 * 0.75**2)
    for other in (-0.1, 0.1):
        assert brier_score(Table(right, wrong), truth + other) > brier_score(Table(right, wrong), truth)


@pytest.mark.parametrize("name", ["platt", "isotonic"])
def test_what_a_veto_silenced_is_no_evidence_of_a_low_confidence(name: str) -> None:
    """A veto sets pixels to 0 where the views say nothing; most of them are right, and no map may rise for that."""
    vetoed = Table(OVERSURE.right.copy(), OVERSURE.wrong.copy())
    vetoed.right[:, 0] += 40_000
    vetoed.wrong[:, 0] += 20_000
    assert np.allclose(FITS[name](vetoed)[20:], FITS[name](OVERSURE)[20:], atol=0.05)


def test_scores_are_of_scenes_that_a_map_was_not_fitted_to() -> None:
    honest, other = sampled(probability(CENTRES), 1), sampled(probability(-0.1 * CENTRES), 1)
    both = Table(np.concatenate([honest.right, other.right]), np.concatenate([honest.wrong, other.wrong]))
    folds = np.array([0, 1])
    nothing, platt = (cross_validate(both, folds, FITS[name]) for name in ("none", "platt"))
    assert nothing == pytest.approx((brier_score(honest, EDGES) + brier_score(other, EDGES)) / 2)
    expected = brier_score(honest, FITS["platt"](other)) + brier_score(other, FITS["platt"](honest))
    assert platt == pytest.approx(expected / 2)


def test_no_map_changes_nothing_and_the_order_stays() -> None:
    confidence = np.float32([0, 1e-6, 0.2, 0.5, 0.9, 0.99999, 1, np.nan])
    assert np.allclose(calibrate(confidence, EDGES), confidence, equal_nan=True, rtol=1e-6)
    mapped = calibrate(confidence, FITS["platt"](OVERSURE))
    assert mapped.dtype == np.float32
    assert (np.diff(mapped[:-1]) >= 0).all() and np.isnan(mapped[-1])
    assert mapped[3] == pytest.approx(probability(np.array([-0.4]))[0], abs=0.01)
