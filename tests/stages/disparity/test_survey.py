import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.disparity.survey import ENOUGH, FIELDS, SURVEY, _agreed, estimate_range, survey
from semidense.stages.stage import NoParams


def textured(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """Noise that is smooth over a few pixels, so that it survives being shrunk."""
    noise = np.random.default_rng(seed).normal(size=(height, width))
    for axis in (0, 1):
        noise = sum(np.roll(noise, shift, axis) for shift in range(4))
    return np.clip(128 + 20 * noise, 0, 255).astype(np.uint8)


def moved(height: int, width: int, disparity: int, vertical: int = 0) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """A pair with ``x_right = x_left - disparity`` and ``y_right = y_left + vertical`` everywhere."""
    room = 40
    wide = textured(height + 2 * room, width + 2 * room)
    left = wide[room : room + height, room : room + width]
    right = wide[room - vertical : room - vertical + height, room + disparity : room + disparity + width]
    return left, right


@pytest.mark.parametrize(
    ("disparity", "vertical"),
    [
        pytest.param(9, 0, id="a rectified pair"),
        pytest.param(-9, 0, id="exchanged views"),
        pytest.param(0, 0, id="nothing moved"),
        pytest.param(9, 5, id="the right view lower"),
        pytest.param(9, -5, id="the right view higher"),
    ],
)
def test_a_known_move_is_found(disparity: int, vertical: int) -> None:
    found = survey(*moved(80, 120, disparity, vertical))
    by_name = dict(zip(FIELDS, found.matches.T, strict=True))
    assert len(found.matches) > ENOUGH
    assert np.mean(by_name["disparity"] == disparity) > 0.98
    assert np.mean(by_name["vertical"] == vertical) > 0.98
    assert found.range[0] <= disparity <= found.range[1]


def test_other_light_in_the_right_view_does_not_matter() -> None:
    left, right = moved(80, 120, 9)
    found = survey(left, (right * 0.6 + 40).astype(np.uint8))
    assert len(found.matches) > ENOUGH
    assert np.mean(found.matches[:, 2] == 9) > 0.98


def test_large_views_are_shrunk_and_answer_in_their_own_pixels() -> None:
    left, right = moved(60, 130, 10)
    large = [np.repeat(np.repeat(view, 8, axis=0), 8, axis=1) for view in (left, right)]
    found = survey(*large)
    assert found.step == 3
    assert abs(np.median(found.matches[:, 2]) - 80) <= found.step
    assert found.range[0] <= 80 <= found.range[1] < 130


@pytest.mark.parametrize(
    "view",
    [
        pytest.param(np.full((80, 120), 7, np.uint8), id="no texture"),
        pytest.param(np.zeros((5, 120), np.uint8), id="lower than a patch"),
        pytest.param(np.zeros((1, 1), np.uint8), id="one pixel"),
    ],
)
def test_where_nothing_can_be_seen_nothing_is_said(view: NDArray[np.uint8]) -> None:
    found = survey(view, view)
    assert found.matches.shape == (0, len(FIELDS))
    assert np.isnan(found.range).all()


def test_views_of_different_scenes_have_no_range() -> None:
    found = survey(textured(80, 120, seed=1), textured(80, 120, seed=2))
    assert len(found.matches) < ENOUGH
    assert np.isnan(found.range).all()


def matches(*groups: tuple[float, int]) -> NDArray[np.float32]:
    """So many matches of each disparity, spread over rows."""
    disparity = np.concatenate([np.full(count, value) for value, count in groups])
    rows = np.arange(disparity.size) % 20
    return np.stack([rows, rows, disparity, 0 * rows], axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        pytest.param(matches((45, 500), (60, 500)), (45 - 3 - 2, 60 + 3 + 2), id="a fifth of the span and two steps"),
        pytest.param(matches((20, 500), (60, 500)), (0, 60 + 8 + 2), id="down to 0 if that is not far"),
        pytest.param(matches((-60, 500), (-20, 500)), (-70, 0), id="negative ones as the positive"),
        pytest.param(matches((-10, 500), (10, 500)), (-12, 10 + 4 + 2), id="both signs"),
        pytest.param(matches((45, 500), (60, 500), (-150, 20)), (40, 65), id="a small group far away"),
        pytest.param(matches((45, 500), (60, 500), (90, 3)), (40, 65), id="lonely ones"),
        pytest.param(matches((40, 50)), (np.nan, np.nan), id="too few"),
    ],
)
def test_the_range_by_hand(found: NDArray[np.float32], expected: tuple[float, float]) -> None:
    assert np.array_equal(estimate_range(found, 1, 500), np.float32(expected), equal_nan=True)


def test_the_stage_makes_what_it_declares() -> None:
    left, right = moved(80, 120, 9)
    made = SURVEY.function()(NoParams(), {"images": {"left": left[..., None], "right": right[..., None]}})
    assert {name: str(array.dtype) for name, array in made.items()} == {
        each.name: each.dtype for each in SURVEY.outputs
    }
    assert made["left"].shape == left.shape
    assert made["equal"][0] < 0.5


def test_the_patches_of_a_row_do_not_go_round() -> None:
    """The last patches of the image are no neighbours of its first."""
    alone = np.array([True, False, False, False, False, False, True, True, True])
    alike, row = np.zeros(9, np.intp), np.zeros(9, np.intp)
    assert not _agreed(alone, alike, row)[0]
    assert _agreed(np.ones(9, bool), alike, row).all()
