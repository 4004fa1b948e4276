"""A cost volume of another matcher goes through the whole pipeline: winner, aggregation, confidence, filtering."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from semidense.datasets import DatasetError
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.images_and_truth import COSTS
from semidense.stages.matching.declaration import COST_VOLUME

FAST = ("costvolume.mode=fast",)


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    """A pair of noise, 3 px apart, and a volume whose winner is 5 px everywhere: it is read, nobody computes it."""
    wide = np.random.default_rng(0).integers(0, 256, (40, 51), np.uint8)
    for name, view in (("left.png", wide[:, :48]), ("right.png", wide[:, 3:])):
        Image.fromarray(view).save(tmp_path / name)
    costs = np.full((40, 48, 8), 4.0, np.float32)
    costs[..., 3] = 0.0
    np.save(tmp_path / "volume.npy", costs)
    return tmp_path


def spec(pair: Path, *options: str) -> str:
    return ",".join((f"pair:{pair}/left.png", f"{pair}/right.png", f"costs={pair}/volume.npy", *options))


def test_the_volume_takes_the_place_of_the_networks(pair: Path) -> None:
    task = Task(spec(pair, "d_min=2"), settings=FAST, cache=pair / "cache")
    result = api.run(task, "semidense")
    made = {each.step.product for each in result.made.values()}
    assert made.isdisjoint({"channels", "matching_net", "descriptor_net"})
    assert result.open("costvolume")["d"].values.tolist() == list(range(2, 10))
    disparity = result.open("disparity")["disparity"].values
    assert np.unique(disparity[:, 5:]).tolist() == [5.0]
    assert np.isnan(disparity[:, :2]).all(), "there, all cells lie outside the right view"


def test_aggregation_works_on_it(pair: Path) -> None:
    task = Task(spec(pair), settings=(*FAST, "use.disparity=aggregated", "aggregated.subpixel=false"), cache=pair / "c")
    disparity = api.run(task, "disparity").open("disparity")["disparity"].values
    assert np.unique(disparity[:, 3:]).tolist() == [3.0]


def test_its_content_is_in_the_key(pair: Path) -> None:
    task = Task(spec(pair), settings=FAST, cache=pair / "cache")
    first = api.explain(task, "costvolume").key
    np.save(pair / "volume.npy", np.zeros((40, 48, 8), np.float32))
    assert api.explain(task, "costvolume").key != first
    assert api.explain(Task(spec(pair, "d_min=1"), settings=FAST, cache=pair / "cache"), "costvolume").key != first


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param(("d_min=0", "d_max=9"), "8 disparities from 0 px on, but d_max=9", id="another range"),
        pytest.param(("d_min=60",), "wide", id="outside the image"),
    ],
)
def test_a_range_that_does_not_fit_is_refused(options: tuple[str, ...], message: str, pair: Path) -> None:
    with pytest.raises(DatasetError, match=message):
        Task(spec(pair, *options)).open()


def test_a_volume_of_another_size_or_order_is_refused(pair: Path) -> None:
    for shape, told in (((40, 47, 8), "40 x 47 pixels with 8"), ((8, 40, 48), "8 x 40 pixels with 48")):
        np.save(pair / "volume.npy", np.zeros(shape, np.float32))
        with pytest.raises(DatasetError, match=f"{told} disparities, but the left view has 40 x 48"):
            Task(spec(pair)).open()


def test_a_volume_in_zarr_or_netcdf_brings_its_range(pair: Path) -> None:
    costs = xr.DataArray(np.load(pair / "volume.npy"), dims=("y", "x", "d"), coords={"d": np.arange(2, 10)})
    costs.to_dataset(name="cost").to_zarr(pair / "volume.zarr", consolidated=False)
    costs.transpose("d", "y", "x").to_netcdf(pair / "volume.nc")
    for name in ("volume.zarr", "volume.nc"):
        task = Task(spec(pair).replace("volume.npy", name), settings=FAST, cache=pair / "cache")
        disparity = api.run(task, "disparity").open("disparity")["disparity"].values
        assert np.unique(disparity[:, 5:]).tolist() == [5.0]
    with pytest.raises(DatasetError, match="8 disparities from 2 px on, but d_min=0"):
        Task(spec(pair, "d_min=0").replace("volume.npy", "volume.nc")).open()


def test_both_kinds_of_volume_are_declared_alike() -> None:
    assert [(each.name, each.dims, each.dtype) for each in COSTS.outputs] == [
        (each.name, each.dims, each.dtype) for each in COST_VOLUME.outputs
    ]


def test_a_wanted_error_needs_a_calibration_of_such_costs(pair: Path) -> None:
    """The shipped one is about maps of our own costs: it would promise what nobody has measured."""
    task = Task(spec(pair), settings=(*FAST, "semidense.max_error=0.05"), cache=pair / "cache")
    with pytest.raises(UsageError, match=r"costs come from a file.*weights\.calibration=FILE"):
        api.run(task, "semidense")
