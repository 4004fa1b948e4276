"""What a stage is: one frozen declaration and one pure function over arrays.

A stage knows nothing of paths, stores or schedulers. The runner reads the declaration, cuts the
inputs into tiles, adds the halo, calls ``compute`` and writes what it returns. So *tile == whole*
can be tested, and any stage runs in a notebook without the rest.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal, Protocol, TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

T = TypeVar("T")
Array = NDArray[Any]
Arrays = Mapping[str, Array]
"""The arrays of one product, by name."""
Inputs = Mapping[str, Any]
"""What ``compute`` is given: product name -> its arrays (for a split stage: one ``Arrays`` a scene). A stage names what
it takes by a ``TypedDict`` of the products' own, which stand beside their declarations."""
Scope = Literal["scene", "split"]
Border = Literal["cut", "edge"]


class Images(TypedDict):
    """The product ``images``: (y, x, band) uint8 or uint16; (view, moment) mean and deviation of the 8-bit gray."""

    left: Array
    right: Array
    moments: NDArray[np.float64]


class Truth(TypedDict):
    """The product ``truth``: (y, x) disparities in px, NaN unknown, and what both views see; the scene's range."""

    disparity: NDArray[np.float32]
    nonocc: NDArray[np.bool_]
    right_disparity: NDArray[np.float32]
    right_nonocc: NDArray[np.bool_]
    range: NDArray[np.int32]
    mask_kind: NDArray[np.int8]


class Network(TypedDict):
    """A trained network: (parameter,) its weights, (step,) the loss of each training step."""

    parameters: NDArray[np.float32]
    loss: NDArray[np.float32]


class CostVolume(TypedDict):
    """The product ``costvolume``: (y, x, d) log-odds of a mismatch, NaN: no such cell; (d,) its disparities in px."""

    cost: NDArray[np.float16]
    d: NDArray[np.int16]


class DisparityMap(TypedDict):
    """A product that is a map: (y, x) disparities in px, NaN: none."""

    disparity: NDArray[np.float32]


class OfImages(TypedDict):
    """The inputs of a stage that is made from the views alone."""

    images: Images


class OfVolume(TypedDict):
    """The inputs of a stage that is made from the costs alone."""

    costvolume: CostVolume


class StageError(ValueError):
    """A stage was given arrays or parameters that it cannot work on."""


class Params(BaseModel):
    """One section of the configuration: exactly the fields that enter the keys of its stage."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, allow_inf_nan=False)


class NoParams(Params):
    """The section of a stage that has nothing to set."""


class RangeParams(Params):
    """The disparities that are looked through."""

    d_min: int | None = Field(None, description="smallest disparity, px; default: the scene's own")
    d_max: int | None = Field(None, description="largest disparity, px; default: the scene's own")

    @property
    def disparities(self) -> range:
        """The disparities, once both ends are known.

        Raises:
            StageError: if one is not.
        """
        if self.d_min is None or self.d_max is None:
            raise StageError("the disparity range has an open end: give d_min and d_max")
        return range(self.d_min, self.d_max + 1)

    @model_validator(mode="after")
    def _ordered(self) -> "RangeParams":
        if self.d_min is not None and self.d_max is not None and self.d_max < self.d_min:
            raise ValueError(f"d_max {self.d_max} lies below d_min {self.d_min}")
        return self


@dataclass(frozen=True)
class Output:
    """One array of a product.

    Attributes:
        name: its name in the product's dataset.
        dims: dimension names, in order; ``y`` and ``x`` are the image's rows and columns.
        dtype: NumPy dtype name, as stored; None: as computed.
        units: physical unit (``px``, ``1`` for a pure number).
        about: one line for people, stored as ``long_name``.
        chunks: chunk length by dimension; a dimension not named is one chunk. On a tiled stage
            the runner sets ``y`` to the tile's rows, so that a tile writes whole chunks.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str | None
    units: str
    about: str
    chunks: Mapping[str, int] = field(default_factory=dict)


class Monitor(Protocol):
    """What long work is given to report to and to resume from."""

    def progress(self, done: int, total: int, note: str = "") -> None:
        """Say how far the work is: ``done`` of ``total`` steps, with a short note such as the loss."""

    def save(self, state: bytes) -> None:
        """Keep a checkpoint from which ``load`` lets a later call go on."""

    def load(self) -> bytes | None:
        """Return the latest checkpoint, or None."""


class Silent:
    """A monitor for notebooks and tests: reports nothing, keeps nothing."""

    def progress(self, done: int, total: int, note: str = "") -> None:
        """Say nothing."""

    def save(self, state: bytes) -> None:
        """Keep nothing."""

    def load(self) -> bytes | None:
        """Return None: there is never a checkpoint."""
        return None


@dataclass(frozen=True)
class Always:
    """A function of a declaration that always returns the same; unlike a lambda it can be pickled."""

    value: Any

    def __call__(self, *_: object) -> Any:  # noqa: ANN401 - of the type of what it was given
        """Return the value, whatever is asked."""
        return self.value


@dataclass(frozen=True)
class Stage:
    """The declaration of a stage. It can be pickled, if its functions have names.

    Attributes:
        product: what it makes; the name that ``--upto`` takes.
        inputs: products it is made from.
        outputs: the arrays of the product.
        compute: ``module:function`` of ``compute(params, inputs) -> {array name: array}``; with
            ``monitored``, a ``monitor`` is passed as a third argument. A name, so that planning and
            looking at the cache do not load torch.
        params: the section of the configuration whose fields enter the key.
        scope: ``scene`` (one product a scene) or ``split`` (one for all training scenes).
        tile_rows: rows a tile, and a chunk of its arrays; None if it needs the whole image at once.
        chunks_a_tile: how many chunks of rows one tile makes instead, from the parameters and the image's columns: of a
            stage whose halo costs much, and whose numbers do not depend on where its tiles begin.
        halo: pixels of context that a tile needs on each side, from the parameters.
        border: what a tile sees beyond the image. ``cut``: nothing, the block ends at the image
            and the output has the block's size (the runner trims the halo). ``edge``: the nearest
            pixel, always ``halo`` wide on all four sides, and the output is smaller by the halo.
        sizes: of a tiled stage, the length of each dimension other than ``y`` and ``x``, from the
            parameters: its arrays exist before its first tile.
        monitored: long work, which reports progress and can resume.
        section: the product whose section of the configuration it takes; empty: its own.
        lazy: of a stage that is not tiled, inputs whose arrays come unread: slicing one reads that part of it.
        needs: distributions beside the core ones; their versions enter the key.
        learnt: its result is learnt from training scenes, and may come as a file of weights instead.
        cross_fitted: of a split stage: each training scene comes as networks of other scenes score it. Its settings
            have ``folds`` and ``fold_of_scene``.
        one_view: of the images it looks at the left view alone, so that it works on a scene without a right one.
    """

    product: str
    inputs: tuple[str, ...]
    outputs: tuple[Output, ...]
    compute: str
    params: type[Params] = NoParams
    scope: Scope = "scene"
    tile_rows: int | None = None
    chunks_a_tile: Callable[[Any, int], int] = Always(1)
    halo: Callable[[Any], int] = Always(0)
    border: Border = "cut"
    sizes: Callable[[Any], Mapping[str, int]] = Always({})
    monitored: bool = False
    section: str = ""
    lazy: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    learnt: bool = False
    cross_fitted: bool = False
    one_view: bool = False

    @property
    def module(self) -> str:
        """Name of the module whose code, with all it imports, makes the product."""
        return self.compute.partition(":")[0]

    @property
    def plugin_identity(self) -> dict[str, Any]:
        """What else the key of a stage of another package holds: its function, since a module may have several; arrays.

        A module of ours has one function a stage, and its arrays change with its code.
        """
        if self.module.partition(".")[0] == __name__.partition(".")[0]:
            return {}
        return {"compute": self.compute, "outputs": [[each.name, each.dims, each.dtype] for each in self.outputs]}

    def tiling(self, params: Params) -> str:
        """Say how the image is cut: it decides the order of sums, and which files there are."""
        if self.tile_rows is None:
            return "whole"
        return f"{self.tile_rows} rows, halo {self.halo(params)}, {self.border}"

    def function(self) -> Callable[..., Arrays]:
        """Import and return the function that ``compute`` names."""
        module, _, name = self.compute.partition(":")
        function: Callable[..., Arrays] = getattr(import_module(module), name)
        return function


def by_scene(scenes: Sequence[T], product: str) -> Sequence[T]:
    """Return a split stage's input: the arrays of a product, one training scene after the other.

    Raises:
        StageError: if there is no training scene.
    """
    if not scenes:
        raise StageError(f"no training scene has {product!r}: name a dataset with a training split")
    return scenes


def require_shape(name: str, array: Array, ndim: int) -> None:
    """Refuse an array of another number of dimensions.

    Raises:
        StageError: naming the array, its shape and what was expected.
    """
    if np.ndim(array) != ndim:
        raise StageError(f"{name} has shape {np.shape(array)}, expected {ndim} dimensions")


def require_share(name: str, value: float) -> None:
    """Refuse a number outside [0, 1].

    Raises:
        StageError: naming it and its value; NaN is outside.
    """
    if not 0 <= value <= 1:
        raise StageError(f"{name} is {value:g}, expected a number in [0, 1]")
