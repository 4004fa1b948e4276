"""Read what KITTI's two stereo benchmarks share: driving, with a sparse truth from a laser scanner.

Files of one frame have one name in every folder; ``_11`` frames are of the flow benchmark and left alone. Where the
truth of all pixels is there, it is the truth, and the mask is where the truth of the pixels visible in both views has
one; else the truth is the latter, and the mask is all of it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import ImageArray
from semidense.datasets.benchmarks.copies.publication import Publication, Source
from semidense.datasets.benchmarks.folders import contents, open_folder
from semidense.datasets.errors import DatasetError, LayoutError
from semidense.datasets.formats.calibration.cameras import PairCalibration
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.formats.images import image_size
from semidense.datasets.formats.png16 import read_png16
from semidense.datasets.readers import read_pair
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Split, Truth

_FRAMES = "*_10.png"
_ALL_PIXELS = "disp_occ"
"""Beginning of the folder whose truth is of hidden pixels, too: alone it does not tell which are visible."""


@dataclass(frozen=True)
class Edition:
    """Say how one of the benchmarks names its folders.

    Attributes:
        name: Of the benchmark, as in a specification.
        views: Folders of the left and of the right view, in the order in which they are looked for.
        truth: Folder of the truth of all pixels, and of those visible in both views.
        calibration: Folder of the calibrations.
        disparities: The range to search; None for that of the scene's truth.
        split: Whether a scene with a truth may be trained on.
    """

    name: str
    views: tuple[tuple[str, str], ...]
    truth: tuple[str, str]
    calibration: str
    disparities: DisparityRange | None
    split: Split


def published(name: str, archives: tuple[str, ...], cite: str, page: str, megabytes: int) -> Publication:
    """Say what an edition's publisher offers: its archives, the paper, and the page below ``datasets/kitti``."""
    return Publication(
        name=name,
        spec=f"{name}:{name}",
        sources=tuple(Source(f"https://s3.eu-central-1.amazonaws.com/avg-kitti/{each}", name) for each in archives),
        licence="CC BY-NC-SA 3.0",
        cite=cite,
        home=f"https://www.cvlibs.net/datasets/kitti/{page}",
        megabytes=megabytes,
    )


LARGEST = DisparityRange(0, 255)
"""What KITTI's format of truth can hold."""


def scenes(edition: Edition, argument: str) -> tuple[SceneSource, ...]:
    """List the scenes of an edition at a folder or in its ``training``, in the order of their numbers.

    Raises:
        LayoutError: If a folder or the counterpart of a left view is missing.
        DatasetError: If the folder is missing, or an image's header or a calibration is not valid.
    """
    root = open_folder(argument, f"{edition.name}:DIR")
    folder, place = _views(edition, root)
    # Hidden files, such as those that macOS adds, begin with a dot; the pattern alone would take them.
    names = sorted(path.name for path in (folder / edition.views[place][0]).glob(_FRAMES) if path.name[0] != ".")
    if not names:
        left, right = edition.views[0]
        raise LayoutError(
            f"{root}: no KITTI {edition.name.removeprefix('kitti')} scene; expected [training/]{left}/{_FRAMES} and "
            f"{right}; found {contents(root)}"
        )
    roles = _folders(edition, folder, place)
    _check_counterparts(roles, names)
    return tuple(_source(edition, roles, folder / edition.calibration, name) for name in names)


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truth and its mask; raises `DatasetError` if a file cannot be read or the sizes differ.

    Where the truth of visible pixels is missing, every known pixel counts.
    """
    truth = read_png16(files["truth"])
    visible = read_png16(files["truth_nonocc"]) if "truth_nonocc" in files else truth
    if visible.shape != truth.shape:
        raise DatasetError(f"{files['truth_nonocc']}: {visible.shape}, but {files['truth']} is {truth.shape}")
    hidden_too = "truth_nonocc" not in files and files["truth"].parent.name.startswith(_ALL_PIXELS)
    return Truth(truth, ~np.isnan(visible) & ~np.isnan(truth), "none" if hidden_too else "non-occluded truth")


def _views(edition: Edition, root: Path) -> tuple[Path, int]:
    """Return the folder that holds the views, and which of the edition's views those are."""
    candidates = [(folder, place) for folder in (root, root / "training") for place in range(len(edition.views))]
    found = (each for each in candidates if (each[0] / edition.views[each[1]][0]).is_dir())
    return next(found, (root / "training", 0))


def _folders(edition: Edition, folder: Path, place: int) -> dict[str, Path]:
    truths = [folder / name for name in edition.truth if (folder / name).is_dir()]
    left, right = (folder / name for name in edition.views[place])
    return {"left": left, "right": right} | dict(zip(("truth", "truth_nonocc"), truths, strict=False))


def _check_counterparts(roles: Mapping[str, Path], names: list[str]) -> None:
    for folder in roles.values():
        missing = [name for name in names if not (folder / name).is_file()]
        if missing:
            raise LayoutError(
                f"{folder}: lacks {len(missing)} of the {len(names)} frames of {roles['left'].name}, {missing[0]} "
                "first; every left view needs its counterpart of the same name"
            )


def _source(edition: Edition, roles: Mapping[str, Path], calibrations: Path, name: str) -> SceneSource:
    files = {role: folder / name for role, folder in roles.items()}
    size = image_size(files["left"])
    known = _calibration(name, size, calibrations, roles["left"].name)
    return SceneSource(
        name=Path(name).stem,
        dataset=edition.name,
        split=edition.split if "truth" in files else "test",
        size=size,
        disparities=edition.disparities or _range_of_truth(files),
        reader=__name__,
        files=files,
        has_truth="truth" in files,
        calibration=known.calibration if known else None,
        warnings=known.warnings if known else (),
    )


def _calibration(name: str, size: tuple[int, int], folder: Path, left: str) -> PairCalibration | None:
    path = folder / f"{name.partition('_')[0]}.txt"
    return read_cameras([path], folder=left).fitted(name, size) if path.is_file() else None


def _range_of_truth(files: Mapping[str, Path]) -> DisparityRange:
    if "truth" not in files:
        return LARGEST
    truth = read_png16(files["truth"])
    return DisparityRange(0, math.ceil(np.nanmax(truth))) if not np.isnan(truth).all() else LARGEST
