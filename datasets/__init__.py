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
        CalibrationError,
        DatasetError,
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
    "Calibration",
    "CalibrationError",
    "CalibrationFile",
    "Dataset",
    "DatasetError",
    "DisparityRange",
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

_MODULES = (
    "errors",
    "scene",
    "registry",
    "occlusion",
    "formats.pfm",
    "formats.png16",
    "formats.calibration.middlebury",
    "formats.images",
    "formats.limits",
)


if not TYPE_CHECKING:
    # Hidden from type checkers, which would take it to mean that any name is there.
    def __getattr__(name: str) -> object:
        if name in __all__:
            for module in _MODULES:
                contents = vars(import_module(f"{__name__}.{module}"))
                if name in contents:
                    return contents[name]
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
