"""Read a scene of Middlebury's version 3 evaluation, of 2014 or of 2021: ``im0.png im1.png calib.txt`` and a PFM truth.

Disparities to search: 0 to ``ndisp - 1`` of ``calib.txt``. Mask: the published ``mask0nocc.png``; without it a
left-right check where the right truth is there, else the warped truth's.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from semidense.datasets.arrays import ImageArray
from semidense.datasets.benchmarks.folders import existing, require
from semidense.datasets.readers import calibrated_size, read_pair, read_pfm_truth
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Truth

PATTERNS = ("im0.png im1.png calib.txt [disp0GT.pfm [disp1GT.pfm] | disp0.pfm [disp1.pfm]] [mask0nocc.png]",)
"""The files of a scene, for messages."""

_REQUIRED = ("im0.png", "im1.png", "calib.txt")
_MIDDEVAL3 = (("truth", "disp0GT.pfm"), ("truth_right", "disp1GT.pfm"), ("mask", "mask0nocc.png"))
_OF_A_YEAR = (("truth", "disp0.pfm"), ("truth_right", "disp1.pfm"), ("mask", "mask0nocc.png"))

_SCENE_OF_2021 = re.compile(
    r"(artroom|bandsaw|chess|curule|ladder|octogons|pendulum|podium|skates|skiboots|traproom)\d"
)
"""Names of 2021; those of 2014 begin with a capital."""


def is_scene(folder: Path) -> bool:
    """Tell whether a folder follows this layout, complete or not."""
    return (folder / "im0.png").is_file()


def source(folder: Path, name: str, views: Mapping[str, Path]) -> SceneSource:
    """Describe the scene in a folder; ``views`` are other pictures of the roles ``left`` and ``right``.

    Raises:
        LayoutError: If a file is missing.
        DatasetError: If ``calib.txt`` or the left image's header is not valid, or their sizes differ.
    """
    require(folder, _REQUIRED, PATTERNS[0])
    of_a_year = (folder / "disp0.pfm").is_file() and not (folder / "disp0GT.pfm").is_file()
    files = {"left": folder / "im0.png", "right": folder / "im1.png", "calib": folder / "calib.txt", **views}
    size, calib = calibrated_size(files)
    truth = existing(folder, _OF_A_YEAR if of_a_year else _MIDDEVAL3)
    year = "2021" if _SCENE_OF_2021.fullmatch(folder.resolve().name) else "2014"
    return SceneSource(
        name=name,
        dataset=f"middlebury/{year}" if of_a_year else "middlebury/MiddEval3",
        split="test",
        size=size,
        disparities=DisparityRange(0, calib.ndisp - 1),
        reader=__name__,
        files={**files, **truth},
        has_truth="truth" in truth,
        calibration=calib.calibration,
        warnings=calib.warnings,
    )


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truth and its mask; raises `DatasetError` if one cannot be read."""
    return read_pfm_truth(files)
