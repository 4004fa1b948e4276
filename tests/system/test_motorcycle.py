"""The bundled pair with the weights of the package: a band of its rows, and a part of its disparities."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import open_dataset
from semidense.datasets.formats.pfm import write_pfm
from semidense.pipeline import api
from semidense.pipeline.api import Task

SHIPPED = all(
    (resources.files("semidense.stages") / "weights" / f"{product}.safetensors").is_file()
    for product in ("matching_net", "evaluation_net")
)
BAND = slice(200, 264)
RANGE = (20, 27)


@pytest.fixture
def band(tmp_path: Path) -> Path:
    """A scene folder that holds a band of the pair."""
    folder = tmp_path / "Band"
    folder.mkdir()
    scene = open_dataset("motorcycle").scenes[0].load()
    assert scene.truth is not None
    for name, view in (("im0.png", scene.left), ("im1.png", scene.right)):
        Image.fromarray(view[BAND]).save(folder / name)
    write_pfm(folder / "disp0.pfm", scene.truth.disparity[BAND])
    height, width = scene.truth.disparity[BAND].shape
    cameras = [f"cam{side}=[1000 0 300; 0 1000 60; 0 0 1]" for side in (0, 1)]
    lines = [*cameras, "doffs=0", "baseline=193", f"width={width}", f"height={height}", "ndisp=70", ""]
    (folder / "calib.txt").write_text("\n".join(lines))
    return folder


@pytest.mark.skipif(not SHIPPED, reason="stages/weights holds no weights yet: make train DATA=DIR")
def test_a_band_is_matched_where_its_disparities_are_searched(band: Path, tmp_path: Path) -> None:
    settings = [f"costvolume.d_min={RANGE[0]}", f"costvolume.d_max={RANGE[1]}"]
    task = Task(f"middlebury:{band}", settings=settings, cache=tmp_path / "cache")
    result = api.run(task)
    disparity, trust, truth = (
        result.open(product)[name].values
        for product, name in (("disparity", "disparity"), ("confidence", "confidence"), ("truth", "disparity"))
    )
    seen = result.open("truth")["nonocc"].values & (truth > RANGE[0]) & (truth < RANGE[1])
    right = np.abs(disparity - truth) <= 1
    assert seen.mean() > 0.1
    assert right[seen].mean() > 0.8
    assert trust[seen & right].mean() > trust[seen & ~right].mean() + 0.2
    assert all(planned.state == "hit" for planned in api.status(task).steps)


def test_the_bundled_pair_is_the_default(tmp_path: Path) -> None:
    result = api.run(Task(cache=tmp_path / "cache"), "images")
    assert result.open("images", "Motorcycle")["left"].shape == (500, 741, 3)
