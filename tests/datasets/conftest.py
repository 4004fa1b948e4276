import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets.formats.pfm import write_pfm
from semidense.datasets.scene import Scene

_CALIB = (
    "cam0=[100 0 4; 0 100 3; 0 0 1]\ncam1=[100 0 5; 0 100 3; 0 0 1]\ndoffs=1\nbaseline=50\nwidth=8\nheight=6\nndisp=4\n"
)


@pytest.fixture(scope="session")
def stereo_data() -> Path:
    """The folder of real benchmarks; tests that need it are skipped where it is absent."""
    project = Path(__file__).parents[2]
    folder = Path(os.environ.get("STEREO_DATA", project.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real data in {folder}; set STEREO_DATA")
    return folder


@pytest.fixture(scope="session")
def warp_correlation() -> Callable[..., float]:
    """Correlation of the left view with the right one carried onto it by a multiple of the truth, where visible."""

    def measure(scene: Scene, scale: float = 1.0) -> float:
        truth = scene.truth
        assert truth is not None
        left, right = (view.reshape(*view.shape[:2], -1).mean(axis=2) for view in (scene.left, scene.right))
        rows, columns = np.nonzero(truth.nonocc)
        landing = np.clip(columns - scale * truth.disparity[rows, columns], 0, left.shape[1] - 1)
        low = np.minimum(landing.astype(int), left.shape[1] - 2)
        part = landing - low
        carried = right[rows, low] * (1 - part) + right[rows, low + 1] * part
        return float(np.corrcoef(left[rows, columns], carried)[0, 1])

    return measure


@pytest.fixture
def save_image() -> Callable[..., Path]:
    """Write an 8-bit image, 6 x 8 unless an array is given, and make its folder."""

    def save(path: Path, array: object = None) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.full((6, 8, 3), 100, np.uint8) if array is None else np.asarray(array)
        Image.fromarray(pixels).save(path)
        return path

    return save


@pytest.fixture
def save_calibrated(save_image: Callable[..., Path]) -> Callable[..., Path]:
    """Write a scene folder of im0.png, im1.png and calib.txt, with a truth of 2 px under the names given."""

    def save(folder: Path, *truths: str) -> Path:
        for name in ("im0.png", "im1.png"):
            save_image(folder / name)
        (folder / "calib.txt").write_text(_CALIB)
        for name in truths:
            write_pfm(folder / name, np.full((6, 8), 2, np.float32))
        return folder

    return save
