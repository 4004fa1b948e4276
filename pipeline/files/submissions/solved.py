"""What is submitted of a scene, and what every benchmark's module says of its archive."""

import io
import re
import tempfile
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import SceneSource, read_pfm, write_pfm
from semidense.pipeline.plan.errors import UsageError

Form: TypeAlias = Literal["dense", "sparse"]
Map: TypeAlias = NDArray[np.float32]
METHOD = re.compile(r"[A-Za-z0-9+-]{1,20}")
"""Names of a method that stay whole in the name of a file."""


@dataclass(frozen=True)
class Solved:
    """The maps of a scene.

    Attributes:
        scene: where it comes from.
        maps: (y, x) float32, px, NaN for none, by form: a dense one has no NaN.
        seconds: what their computation took.
    """

    scene: SceneSource
    maps: dict[Form, Map]
    seconds: float


@dataclass(frozen=True)
class Layout:
    """What a benchmark's server takes.

    Attributes:
        name: of the benchmark.
        forms: what it takes of a scene; the first alone if it takes one map only.
        several: whether it takes both forms at once.
        entries: gives the files of a scene: path in the archive and content.
        check: refuses a file of the archive that breaks the rules; given its path, its content and the scene.
        lacks: says what is missing for the server to take an archive of these scenes; nothing if it is complete.
    """

    name: str
    forms: tuple[Form, ...]
    several: bool
    entries: Callable[[Solved, str], Iterator[tuple[str, bytes]]]
    check: Callable[[str, bytes, SceneSource], None]
    lacks: Callable[[Collection[SceneSource]], str | None]


def pfm_bytes(disparity: Map) -> bytes:
    """Return a map as the bytes of a PFM file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "map.pfm")
        write_pfm(path, disparity)
        return path.read_bytes()


def check_pfm(name: str, content: bytes, scene: SceneSource, dense: bool) -> None:
    """Refuse a PFM file of another size than the scene's, with negative values, or with holes though it is dense.

    Raises:
        UsageError: with what is wrong.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "map.pfm")
        path.write_bytes(content)
        check_map(name, read_pfm(path), scene, dense)


def check_map(name: str, disparity: Map, scene: SceneSource, dense: bool) -> None:
    """Refuse a map of another size than the scene's, with negative values, without any, or with holes if it is dense.

    Raises:
        UsageError: with what is wrong.
    """
    known = ~np.isnan(disparity)
    if disparity.shape != scene.size:
        raise UsageError(f"{name}: {disparity.shape} pixels, but the image has {scene.size}")
    if not known.any() or (dense and not known.all()):
        raise UsageError(f"{name}: {(~known).sum():,} pixels have no disparity; submit the sparse form")
    if disparity[known].min() < 0:
        raise UsageError(f"{name}: disparities down to {disparity[known].min():g}; the benchmark takes none below 0")


def check_seconds(name: str, text: str) -> None:
    """Refuse a time that is no number above 0.

    Raises:
        UsageError: with the text.
    """
    try:
        valid = 0 < float(text) < np.inf
    except ValueError:
        valid = False
    if not valid:
        raise UsageError(f"{name}: {text!r} is no time in seconds")


def png16_map(name: str, content: bytes) -> Map:
    """Return the disparities of a 16-bit PNG in KITTI's scale, NaN for none.

    Raises:
        UsageError: if it is another kind of image.
    """
    from PIL import Image

    with Image.open(io.BytesIO(content)) as image:
        if image.format != "PNG" or image.mode != "I;16":
            raise UsageError(f"{name}: {image.format} {image.mode}; a 16-bit gray PNG is needed")
        stored = np.asarray(image).astype(np.float32)
    return np.where(stored > 0, stored / 256, np.float32(np.nan)).astype(np.float32)
