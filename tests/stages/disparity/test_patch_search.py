import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.disparity.patch_search import BESIDE, SIDE, patches_of, search

REACH = 2


def correlations(left: NDArray[np.float64], right: NDArray[np.float64], y: int) -> NDArray[np.float64]:
    """Of each patch of a row with all patches of the rows near it, one after the other: (x, row, column)."""

    def patch(view: NDArray[np.float64], row: int, x: int) -> NDArray[np.float64]:
        cut = view[row : row + SIDE, x : x + SIDE]
        centred = cut - cut.mean()
        length = np.linalg.norm(centred)
        return centred / length if length else centred

    rows, columns = range(max(0, y - REACH), min(len(right) - SIDE, y + REACH) + 1), range(left.shape[1] - SIDE + 1)
    other = np.array([[patch(right, row, x) for x in columns] for row in rows])
    return np.array([np.tensordot(other, patch(left, y, x), 2) for x in columns])


@pytest.mark.parametrize("y", [0, 3, 6])
def test_the_search_is_that_of_single_patches(y: int) -> None:
    rng = np.random.default_rng(y)
    left = rng.integers(0, 1000, (SIDE + 6, SIDE + 9)).astype(np.float64)
    right = np.roll(left, (1, -2), (0, 1)) + rng.integers(0, 300, left.shape)
    right[:, : SIDE + 1] = 7  # patches of one value correlate with nothing
    direct = correlations(left, right, y)
    found = search(patches_of(left), patches_of(right), y, REACH)
    x, columns = np.arange(len(direct)), np.arange(direct.shape[2])
    row, column = np.divmod(direct.reshape(len(direct), -1).argmax(axis=1), direct.shape[2])
    assert found.row.tolist() == (row + max(0, y - REACH)).tolist() and found.column.tolist() == column.tolist()
    assert np.allclose(found.score, direct[x, row, column], atol=1e-12)
    assert found.back.tolist() == direct[:, row, column].argmax(axis=0).tolist()
    along = direct.max(axis=1)
    along[np.abs(columns - column[:, np.newaxis]) <= BESIDE] = -1
    assert np.allclose(found.rival, along.max(axis=1), atol=1e-12)


def test_of_equal_places_the_first_is_found() -> None:
    stripes = np.tile(np.float64([0, 9, 3, 7]), (SIDE + 2, 8))
    found = search(patches_of(stripes), patches_of(stripes), 1, REACH)
    assert set(found.row) == {0} and found.column.tolist() == [x % 4 for x in range(len(found.column))]
    assert np.allclose(found.score, 1) and np.allclose(found.rival[4:], 1)
