import numpy as np
import pytest

from semidense.stages.matching.guided.candidates import candidates


def costs(winners: np.ndarray, disparities: range) -> np.ndarray:
    """Return costs that the given disparities win; those whose right pixel is outside the image are NaN."""
    made = np.where(winners[..., None] == np.array(disparities), 0, 1).astype(np.float32)
    matched = np.arange(winners.shape[1])[:, None] - np.array(disparities)
    return np.where((matched >= 0) & (matched < winners.shape[1]), made, np.nan).astype(np.float32)


def noise(disparities: range, height: int = 10, width: int = 22) -> np.ndarray:
    """Return costs whose winners are random, with the rows of context."""
    shape = height + 8, width
    return costs(np.random.default_rng(0).choice(np.array(disparities), shape), disparities)


def test_what_wins_everywhere_is_proposed_alone() -> None:
    chosen = candidates(costs(np.full((24, 32), 3), range(8)), 0, votes=20)
    assert chosen.shape == (4, 8, 8)
    assert chosen[:, 2:, 3].all() and chosen[:, 2:].sum() == 24, "beyond the columns that the right view lacks"


def test_a_tile_that_agrees_on_nothing_proposes_what_wins_most() -> None:
    winners = np.random.default_rng(0).permuted(np.tile(np.arange(6), (20, 40)), axis=1)[:, :24]
    chosen = candidates(costs(winners, range(6)), 0, votes=144)
    most = np.array([np.bincount(winners[4 * row : 4 * row + 12, 8:20].ravel()).argmax() for row in range(3)])
    assert np.array_equal(chosen[:, 3].argmax(1), most)
    assert (chosen[:, 3].sum(1) <= 2).all(), "more than one only if they win at equally many"


@pytest.mark.parametrize(("y", "x"), [(4, 8), (15, 19), (9, 13)])
def test_the_votes_are_those_of_the_tile_and_its_eight_neighbours(y: int, x: int) -> None:
    """Tile (1, 3): rows 4 to 15 with those of context, columns 8 to 19."""
    winners = np.full((28, 40), 2)
    winners[3], winners[16], winners[:, 7], winners[:, 20] = 7, 7, 7, 7
    assert not candidates(costs(winners, range(9)), 0, votes=1)[1, 3, 7], "these lie beyond"
    winners[y, x] = 7
    assert candidates(costs(winners, range(9)), 0, votes=1)[1, 3, 7]
    assert not candidates(costs(winners, range(9)), 0, votes=2)[1, 3, 7]


def test_more_votes_propose_less_and_nothing_else() -> None:
    many, few = (candidates(noise(range(10)), 0, votes) for votes in (1, 12))
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
    chosen = candidates(noise(disparities, height, width), disparities.start, votes=50)
    matched = np.arange(width)[:, None] - np.array(disparities)
    valid = (matched >= 0) & (matched < width)  # x d
    cells = chosen.repeat(4, 0).repeat(4, 1)[:height, :width]
    assert np.array_equal((cells & valid).any(2), np.broadcast_to(valid.any(1), (height, width)))
    tiles = np.pad(valid, ((0, -width % 4), (0, 0))).reshape(-1, 4, len(disparities)).any(1)
    assert not (chosen & ~tiles).any()
