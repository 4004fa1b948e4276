"""Write a map of numbers in common formats; each file describes its content where its format allows it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import Png16Error, write_pfm, write_png16
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.tiff import write_tiff

FORMATS = ("pfm", "png", "tiff", "npy")
"""Formats of maps: float PFM, 16-bit PNG, float TIFF, NumPy."""
ENDINGS = {"pfm": "pfm", "png": "png", "tiff": "tif", "npy": "npy"}
_NONE = {"pfm": "infinity", "png": "0", "tiff": "NaN", "npy": "NaN"}


@dataclass(frozen=True)
class Quantity:
    """What a map holds.

    Attributes:
        name: the stem of its files.
        about: one line for people, with the unit and the sign.
        unit: of its values.
        png_scale: steps of the 16-bit PNG to a unit.
        view: the view whose pixels it belongs to.
    """

    name: str
    about: str
    unit: str
    png_scale: float
    view: str = "left"

    def described(self, kind: str) -> dict[str, str]:
        """Return what a file of one format says of itself."""
        scale = f"{self.png_scale:g}" if kind == "png" else "1"
        return {
            "quantity": self.about,
            "unit": self.unit,
            "scale": f"value = stored / {scale}" if kind == "png" else "stored as they are",
            "none": _NONE[kind],
            "reference view": self.view,
        }


DISPARITY = Quantity("disparity", "disparity d: x_right = x_left - d", "px", 256)
RAW_DISPARITY = Quantity("disparity_raw", "disparity d: x_right = x_left - d; raw", "px", 256)
RIGHT_DISPARITY = Quantity("right_disparity", "disparity d: x_left = x_right + d; raw", "px", 256, "right")
CONFIDENCE = Quantity("confidence", "probability that the raw disparity is right, 0 to 1", "1", 65535)
DEPTH = Quantity("depth", "depth along the optical axis", "m", 1000)


def write_map(values: NDArray[np.float32], quantity: Quantity, kind: str, folder: Path) -> tuple[str, dict[str, str]]:
    """Write a map in one of ``FORMATS``; return the file's name and what it says of itself.

    Raises:
        Png16Error: if a 16-bit PNG cannot hold the values.
        OSError: if the file cannot be written.
    """
    name, about = f"{quantity.name}.{ENDINGS[kind]}", quantity.described(kind)
    _WRITERS[kind](folder / name, values, quantity, about)
    return name, about


def _pfm(path: Path, values: NDArray[np.float32], _: Quantity, __: Mapping[str, Any]) -> None:
    write_pfm(path, values)


def _png(path: Path, values: NDArray[np.float32], quantity: Quantity, about: Mapping[str, str]) -> None:
    write_png16(path, values, quantity.png_scale, about)


def _tiff(path: Path, values: NDArray[np.float32], _: Quantity, about: Mapping[str, str]) -> None:
    write_tiff(path, values, about)


def _npy(path: Path, values: NDArray[np.float32], _: Quantity, __: Mapping[str, Any]) -> None:
    with atomic_write(path) as file:
        np.save(file, values, allow_pickle=False)


_WRITERS: Mapping[str, Callable[[Path, NDArray[np.float32], Quantity, Mapping[str, str]], None]] = {
    "pfm": _pfm,
    "png": _png,
    "tiff": _tiff,
    "npy": _npy,
}

__all__ = [
    "CONFIDENCE",
    "DEPTH",
    "DISPARITY",
    "FORMATS",
    "RAW_DISPARITY",
    "RIGHT_DISPARITY",
    "Png16Error",
    "Quantity",
    "write_map",
]
