from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.benchmarks.motorcycle import list_scenes
from semidense.datasets.errors import DatasetError, MissingFileError
from semidense.datasets.scene import Calibration, DisparityRange, Scene, SceneSource


@pytest.fixture(scope="module")
def source() -> SceneSource:
    (only,) = list_scenes()
    return only


@pytest.fixture(scope="module")
def scene(source: SceneSource) -> Scene:
    return source.load()


def test_is_listed_as_published(source: SceneSource) -> None:
    assert (source.name, source.dataset, source.split, source.size) == ("Motorcycle", "motorcycle", "test", (500, 741))
    assert source.calibration == Calibration(focal=994.978, baseline=193.001, doffs=31.086)
    assert source.disparities == DisparityRange(0, 69)


def test_truth_lies_in_the_range_and_brings_its_mask(scene: Scene) -> None:
    assert scene.left.shape == scene.right.shape == (500, 741, 3)
    assert scene.truth is not None
    assert 0 <= np.nanmin(scene.truth.disparity) <= np.nanmax(scene.truth.disparity) <= 69
    assert scene.truth.mask == "warped truth"
    assert scene.truth.right is None
    assert 0.8 < scene.truth.nonocc.mean() < 0.9


def test_truth_carries_right_onto_left(scene: Scene, warp_correlation: Callable[..., float]) -> None:
    assert warp_correlation(scene) > 0.98
    assert warp_correlation(scene) > max(warp_correlation(scene, scale) for scale in (-1, 0, 0.9, 1.1))


def test_takes_no_argument() -> None:
    with pytest.raises(DatasetError, match="takes no argument"):
        list_scenes("half")


@pytest.mark.parametrize(
    "content, kind",
    [
        pytest.param(None, MissingFileError, id="absent"),
        pytest.param(b"", DatasetError, id="empty"),
        pytest.param(b"PK\x03\x04 broken", DatasetError, id="broken archive"),
    ],
)
def test_a_damaged_installation_is_named(
    source: SceneSource, tmp_path: Path, content: bytes | None, kind: type[DatasetError]
) -> None:
    path = tmp_path / "truth.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(kind, match=r"truth\.npz: .*install scikit-image anew"):
        replace(source, files={**source.files, "truth": path}).load_truth()
