"""Find the scenes of KITTI Stereo 2015: driving, with a sparse truth from a laser scanner.

``kitti2015:DIR`` takes the root or its ``training`` (or ``testing``) folder::

    DIR/training/image_2/000000_10.png      left view
    DIR/training/image_3/000000_10.png      right view
    DIR/training/disp_noc_0/000000_10.png   truth of the pixels visible in both views, 16-bit PNG
    DIR/training/disp_occ_0/000000_10.png   truth of all pixels (optional)

Files belong together by name; ``_11`` frames are of the flow benchmark and left alone. With ``disp_occ_0`` the truth is
that, and the mask is where ``disp_noc_0`` has one; without it the truth is ``disp_noc_0`` and the mask is all of it.

Source: Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import ImageArray
from semidense.datasets.benchmarks.folders import contents, open_folder
from semidense.datasets.errors import DatasetError, LayoutError
from semidense.datasets.formats.images import image_size
from semidense.datasets.formats.png16 import read_png16
from semidense.datasets.readers import read_pair
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Truth

DISPARITIES = DisparityRange(0, 127)
"""A fixed choice, as the benchmark publishes no range: nearly all of the truth is below 128 px."""

_FRAMES = "*_10.png"


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes, in the order of their numbers.

    Raises:
        LayoutError: If a folder or the counterpart of a left view is missing.
        DatasetError: If the folder is missing or an image's header is not valid.
    """
    root = open_folder(argument, "kitti2015:DIR")
    folder = root if (root / "image_2").is_dir() else root / "training"
    # Hidden files, such as those that macOS adds, begin with a dot; the pattern alone would take them.
    names = sorted(path.name for path in (folder / "image_2").glob(_FRAMES) if not path.name.startswith("."))
    if not names:
        raise LayoutError(
            f"{root}: no KITTI 2015 scene; expected [training/]image_2/{_FRAMES} and image_3; found {contents(root)}"
        )
    roles = _folders(folder)
    _check_counterparts(roles, names)
    return tuple(_source(roles, name) for name in names)


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truth and its mask; raises `DatasetError` if a file cannot be read or the sizes differ."""
    truth = read_png16(files["truth"])
    visible = read_png16(files["truth_nonocc"]) if "truth_nonocc" in files else truth
    if visible.shape != truth.shape:
        raise DatasetError(f"{files['truth_nonocc']}: {visible.shape}, but {files['truth']} is {truth.shape}")
    return Truth(truth, ~np.isnan(visible) & ~np.isnan(truth), "non-occluded truth")


def _folders(folder: Path) -> dict[str, Path]:
    truths = [folder / name for name in ("disp_occ_0", "disp_noc_0") if (folder / name).is_dir()]
    roles = {"left": folder / "image_2", "right": folder / "image_3"}
    return roles | dict(zip(("truth", "truth_nonocc"), truths, strict=False))


def _check_counterparts(roles: Mapping[str, Path], names: list[str]) -> None:
    for folder in roles.values():
        missing = [name for name in names if not (folder / name).is_file()]
        if missing:
            raise LayoutError(
                f"{folder}: lacks {len(missing)} of the {len(names)} frames of image_2, {missing[0]} first; "
                "every left view needs its counterpart of the same name"
            )


def _source(roles: Mapping[str, Path], name: str) -> SceneSource:
    files = {role: folder / name for role, folder in roles.items()}
    return SceneSource(
        name=Path(name).stem,
        dataset="kitti2015",
        split="test",
        size=image_size(files["left"]),
        disparities=DISPARITIES,
        reader=__name__,
        files=files,
        has_truth="truth" in files,
    )
