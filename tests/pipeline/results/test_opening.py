import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.opening import open_product, recorded
from semidense.pipeline.results.result import Result
from tests.handmade import Handmade, handmade

PRODUCTS = ("images", "truth", "channels", "costvolume", "disparity", "confidence")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Handmade:
    return handmade(tmp_path_factory.mktemp("cache"))


@pytest.mark.parametrize("product", PRODUCTS)
def test_every_attribute_is_kept_by_netcdf(made: Handmade, product: str, tmp_path: Path) -> None:
    opened = open_product(made.store, made.entries[product].key)
    bare = xr.Dataset(attrs=opened.attrs).assign(
        {name: ((), 0.0, array.attrs) for name, array in opened.data_vars.items()}
    )
    bare.to_netcdf(tmp_path / "bare.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "bare.nc", engine="scipy") as read:
        assert read.attrs == opened.attrs
        assert {name: read[name].attrs for name in read} == {name: opened[name].attrs for name in read}


@pytest.mark.parametrize("product", ["disparity", "confidence"])
def test_a_map_is_kept_by_netcdf(made: Handmade, product: str, tmp_path: Path) -> None:
    opened = open_product(made.store, made.entries[product].key)
    opened.to_netcdf(tmp_path / "map.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "map.nc", engine="scipy") as read:
        np.testing.assert_array_equal(read[product].values, made.arrays[product][product])
        assert recorded(read, "label") == {"product": product, "dataset": "handmade", "scene": "Hand"}


@pytest.mark.parametrize("product", ["metrics", "ranking"])
def test_figures_are_kept_by_netcdf(trained: Result, product: str, tmp_path: Path) -> None:
    opened = trained.open(product, "test-0")
    opened.to_netcdf(tmp_path / "figures.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "figures.nc", engine="scipy") as read:
        assert read["auc"].sel(mask="all", threshold=1.0) == opened["auc"].sel(mask="all", threshold=1.0)
        assert list(read) == list(opened)


def test_attributes_are_texts_and_numbers(made: Handmade) -> None:
    entry = made.entries["disparity"]
    attrs = open_product(made.store, entry.key).attrs
    assert (attrs["key"], attrs["stage"], attrs["seconds"]) == (entry.key, "disparity", entry.seconds)
    assert json.loads(attrs["params"]) == {"subpixel": False}
    assert json.loads(attrs["size"]) == entry.size
    assert recorded(xr.Dataset(), "params") == {}


def test_every_attribute_is_recorded_or_told_as_plain(made: Handmade) -> None:
    opened = open_product(made.store, made.entries["disparity"].key)
    plain = {name for name in opened.attrs if not _is_recorded(opened, name)}
    assert plain == {"key", "digest", "stage", "created", "seconds"}


def _is_recorded(opened: xr.Dataset, name: str) -> bool:
    try:
        recorded(opened, name)
    except UsageError as refused:
        assert str(refused) == f"{name} is no JSON text; read it as dataset.attrs['{name}']"
        return False
    return True
