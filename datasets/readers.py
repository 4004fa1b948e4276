"""Read what several benchmarks share: a pair of image files, and a PFM truth beside an optional mask."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import DisparityMap, ImageArray, Mask
from semidense.datasets.errors import CalibrationError, ImageError
from semidense.datasets.formats.calibration.middlebury import CalibrationFile, read_calib
from semidense.datasets.formats.images import image_size, read_image
from semidense.datasets.formats.pfm import read_pfm
from semidense.datasets.occlusion import left_right_check, warped_truth_mask
from semidense.datasets.scene import MaskKind, Truth

VISIBLE = 255
"""Value of the pixels visible in both views in every published mask; occluded ones have 128 or 0, unknown ones 0."""


def read_pair(files: Mapping[str, Path]) -> tuple[ImageArray, ImageArray]:
    """Read the images of the roles ``left`` and ``right``.

    Raises:
        DatasetError: If one is missing or cannot be read.
    """
    return read_image(files["left"]), read_image(files["right"])


def calibrated_size(files: Mapping[str, Path]) -> tuple[tuple[int, int], CalibrationFile]:
    """Read the left image's rows and columns from its header, and the ``calib.txt`` that must agree with it.

    Raises:
        CalibrationError: If ``calib.txt`` is not valid or is of another size.
        DatasetError: If the image's header is not valid.
    """
    size, calib = image_size(files["left"]), read_calib(files["calib"])
    if calib.size != size:
        rows, columns = calib.size
        raise CalibrationError(
            f"{files['calib']}: height={rows} and width={columns}, but the image is {size[0]} x {size[1]}; "
            "take the calibration of this resolution"
        )
    return size, calib


def read_pfm_truth(files: Mapping[str, Path]) -> Truth:
    """Read a truth of the roles ``truth``, ``truth_right`` (if any) and ``mask`` (if any).

    Raises:
        DatasetError: If a file is missing or cannot be read, or the sizes differ.
    """
    right = read_pfm(files["truth_right"]) if "truth_right" in files else None
    return assemble_truth(read_pfm(files["truth"]), right, files.get("mask"))


def assemble_truth(disparity: DisparityMap, right: DisparityMap | None, mask_file: Path | None) -> Truth:
    """Put a truth together with the best mask there is: the published one, a left-right check, or a warp of the truth.

    Args:
        disparity: (y, x) float32, left view, NaN where unknown.
        right: The right view's, or None.
        mask_file: The published mask, an 8-bit image with 255 for visible in both views, or None.

    Raises:
        DatasetError: If the mask cannot be read or marks no pixel as visible, or the sizes differ.
    """
    visible, kind = _visible(disparity, right, mask_file)
    return Truth(disparity, visible & ~np.isnan(disparity), kind, right)


def _visible(disparity: DisparityMap, right: DisparityMap | None, mask_file: Path | None) -> tuple[Mask, MaskKind]:
    if mask_file is not None:
        return _read_mask(mask_file, disparity.shape), "published"
    if right is not None:
        return left_right_check(disparity, right), "left-right check"
    return warped_truth_mask(disparity), "warped truth"


def _read_mask(path: Path, shape: tuple[int, ...]) -> Mask:
    mask = read_image(path)
    if mask.dtype != np.uint8 or mask.shape != shape:
        raise ImageError(f"{path}: a mask of {mask.dtype} {mask.shape}; the truth needs an 8-bit gray one of {shape}")
    visible: Mask = mask == VISIBLE
    if not visible.any():
        raise ImageError(
            f"{path}: no pixel of this mask is {VISIBLE}, which marks those visible in both views; its values are "
            f"{mask.min()} to {mask.max()}"
        )
    return visible
