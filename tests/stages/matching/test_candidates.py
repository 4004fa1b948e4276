import numpy as np
import pytest

from stages.matching.candidates import candidates, context
from stages.transforms.census import census_transform

WINDOW = 5


def padded(left: np.ndarray, right: np.ndarray, window: int = WINDOW) -> np.ndarray:
    """Return views of one channel with the context that their proposals need."""
    margin = (context(window),) * 2
    return np.pad(np.stack([left, right])[:, None].astype(np.float32), ((0, 0), (0, 0), margin, margin), mode="edge")


def texture(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(height, width))


def test_a_shifted_texture_proposes_its_shift_alone() -> None:
    wide = texture(16, 40)
    chosen = candidates(padded(wide[:, :32], wide[:, 3:35]), range(8), WINDOW, votes=20)
    assert chosen.shape == (4, 8, 8)
    assert chosen[:, 2:, 3].all() and chosen[:, 2:].sum() == 24, "beyond the columns that the right view lacks"


def test_a_tile_that_agrees_on_nothing_proposes_what_wins_most() -> None:
    chosen = candidates(padded(texture(12, 24), texture(12, 24, seed=1)), range(6), WINDOW, votes=144)
    assert (chosen[:, 2:].sum(2) == 1).all()


def test_more_votes_propose_less_and_nothing_else() -> None:
    views = padded(texture(18, 30), texture(18, 30, seed=1))
    many, few = (candidates(views, range(10), WINDOW, votes) for votes in (1, 12))
    assert few.sum() < many.sum() and not (few & ~many).any()


@pytest.mark.parametrize(
    "disparities",
    [
        pytest.param(range(0, 9), id="the left border has few disparities"),
        pytest.param(range(-9, 1), id="negative: the right border has"),
        pytest.param(range(-30, 31), id="a range wider than the image"),
        pytest.param(range(5, 6), id="a single disparity"),
        pytest.param(range(40, 44), id="beyond the image: nothing is valid"),
    ],
)
def test_each_pixel_with_a_valid_cell_gets_one_and_no_tile_an_invalid_one(disparities: range) -> None:
    height, width = 10, 22
    chosen = candidates(padded(texture(height, width), texture(height, width, seed=1)), disparities, WINDOW, votes=50)
    matched = np.arange(width)[:, None] - np.array(disparities)
    valid = (matched >= 0) & (matched < width)  # x d
    cells = chosen.repeat(4, 0).repeat(4, 1)[:height, :width]
    assert np.array_equal((cells & valid).any(2), np.broadcast_to(valid.any(1), (height, width)))
    tiles = np.pad(valid, ((0, -width % 4), (0, 0))).reshape(-1, 4, len(disparities)).any(1)
    assert not (chosen & ~tiles).any()


@pytest.mark.parametrize("window", [1, 3, 9])
def test_the_winners_are_those_of_a_direct_search(window: int) -> None:
    """One vote of a tile at the image's upper left corner: every disparity that wins near it is proposed."""
    height, width, count = 4, 20, 5
    views = padded(texture(height, width), texture(height, width, seed=1), window)
    left, right = (census_transform(view, (7, 9)) for view in views[:, 0])
    margin, radius = context(window), window // 2
    expected = set()
    for y in range(margin - 4, margin + 8):  # the repeated edge votes too
        for x in range(8):
            sums = [
                np.bitwise_count(
                    left[y - radius : y + radius + 1, margin + x - radius : margin + x + radius + 1]
                    ^ right[y - radius : y + radius + 1, margin + x - d - radius : margin + x - d + radius + 1]
                ).sum(dtype=int)
                for d in range(min(count, x + 1))
            ]
            expected.add(int(np.argmin(sums)))
    chosen = candidates(views, range(count), window, votes=1)
    allowed = {d for d in expected if d <= 3}  # the tile's last column is 3
    assert set(np.flatnonzero(chosen[0, 0])) == allowed


def test_an_exposure_that_differs_changes_nothing() -> None:
    left, right = texture(12, 30), texture(12, 30, seed=1)
    same = candidates(padded(left, right), range(6), WINDOW, votes=9)
    assert np.array_equal(same, candidates(padded(left, np.exp(right)), range(6), WINDOW, votes=9))
