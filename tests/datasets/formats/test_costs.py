from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.costs import costs_shape, read_costs


def test_a_volume_is_read(tmp_path: Path) -> None:
    costs = np.array([[[0.5, np.nan], [2.0, -1.0]]])
    np.save(tmp_path / "v.npy", costs)
    assert costs_shape(tmp_path / "v.npy") == (1, 2, 2)
    found = read_costs(tmp_path / "v.npy")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found, costs.astype(np.float16))


@pytest.mark.parametrize(
    ("array", "message"),
    [
        pytest.param(np.zeros((2, 3)), "dims y, x, d", id="a map"),
        pytest.param(np.zeros((2, 3, 4), int), "floating point", id="whole numbers"),
        pytest.param(np.zeros((0, 3, 4)), "dims y, x, d", id="empty"),
        pytest.param(np.full((1, 1, 1), np.inf), "infinite", id="infinite"),
        pytest.param(np.full((1, 1, 1), 1e6), "beyond 65504", id="too large for its type"),
        pytest.param(np.array([{}]), "not a NumPy file", id="a pickle"),
    ],
)
def test_what_is_no_volume_is_refused_in_one_line(array: np.ndarray, message: str, tmp_path: Path) -> None:
    np.save(tmp_path / "v.npy", array, allow_pickle=True)
    with pytest.raises(DatasetError, match=message) as caught:
        read_costs(tmp_path / "v.npy")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_no_array_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.npy").write_text("no array")
    (tmp_path / "empty.npy").write_bytes(b"")
    np.save(tmp_path / "whole.npy", np.zeros((2, 3, 4)))
    (tmp_path / "cut.npy").write_bytes((tmp_path / "whole.npy").read_bytes()[:200])
    np.savez(tmp_path / "several.npz", costs=np.zeros((2, 3, 4)))
    for name in ("none.npy", "text.npy", "empty.npy", "cut.npy", "several.npz"):
        with pytest.raises(DatasetError, match=name):
            costs_shape(tmp_path / name)
