"""Where scenes come from: benchmarks, file formats, and the typed objects they are read into.

Names are imported when first used, so that `from semidense import datasets` costs next to nothing.

>>> from semidense import datasets
>>> datasets.open_dataset("motorcycle").scenes[0].size
(500, 741)
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semidense.datasets.errors import (
        ArchiveError,
        CalibrationError,
        DatasetError,
        FetchError,
        ImageError,
        LayoutError,
        MissingFileError,
        PfmError,
        Png16Error,
        SceneNotFound,
        UnknownDatasetError,
    )
    from semidense.datasets.formats.calibration.middlebury import CalibrationFile, read_calib
    from semidense.datasets.formats.images import image_size, read_image
    from semidense.datasets.formats.limits import MAX_PIXELS
    from semidense.datasets.formats.pfm import read_pfm, write_pfm
    from semidense.datasets.formats.png16 import read_png16, write_png16
    from semidense.datasets.occlusion import left_right_check, warped_truth_mask
    from semidense.datasets.registry import Dataset, Kind, describe, open_dataset, register_dataset
    from semidense.datasets.scene import (
        IMAGE_ROLES,
        TRUTH_ROLES,
        Calibration,
        DisparityRange,
        Scene,
        SceneReader,
        SceneSource,
        Truth,
    )

__all__ = [
    "IMAGE_ROLES",
    "MAX_PIXELS",
    "TRUTH_ROLES",
    "ArchiveError",
    "Calibration",
    "CalibrationError",
    "CalibrationFile",
    "Dataset",
    "DatasetError",
    "DisparityRange",
    "FetchError",
    "ImageError",
    "Kind",
    "LayoutError",
    "MissingFileError",
    "PfmError",
    "Png16Error",
    "Scene",
    "SceneNotFound",
    "SceneReader",
    "SceneSource",
    "Truth",
    "UnknownDatasetError",
    "describe",
    "image_size",
    "left_right_check",
    "open_dataset",
    "read_calib",
    "read_image",
    "read_pfm",
    "read_png16",
    "register_dataset",
    "warped_truth_mask",
    "write_pfm",
    "write_png16",
]

_HOMES = {
    "IMAGE_ROLES": "scene",
    "MAX_PIXELS": "formats.limits",
    "TRUTH_ROLES": "scene",
    "ArchiveError": "errors",
    "Calibration": "scene",
    "CalibrationError": "errors",
    "CalibrationFile": "formats.calibration.middlebury",
    "Dataset": "registry",
    "DatasetError": "errors",
    "DisparityRange": "scene",
    "FetchError": "errors",
    "ImageError": "errors",
    "Kind": "registry",
    "LayoutError": "errors",
    "MissingFileError": "errors",
    "PfmError": "errors",
    "Png16Error": "errors",
    "Scene": "scene",
    "SceneNotFound": "errors",
    "SceneReader": "scene",
    "SceneSource": "scene",
    "Truth": "scene",
    "UnknownDatasetError": "errors",
    "describe": "registry",
    "image_size": "formats.images",
    "left_right_check": "occlusion",
    "open_dataset": "registry",
    "read_calib": "formats.calibration.middlebury",
    "read_image": "formats.images",
    "read_pfm": "formats.pfm",
    "read_png16": "formats.png16",
    "register_dataset": "registry",
    "warped_truth_mask": "occlusion",
    "write_pfm": "formats.pfm",
    "write_png16": "formats.png16",
}


if not TYPE_CHECKING:
    # Hidden from type checkers, which would take it to mean that any name is there.
    def __getattr__(name: str) -> object:
        """Import what a name stands for when it is first used: listing scenes needs no readers."""
        if name in _HOMES:
            return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
