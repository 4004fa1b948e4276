"""The Middlebury 2014 Motorcycle pair that ships with scikit-image: real data without a download.

500 x 741, a quarter of the full size by averaging, default exposure. It is not the array of MiddEval3's quarter-size
Motorcycle, which has 497 rows. No occlusion mask and no right truth come with it; the mask is the warped truth's.

Source: Scharstein et al., "High-resolution stereo datasets with subpixel-accurate ground truth", GCPR 2014;
`skimage.data.stereo_motorcycle`.
"""

import zipfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import DisparityMap, ImageArray
from semidense.datasets.errors import DatasetError, MissingFileError
from semidense.datasets.formats.images import image_size
from semidense.datasets.readers import assemble_truth, read_pair
from semidense.datasets.scene import Calibration, DisparityRange, Parameter, SceneSource, Truth

CALIBRATION = Calibration(focal=994.978, baseline=193.001, doffs=31.086)
"""As published in `skimage.data.stereo_motorcycle`, for the size at hand."""

DISPARITIES = DisparityRange(0, 69)
"""The 70 disparities that Middlebury publishes for the quarter size; the truth lies between 7.1 and 60."""

_FILES = {"left": "motorcycle_left.png", "right": "motorcycle_right.png", "truth": "motorcycle_disp.npz"}


def list_scenes(argument: str = "") -> tuple[SceneSource, ...]:
    """List the one scene.

    Raises:
        DatasetError: If an argument is given.
        MissingFileError: If scikit-image or its data files are not installed.
    """
    if argument:
        raise DatasetError(f"motorcycle takes no argument, not {argument!r}; write motorcycle")
    folder = _data_folder()
    files = {role: folder / name for role, name in _FILES.items()}
    source = SceneSource(
        name="Motorcycle",
        dataset="motorcycle",
        split="test",
        size=image_size(files["left"]),
        disparities=DISPARITIES,
        reader=__name__,
        files=files,
        has_truth=True,
        calibration=CALIBRATION,
    )
    return (source,)


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the left truth and make its mask; raises `DatasetError` if it cannot be read."""
    return assemble_truth(_read_disparity(files["truth"]), right=None, mask_file=None)


def _data_folder() -> Path:
    # find_spec finds the folder without running scikit-image, whose data loader might go to the network.
    spec = find_spec("skimage")
    if spec is None or not spec.submodule_search_locations:
        raise MissingFileError(
            "scikit-image is not installed; the motorcycle pair ships with it: pip install scikit-image"
        )
    return Path(spec.submodule_search_locations[0]) / "data"


def _read_disparity(path: Path) -> DisparityMap:
    try:
        with np.load(path, allow_pickle=False) as archive:
            disparity: DisparityMap = archive["arr_0"].astype(np.float32)
    except FileNotFoundError as error:
        raise MissingFileError(f"{path}: no such file; install scikit-image anew") from error
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise DatasetError(f"{path}: no readable ground truth; install scikit-image anew") from error
    disparity[~np.isfinite(disparity)] = np.nan
    return disparity
