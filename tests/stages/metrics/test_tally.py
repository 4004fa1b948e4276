import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.stages.evaluation.filtering import keep_confident
from semidense.stages.metrics.errors import MASKS, THRESHOLDS, Errors, raw_bad
from semidense.stages.metrics.tally import FINE, STEPS, Block, Tally

N = np.nan


def block(seed: int, height: int = 9, width: int = 11) -> Block:
    random = np.random.default_rng(seed)
    disparity = random.integers(0, 9, (height, width)).astype(np.float32)
    confidence = (random.integers(0, 101, (height, width)) / 100).astype(np.float32)  # on the thresholds themselves
    truth = disparity + random.normal(0, 2, disparity.shape).astype(np.float32)
    disparity[random.random(disparity.shape) < 0.1] = N
    confidence[random.random(disparity.shape) < 0.1] = N
    truth[random.random(disparity.shape) < 0.1] = N
    return Block(disparity, confidence, truth, random.random(disparity.shape) < 0.7)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**16), step=st.sampled_from(range(len(STEPS))), mask=st.sampled_from(MASKS))
def test_the_figures_are_those_of_the_metrics(seed: int, step: int, mask: str) -> None:
    whole = block(seed)
    chosen = whole.nonocc if mask == "nonocc" else np.ones(whole.truth.shape, bool)
    kept = Errors.of(keep_confident(whole.disparity, whole.confidence, STEPS[step]), whole.truth, chosen)
    tally = Tally.of([whole])
    for threshold in THRESHOLDS:
        (row,) = [row for row in tally.rows("s", mask, threshold) if row["R"] == STEPS[step]]
        expected = {
            "invalid": kept.invalid(),
            "bad": kept.bad(threshold),
            "avgerr": kept.avgerr(),
            "rms": kept.rms(),
        }
        assert {name: row.get(name, N) for name in expected} == pytest.approx(expected, nan_ok=True)
        assert tally.raw_bad(mask, threshold) == raw_bad(whole.disparity, whole.truth, chosen, threshold)


def test_blocks_add_up_to_the_whole() -> None:
    whole = block(3)
    halves = [Block(*(part[rows] for part in whole)) for rows in (slice(0, 4), slice(4, None))]
    one, two = Tally.of([whole]), Tally.of(halves)
    for name in Tally.__dataclass_fields__:
        np.testing.assert_allclose(getattr(one, name), getattr(two, name))


def test_a_scene_without_truth_has_no_figures() -> None:
    unknown = block(1)._replace(truth=np.full((9, 11), N, np.float32))
    assert Tally.of([unknown]).rows("s") == []
    assert np.isnan(Tally.of([unknown]).raw_bad())


def test_where_nothing_is_kept_there_is_no_error() -> None:
    unsure = block(1)._replace(confidence=np.full((9, 11), 0.3, np.float32))
    row = Tally.of([unsure]).rows("s")[-1]
    assert row["invalid"] == 100
    assert not {"bad", "avgerr", "rms"} & set(row)


def test_a_curve_has_points_where_most_pixels_are() -> None:
    """Half of the pixels have a confidence above 0.99: hundredths alone would join them by one line."""
    assert set(STEPS) <= set(FINE)
    sure = (1 - np.logspace(-6, -2, 1000)).astype(np.float32).reshape(20, 50)
    whole = Block(np.zeros((20, 50)), sure, np.zeros((20, 50)), sure > 0)
    invalid = [row["invalid"] for row in Tally.of([whole]).rows("s")]
    assert np.diff(invalid).max() < 5
