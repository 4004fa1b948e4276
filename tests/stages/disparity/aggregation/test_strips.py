import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.stages.disparity.aggregation.strips import CELLS, aggregate, strip_rows
from semidense.stages.disparity.declaration import AggregatedParams
from semidense.stages.stage import StageError
from tests.stages.disparity.aggregation.direct import sums

Pair = tuple[np.ndarray, np.ndarray]
N = np.nan
ODD = {"p1": 2.3, "oblique": 0.47, "p2": 9, "edge": 3.7}


def pair(shape: tuple[int, int, int], d_min: int = 0, seed: int = 0, spread: float = 6) -> Pair:
    """Return a volume with cells without a cost, and a view with edges."""
    rng = np.random.default_rng(seed)
    costs = (rng.normal(size=shape) * spread).astype(np.float16)
    costs[rng.random(shape) < 0.2] = N
    costs[rng.random(shape[:2]) < 0.1] = N
    right = np.arange(shape[1])[:, None] - np.arange(d_min, d_min + shape[2])
    costs[:, (right < 0) | (right >= shape[1])] = N
    return costs, rng.choice([10, 16, 17, 200], shape[:2]).astype(np.uint8)


def aggregated(costs: np.ndarray, gray: np.ndarray, d_min: int, params: AggregatedParams, rows: int) -> np.ndarray:
    return np.concatenate([strip.aggregated for strip in aggregate(costs, gray, d_min, params, rows)][::-1])


def test_by_hand() -> None:
    """One row of three pixels, d = 0, 1, 2. P1 = 2 and P2 = 4 are 8 and 16 levels; over the edge 2 and 4, a quarter."""
    costs = np.float16([[[0, N, N], [2, 0, N], [10, 10, 0]]])
    gray = np.uint8([[100, 100, 200]])
    params = AggregatedParams(p1=2, oblique=0.5, p2=4, edge=100 / 3 ** (1 / 1.5))
    own = [(0, 0, 0), (8, 0, 4), (40, 40, 0)]  # cells outside the image have the mean of the pixel's others
    # From the left. Second pixel: its own costs, since the first one's are all 0. Third, over the edge, d = 0:
    # min(8, 0 + 2, 0 + 4) = 2; d = 1: 0; d = 2: min(4, 0 + 2, 0 + 4) = 2.
    # From the right. Second pixel, over the edge, from (40, 40, 0): d = 0: min(40, 42, 4) = 4; d = 1: min(40, 2) = 2;
    # d = 2: 0. First pixel, from (12, 2, 4): d = 0: min(12, 2 + 8, 2 + 16) - 2 = 8; d = 1: 0; d = 2: 4 - 2 = 2.
    left, right = [(0, 0, 0), (8, 0, 4), (42, 40, 2)], [(8, 0, 2), (12, 2, 4), (40, 40, 0)]
    # The six other paths begin at each pixel with its own costs.
    expected = np.array(left) + np.array(right) + 6 * np.array(own)
    assert aggregated(costs, gray, 0, params, 1)[0].tolist() == expected.tolist()


def test_an_oblique_path_has_its_own_small_penalty_by_hand() -> None:
    """Two rows of two pixels: only the paths along one diagonal come from the pixel that knows d = 0."""
    costs = np.float16([[[0, 40], [0, 0]], [[0, 0], [0, 0]]])
    params = AggregatedParams(p1=20, oblique=0.05, p2=30)
    made = aggregated(costs, np.zeros((2, 2), np.uint8), -9, params, 2)
    # d = 1 costs P1 more than d = 0 where a path comes from the upper left pixel, which alone knows a disparity.
    above = (made[..., 1] - made[..., 0]).tolist()
    assert above == [[8 * 160, 80], [80, 4]]


@pytest.mark.parametrize("passes", [1, 2])
@pytest.mark.parametrize("paths", [8, 16])
@pytest.mark.parametrize(
    ("shape", "d_min"),
    [
        pytest.param((6, 7, 5), 0, id="a small image"),
        pytest.param((6, 7, 5), -2, id="a range on both sides of 0"),
        pytest.param((5, 4, 3), -9, id="no right pixel is in the image"),
        pytest.param((1, 1, 1), 0, id="one cell"),
        pytest.param((1, 9, 4), 0, id="one row"),
        pytest.param((9, 1, 4), 0, id="one column"),
        pytest.param((3, 2, 40), 0, id="more disparities than one vector holds"),
    ],
)
def test_as_the_equation_says(shape: tuple[int, int, int], d_min: int, paths: int, passes: int) -> None:
    costs, gray = pair(shape, d_min)
    for values in ({}, {"p1": 0.5, "p2": 0.5}, {"p1": 0, "p2": 0}, ODD):
        params = AggregatedParams(paths=paths, passes=passes, **values)
        assert np.array_equal(aggregated(costs, gray, d_min, params, 100), sums(costs, gray, d_min, params))


@pytest.mark.parametrize("passes", [1, 2])
def test_the_largest_costs_and_penalties_fit(passes: int) -> None:
    """Sums of 16 paths at the largest penalties stay exact."""
    rng = np.random.default_rng(0)
    costs = rng.choice(np.float16([-np.inf, -65504, 0, 65504, np.inf]), (6, 7, 4))
    gray = np.zeros((6, 7), np.uint8)
    params = AggregatedParams(paths=16, p1=900, oblique=1, p2=900, passes=passes)
    finite = np.clip(costs, -2000, 2000)  # a difference of more than 40 is 40
    assert np.array_equal(aggregated(costs, gray, -3, params, 2), sums(finite, gray, -3, params))


@given(
    st.tuples(st.integers(1, 12), st.integers(1, 9), st.integers(1, 6)),
    st.integers(-5, 5),
    st.integers(1, 12),
    st.sampled_from([8, 16]),
    st.sampled_from([1, 2]),
    st.integers(0, 9),
)
@settings(max_examples=100, deadline=None)
def test_however_it_is_cut(
    shape: tuple[int, int, int], d_min: int, rows: int, paths: int, passes: int, seed: int
) -> None:
    costs, gray = pair(shape, d_min, seed)
    params = AggregatedParams(paths=paths, p1=2, p2=7, passes=passes)
    assert np.array_equal(
        aggregated(costs, gray, d_min, params, rows), aggregated(costs, gray, d_min, params, shape[0])
    )


class Watched:
    """A volume that notes which rows are read."""

    def __init__(self, costs: np.ndarray) -> None:
        self.costs, self.shape, self.read = costs, costs.shape, list[tuple[int, int]]()

    def __getitem__(self, rows: slice) -> np.ndarray:
        self.read.append((rows.start, rows.stop))
        return self.costs[rows]


@pytest.mark.parametrize(
    ("passes", "rows", "expected"),
    [
        pytest.param(1, 10, [(0, 10)], id="one strip is read once"),
        pytest.param(1, 4, [(0, 4), (4, 8), (8, 10), (4, 8), (0, 4)], id="down, then up"),
        pytest.param(2, 10, [(0, 10)], id="one strip is read once for two passes, too"),
        pytest.param(2, 4, [(8, 10), (4, 8), (0, 4), (4, 8), (8, 10), (4, 8), (0, 4)], id="up, down, and up once more"),
    ],
)
def test_never_more_than_a_strip_is_read(passes: int, rows: int, expected: Sequence[tuple[int, int]]) -> None:
    costs, gray = pair((10, 5, 4))
    volume = Watched(costs)
    strips = [strip.rows for strip in aggregate(volume, gray, 0, AggregatedParams(passes=passes), rows)]
    assert volume.read == list(expected)
    assert [strip.start for strip in strips] == sorted({start for start, _ in expected}, reverse=True)


class Endless:
    """A volume of any height that repeats its rows."""

    def __init__(self, rows: np.ndarray, height: int) -> None:
        self.rows, self.shape = rows, (height, *rows.shape[1:])

    def __getitem__(self, rows: slice) -> np.ndarray:
        return self.rows[np.arange(rows.start, rows.stop) % len(self.rows)]


@pytest.mark.parametrize(
    ("passes", "share"),
    [
        pytest.param(1, 0.35, id="some 3 x 32 of 1024 rows in strips, and 4 for each of 32 strips between them"),
        pytest.param(2, 0.8, id="some 6 x 32 in strips, and 12 for each strip between them"),
    ],
)
def test_memory_holds_a_strip_and_the_paths_between_strips(passes: int, share: float) -> None:
    costs, _ = pair((32, 60, 40))
    volume = Endless(costs, 1024)
    gray = np.zeros(volume.shape[:2], np.uint8)
    params = AggregatedParams(passes=passes)
    next(aggregate(volume, gray, 0, params, 32))  # compiles
    tracemalloc.start()
    try:
        for _ in aggregate(volume, gray, 0, params, 32):
            pass
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < share * 1024 * 60 * 40 * costs.itemsize


@pytest.mark.parametrize("width", [1, 100, 3000, 100_000])
@pytest.mark.parametrize("depth", [1, 70, 281, 4000])
def test_a_strip_is_whole_chunks_within_its_bound(width: int, depth: int) -> None:
    rows = strip_rows(width, depth)
    assert rows % 32 == 0 and (rows == 32 or rows * width * depth <= CELLS)


def test_constant_costs_say_nothing() -> None:
    made = aggregated(np.full((4, 9, 3), 5, np.float16), np.zeros((4, 9), np.uint8), 0, AggregatedParams(), 4)
    assert not made.any()


def test_a_disparity_that_the_neighbours_share_wins_over_a_slightly_better_one() -> None:
    costs = np.full((5, 9, 4), 10, np.float16)
    costs[..., 1] = 0
    costs[2, 5] = [9, 2, 9, 0]
    made = aggregated(costs, np.zeros((5, 9), np.uint8), 0, AggregatedParams(p1=2, p2=4), 5)
    assert made[2, 5].argmin() == 1


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 3, 1)])
def test_what_does_not_fit_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(StageError, match="the cost volume has shape"):
        next(aggregate(np.zeros(shape, np.float16), np.zeros((4, 5), np.uint8), 0, AggregatedParams()))


def test_a_view_of_another_size_is_refused() -> None:
    with pytest.raises(StageError, match="y and x must agree"):
        next(aggregate(np.zeros((4, 5, 3), np.float16), np.zeros((5, 4), np.uint8), 0, AggregatedParams()))
