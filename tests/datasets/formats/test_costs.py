from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.costs import CostsHeader, costs_header, read_costs

COSTS = np.array([[[0.5, np.nan], [2.0, -1.0], [3.0, 0.25]]])
"""(1, 3, 2): y, x, d."""


def test_a_volume_is_read(tmp_path: Path) -> None:
    np.save(tmp_path / "v.npy", COSTS)
    assert costs_header(tmp_path / "v.npy") == CostsHeader((1, 3, 2), None)
    found = read_costs(tmp_path / "v.npy")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found, COSTS.astype(np.float16))


def _zarr_array(path: Path, volume: xr.DataArray) -> None:
    made = zarr.create_array(path, shape=volume.shape, dtype="f4", dimension_names=volume.dims)
    made[:] = volume.to_numpy()


WRITERS: dict[str, Callable[[Path, xr.DataArray], object]] = {
    "group.zarr": lambda path, volume: volume.to_dataset(name="cost").to_zarr(path, consolidated=False),
    "file.nc": lambda path, volume: volume.to_netcdf(path),
    "array.zarr": _zarr_array,
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("order", [("y", "x", "d"), ("d", "y", "x")], ids=["y, x, d", "d, y, x"])
def test_named_dims_are_brought_into_order(name: str, order: tuple[str, ...], tmp_path: Path) -> None:
    volume = xr.DataArray(COSTS.astype(np.float32), dims=("y", "x", "d"), coords={"d": [-1, 0]})
    WRITERS[name](tmp_path / name, volume.transpose(*order))
    first = None if name == "array.zarr" else -1  # a Zarr array has no coordinates
    assert costs_header(tmp_path / name) == CostsHeader((1, 3, 2), first)
    np.testing.assert_array_equal(read_costs(tmp_path / name), COSTS.astype(np.float16))


def test_a_zarr_array_without_names_is_read_like_a_numpy_file(tmp_path: Path) -> None:
    made = zarr.create_array(tmp_path / "a.zarr", shape=COSTS.shape, dtype="f8", zarr_format=2)
    made[:] = COSTS
    np.testing.assert_array_equal(read_costs(tmp_path / "a.zarr"), COSTS.astype(np.float16))


def _dataset(dims: tuple[str, ...] = ("y", "x", "d"), **coordinates: list[float]) -> xr.Dataset:
    return xr.Dataset({"cost": (dims, np.zeros((2, 3, 4), np.float32))}, coords=coordinates)


@pytest.mark.parametrize(
    ("dataset", "message"),
    [
        pytest.param(_dataset(("row", "col", "disp")), "dims row, col, disp; rename", id="other names"),
        pytest.param(_dataset(d=[3, 2, 1, 0]), "coordinate d does not rise", id="falling disparities"),
        pytest.param(_dataset(y=[1, 0]), "coordinate y does not rise", id="upside down"),
        pytest.param(_dataset(d=[0, 2, 4, 6]), "one px apart", id="every second disparity"),
        pytest.param(_dataset(d=[0.5, 1.5, 2.5, 3.5]), "whole disparities", id="half disparities"),
        pytest.param(_dataset(d=[0, 1, 2, np.nan]), "does not rise", id="an unknown disparity"),
        pytest.param(_dataset().assign(other=lambda of: of.cost), "2 variables", id="two volumes"),
        pytest.param(xr.Dataset({"map": (("y", "x"), np.zeros((2, 3)))}), "0 variables", id="a map"),
        pytest.param(_dataset().astype(int), "floating point", id="whole numbers"),
    ],
)
def test_dims_and_coordinates_that_do_not_fit_are_told(dataset: xr.Dataset, message: str, tmp_path: Path) -> None:
    dataset.to_netcdf(tmp_path / "v.nc")
    with pytest.raises(DatasetError, match=message) as caught:
        costs_header(tmp_path / "v.nc")
    assert "\n" not in str(caught.value) and str(tmp_path / "v.nc") in str(caught.value)


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
    (tmp_path / "text.nc").write_text("no file of numbers")
    (tmp_path / "four.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    (tmp_path / "empty.zarr").mkdir()
    names = "none.npy text.npy empty.npy cut.npy several.npz none.nc text.nc four.nc none.zarr empty.zarr"
    for name in names.split():
        with pytest.raises(DatasetError, match=name) as caught:
            costs_header(tmp_path / name)
        assert "\n" not in str(caught.value)
