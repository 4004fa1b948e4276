"""Describe a stereo scene: its two views, its ground truth, and where both come from.

Everywhere a disparity ``d`` belongs to a pixel of the LEFT view unless said otherwise, and ``x_right = x_left - d``.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.arrays import DisparityMap, ImageArray, Mask, array_text, check_image, check_map, size_text
from semidense.datasets.errors import DatasetError
from semidense.datasets.exact_files import exact_files, file_digest

Split: TypeAlias = Literal["train", "test"]
RangeEnd: TypeAlias = Literal["minimum", "maximum"]
Parameter: TypeAlias = bool | int | float | str | None
MaskKind: TypeAlias = Literal["published", "left-right check", "warped truth", "exact", "non-occluded truth", "none"]

IMAGE_ROLES: tuple[str, ...] = ("left", "right")
"""Roles of the files that the two views are read from."""

TRUTH_ROLES: tuple[str, ...] = ("truth", "truth_right", "truth_nonocc", "mask")
"""Roles of the files that the ground truth is read from."""

_MAPS = "semidense.datasets.pairs.map_files"


@dataclass(frozen=True)
class DisparityRange:
    """Bound the disparities to search, in whole pixels, both ends included; negative ones are allowed.

    Raises:
        DatasetError: If the maximum is below the minimum.

    >>> DisparityRange(0, 69).count
    70
    """

    minimum: int
    maximum: int

    def __post_init__(self) -> None:
        if self.maximum < self.minimum:
            raise DatasetError(f"disparity range [{self.minimum}, {self.maximum}] is empty; give minimum <= maximum")

    @property
    def count(self) -> int:
        """Count the disparities of the range."""
        return self.maximum - self.minimum + 1


@dataclass(frozen=True)
class Calibration:
    """Hold what turns disparity into depth: ``Z = baseline * focal / (d + doffs)``, in millimetres.

    Attributes:
        focal: Focal length along x in pixels, above 0.
        baseline: Distance between the two cameras in millimetres, above 0.
        doffs: Difference of the principal points' columns, right minus left, in pixels.
        centre: Column and row of the left camera's principal point, in pixels; None if it is not known.
        focal_y: Focal length along y in pixels, above 0; None if it is that along x.
        skew: How much further right a point lies for each ``Y / Z``, in pixels: ``x = (focal X + skew Y) / Z + cx``.
    """

    focal: float
    baseline: float
    doffs: float
    centre: tuple[float, float] | None = None
    focal_y: float | None = None
    skew: float = 0.0

    def __post_init__(self) -> None:
        for name in ("focal", "baseline", "focal_y"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise DatasetError(f"calibration: {name} is {value}; it must be finite and above 0")
        for name in ("doffs", "skew"):
            if not math.isfinite(getattr(self, name)):
                raise DatasetError(f"calibration: {name} is {getattr(self, name)}; it must be finite")
        if self.centre is not None and not all(map(math.isfinite, self.centre)):
            raise DatasetError(f"calibration: the principal point is {self.centre}; it must be finite")


@dataclass(frozen=True, eq=False)
class Truth:
    """Hold a scene's ground truth.

    Attributes:
        disparity: (y, x) float32, pixels, left view, NaN where unknown.
        nonocc: (y, x) bool, true where the pixel is visible in both views and its truth is known.
        mask: Where ``nonocc`` comes from; "none" means that visibility is not known and every known pixel counts.
        right: (y, x) float32, pixels, right view (``x_left = x_right + d``), NaN where unknown; None if there is none.

    Raises:
        DatasetError: If shapes or dtypes disagree, an array is empty, a disparity is infinite, or ``nonocc`` holds a
            pixel of unknown truth.
    """

    disparity: DisparityMap
    nonocc: Mask
    mask: MaskKind
    right: DisparityMap | None = None

    def __post_init__(self) -> None:
        check_map("truth", self.disparity)
        if self.nonocc.dtype != np.bool_ or self.nonocc.shape != self.disparity.shape:
            raise DatasetError(
                f"non-occlusion mask is {array_text(self.nonocc)}; the truth needs bool, {size_text(self.disparity)}"
            )
        if np.isnan(self.disparity[self.nonocc]).any():
            raise DatasetError("non-occlusion mask holds pixels whose truth is unknown; clear them first")
        if self.right is not None:
            check_map("right truth", self.right)
            if self.right.shape != self.disparity.shape:
                raise DatasetError(
                    f"right truth is {size_text(self.right)}, left truth {size_text(self.disparity)}; both must agree"
                )


@dataclass(frozen=True, eq=False)
class Scene:
    """Hold a rectified pair, what is known about it, and the disparities to search.

    Attributes:
        name: Unique within its data set.
        left: (y, x) or (y, x, 3), uint8 or uint16: the reference view.
        right: The other view, of the same shape and dtype.
        truth: Ground truth of the same height and width, or None.
        disparities: The range to search.
        calibration: What depth needs, or None.

    Raises:
        DatasetError: If an image is empty, has another dtype or number of dimensions, or if shapes disagree.
    """

    name: str
    left: ImageArray
    right: ImageArray
    truth: Truth | None
    disparities: DisparityRange
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        for side, image in (("left", self.left), ("right", self.right)):
            check_image(f"{self.name}: {side} image", image)
        if self.left.shape != self.right.shape or self.left.dtype != self.right.dtype:
            raise DatasetError(
                f"{self.name}: left image is {array_text(self.left)}, right image {array_text(self.right)}; "
                "both views must agree"
            )
        if self.truth is not None and self.truth.disparity.shape != self.left.shape[:2]:
            raise DatasetError(
                f"{self.name}: truth is {size_text(self.truth.disparity)}, the images {size_text(self.left)}; "
                "both must agree"
            )


class SceneReader(Protocol):
    """Read a scene's files: what a module named by `SceneSource.reader` offers."""

    def read_images(
        self, files: Mapping[str, Path], parameters: Mapping[str, Parameter]
    ) -> tuple[ImageArray, ImageArray]:
        """Read the left and the right view."""

    def read_truth(self, files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
        """Read the ground truth; called only where there is one."""

    def read_costs(self, files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> NDArray[np.float16]:
        """Read the cost volume (y, x, d) of another matcher; called only where the role ``costs`` has a file."""


@dataclass(frozen=True)
class SceneSource:
    """Say where a scene comes from: cheap to list, to compare and to pickle; pixels are read by `load` only.

    Attributes:
        name: Unique within its data set.
        dataset: The data set without a path, such as ``middlebury/MiddEval3``.
        split: Whether it may be trained on.
        size: Rows and columns, from the image's header.
        disparities: The range to search.
        reader: Dotted name of the module that reads it (a `SceneReader`).
        files: Role to path. `IMAGE_ROLES` and `TRUTH_ROLES` name those that images and truth are read from.
        parameters: Whatever else the reader needs.
        has_truth: Whether there is a ground truth.
        calibration: What depth needs, or None.
        open_ends: The ends of ``disparities`` that are still to be estimated: they are as wide as the image allows.
        warnings: What looks wrong with the files, a line each.
        digests: Role to the sha256 of the bytes that its file must have, in hex; a role without one is not checked.
        map_reading: What the numbers of the file ``disparity`` mean: the fields of `pairs.map_files.Reading`.
        one_view: Whether there is no right view; the images then have zeros in its place.
    """

    name: str
    dataset: str
    split: Split
    size: tuple[int, int]
    disparities: DisparityRange
    reader: str
    files: Mapping[str, Path] = field(hash=False)
    parameters: Mapping[str, Parameter] = field(default_factory=dict, hash=False)
    has_truth: bool = False
    calibration: Calibration | None = None
    open_ends: tuple[RangeEnd, ...] = ()
    warnings: tuple[str, ...] = field(default=(), hash=False)
    digests: Mapping[str, str] = field(default_factory=dict, hash=False)
    map_reading: Mapping[str, float | None] = field(default_factory=dict, hash=False)
    one_view: bool = False

    def load(self) -> Scene:
        """Read images and truth.

        Raises:
            DatasetError: If a file is missing, damaged, or of another size than was listed.
        """
        left, right = self.load_images()
        return Scene(self.name, left, right, self.load_truth(), self.disparities, self.calibration)

    def load_images(self) -> tuple[ImageArray, ImageArray]:
        """Read the left and the right view only; raises what `load` raises."""
        with exact_files(self.files, self.digests) as files:
            left, right = self._reader().read_images(files, self.parameters)
        Scene(self.name, left, right, None, self.disparities)
        self._check_size("left", "images", left)
        return left, right

    def load_costs(self) -> NDArray[np.float16]:
        """Read the cost volume that came with the scene, (y, x, d); raises what `load` raises."""
        with exact_files(self.files, self.digests) as files:
            costs = self._reader().read_costs(files, self.parameters)
        self._check_size("costs", "cost volume", costs)
        if costs.shape[2] != self.disparities.count:
            raise DatasetError(f"{self.name}: {costs.shape[2]} disparities, but {self.disparities.count} were listed")
        return costs

    def load_map(self) -> DisparityMap:
        """Read the disparity map that came with the scene, (y, x) px, NaN none; raises what `load` raises."""
        maps = import_module(_MAPS)
        with exact_files(self.files, self.digests) as files:
            found: DisparityMap = maps.read_map(files["disparity"], maps.Reading(**self.map_reading))
        self._check_size("disparity", "disparity map", found)
        return found

    def load_truth(self) -> Truth | None:
        """Read the ground truth only, None where there is none; raises what `load` raises."""
        if not self.has_truth:
            return None
        with exact_files(self.files, self.digests) as files:
            truth = self._reader().read_truth(files, self.parameters)
        self._check_size("truth", "truth", truth.disparity)
        return truth

    def identity(self, roles: Collection[str] | None = None) -> dict[str, Any]:
        """Name the content that the scene is read from, ready for JSON: no paths, no times.

        Args:
            roles: The roles to take in; None takes all. A role without a file is left out.

        Returns:
            ``{"reader": module, "files": {role: sha256 of the bytes, in hex}, "parameters": {...}}``

        Raises:
            MissingFileError: If a file cannot be read.
        """
        chosen = sorted(role for role in self.files if roles is None or role in roles)
        digests = {role: file_digest(self.files[role]) for role in chosen}
        return {"reader": self.reader, "files": digests, "parameters": dict(self.parameters)}

    def image_identity(self) -> dict[str, Any]:
        """Name the content that the images are read from; see `identity`."""
        return self.identity(IMAGE_ROLES)

    def truth_identity(self) -> dict[str, Any]:
        """Name the content that the truth is read from; see `identity`."""
        return self.identity(TRUTH_ROLES)

    def has(self, role: str) -> bool:
        """Tell whether something of a role, such as ``costs`` or ``disparity``, came with the scene."""
        return role in self.files

    def _reader(self) -> SceneReader:
        return cast(SceneReader, import_module(self.reader))

    def _check_size(self, role: str, what: str, array: np.ndarray[Any, Any]) -> None:
        if array.shape[:2] != self.size:
            rows, columns = self.size
            told = "was listed: list it again" if role in IMAGE_ROLES else "is the images' size: both must agree"
            where = self.files.get(role, self.name)
            raise DatasetError(f"{where}: {what} of {size_text(array)}, but {rows} x {columns} {told}")
