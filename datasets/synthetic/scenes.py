"""Make scenes of textured planes with exact ground truth: no download, any size, hard in the ways one asks for.

``synthetic`` gives three training scenes, ``train-0`` to ``train-2``, and two test scenes, ``test-0`` and ``test-1``.
``synthetic:KEY=VALUE,...`` changes what `SyntheticOptions` lists, as in ``synthetic:seed=3,height=240,lighting=0.4``.
A scene is a slanted background and five slanted or upright planes before it, rendered by
`semidense.datasets.synthetic.planes`; the same options give the same scenes.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from semidense.datasets.arrays import ImageArray
from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.limits import MAX_PIXELS
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Split, Truth
from semidense.datasets.synthetic.planes import Floats, Plane, Waves, World

_FOREGROUND = 5
_WAVES = 24
_CONTRAST = 14.0
_SPLITS: tuple[Split, ...] = ("train", "test")


@dataclass(frozen=True)
class SyntheticOptions:
    """Say which scenes to make.

    Attributes:
        seed: Any whole number from 0; every scene of every seed differs.
        train: Number of training scenes, from 0.
        test: Number of test scenes, from 0.
        height: Rows, from 16.
        width: Columns, from 16.
        disparities: Largest disparity, pixels, from 4 to half the width; 0 is the smallest.
        lighting: How differently the right view is lit, 0 to 1: less gain, another gamma, a gradient across.
        textureless: Share of each surface that is one flat colour, 0 to 1.
        noise: Standard deviation of the Gaussian noise in each view, gray levels, 0 to 64.

    Raises:
        DatasetError: If a value is out of its range.
    """

    seed: int = 0
    train: int = 3
    test: int = 2
    height: int = 96
    width: int = 128
    disparities: int = 20
    lighting: float = 0.0
    textureless: float = 0.0
    noise: float = 0.0

    def __post_init__(self) -> None:
        for name, (low, high) in self._ranges().items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise DatasetError(f"synthetic: {name}={value}; it must be from {low:g} to {high:g}")
        if self.height * self.width > MAX_PIXELS:
            raise DatasetError(
                f"synthetic: {self.height} x {self.width} = {self.height * self.width:,} pixels, above {MAX_PIXELS:,}"
            )

    def _ranges(self) -> dict[str, tuple[float, float]]:
        return {
            "seed": (0, 2**32),
            "train": (0, 1000),
            "test": (0, 1000),
            "height": (16, 16384),
            "width": (16, 16384),
            "disparities": (4, self.width // 2),
            "lighting": (0, 1),
            "textureless": (0, 1),
            "noise": (0, 64),
        }


def list_scenes(argument: str = "") -> tuple[SceneSource, ...]:
    """List the scenes that ``KEY=VALUE,...`` describes.

    Raises:
        DatasetError: If a key is not known, given twice or not a number, or a value is out of its range.
    """
    options = parse_options(argument)
    counts: dict[Split, int] = {"train": options.train, "test": options.test}
    return tuple(_source(options, split, index) for split in _SPLITS for index in range(counts[split]))


def parse_options(argument: str) -> SyntheticOptions:
    """Read ``KEY=VALUE,...``; an empty text gives the defaults.

    Raises:
        DatasetError: As `list_scenes`.

    >>> parse_options("seed=3,noise=2").noise
    2.0
    """
    types = {field.name: type(field.default) for field in dataclasses.fields(SyntheticOptions)}
    values: dict[str, int | float] = {}
    for item in filter(None, argument.split(",")):
        key, _, text = (part.strip() for part in item.partition("="))
        if key not in types or key in values:
            problem = "given twice" if key in values else f"not known; known are {', '.join(types)}"
            raise DatasetError(f"synthetic: {key!r} is {problem}")
        values[key] = _number(key, text, types[key])
    return SyntheticOptions(**values)  # type: ignore[arg-type]  # each value was made by its own field's type


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Render the left and the right view, (y, x, 3) uint8; there are no files."""
    options, seed = _unpack(parameters)
    world = _world(options, seed)
    right = _relight(world.right_view(), options.lighting)
    return _expose(world.left_view(), options.noise, [*seed, 1]), _expose(right, options.noise, [*seed, 2])


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Compute both truths and the exact mask; there are no files."""
    world = _world(*_unpack(parameters))
    return Truth(world.left_truth(), world.visible(), "exact", world.right_truth())


def _number(key: str, text: str, kind: type) -> int | float:
    try:
        value = int(text) if kind is int else float(text)
    except ValueError as error:
        raise DatasetError(f"synthetic: {key}={text}; expected a {'whole ' * (kind is int)}number") from error
    return value


def _source(options: SyntheticOptions, split: Split, index: int) -> SceneSource:
    shared = {key: value for key, value in dataclasses.asdict(options).items() if key not in _SPLITS}
    return SceneSource(
        name=f"{split}-{index}",
        dataset="synthetic",
        split=split,
        size=(options.height, options.width),
        disparities=DisparityRange(0, options.disparities),
        reader=__name__,
        files={},
        parameters={**shared, "split": split, "index": index},
        has_truth=True,
    )


def _unpack(parameters: Mapping[str, Parameter]) -> tuple[SyntheticOptions, list[int]]:
    """Give back the options and the numbers that a scene's randomness starts from."""
    shared = {key: value for key, value in parameters.items() if key not in ("split", "index")}
    options = SyntheticOptions(**shared)  # type: ignore[arg-type]  # as `_source` packed them
    split, index = cast(Split, parameters["split"]), cast(int, parameters["index"])
    return options, [options.seed, _SPLITS.index(split), index]


def _world(options: SyntheticOptions, seed: list[int]) -> World:
    random = np.random.default_rng([*seed, 0])
    nearness = np.linspace(0.35, 0.9, _FOREGROUND)
    planes = [_background(random, options), *(_foreground(random, options, share) for share in nearness)]
    return World(planes, options.height, options.width)


def _background(random: np.random.Generator, options: SyntheticOptions) -> Plane:
    # What the right view shows of it reaches beyond the left view, so its disparity must have room over that too.
    reach = (options.width / 2 + options.disparities, options.height / 2)
    slope = _slope(random, 0.1 * options.disparities, reach)
    middle = ((options.width - 1) / 2, (options.height - 1) / 2)
    return _plane(random, options, slope, 0.2 * options.disparities, middle, (math.inf, math.inf))


def _foreground(random: np.random.Generator, options: SyntheticOptions, share: float) -> Plane:
    centre = (random.uniform(0.15, 0.85) * options.width, random.uniform(0.15, 0.85) * options.height)
    half = (random.uniform(0.1, 0.2) * options.width, random.uniform(0.1, 0.25) * options.height)
    upright = random.random() < 0.4
    slope = (0.0, 0.0) if upright else _slope(random, 0.1 * options.disparities, half)
    return _plane(random, options, slope, share * options.disparities, centre, half)


def _slope(random: np.random.Generator, room: float, half: tuple[float, float]) -> tuple[float, float]:
    """Draw a slope that changes the disparity by at most ``room`` from the centre to any corner."""
    along_x, along_y = random.uniform(-0.5, 0.5, 2) * room
    return float(along_x / half[0]), float(along_y / half[1])


def _plane(
    random: np.random.Generator,
    options: SyntheticOptions,
    slope: tuple[float, float],
    disparity: float,
    centre: tuple[float, float],
    half: tuple[float, float],
) -> Plane:
    """Draw a plane's looks; its disparity is given at its centre."""
    flatness = _waves(random, (0.01, 0.04), channels=1)
    return Plane(
        slope=slope,
        offset=disparity - slope[0] * centre[0] - slope[1] * centre[1],
        centre=centre,
        half=half,
        round=bool(random.random() < 0.5),
        colour=random.uniform(90, 165, 3),
        texture=_waves(random, (0.03, 0.3), channels=3),
        flatness=flatness,
        threshold=_threshold(flatness, options, centre, half),
    )


def _waves(random: np.random.Generator, band: tuple[float, float], channels: int) -> Waves:
    """Draw a noise whose frequencies lie in a band, cycles a pixel: sums of fewer than 0.5 survive sampling."""
    length = random.uniform(*band, _WAVES)
    angle = random.uniform(0, np.pi, _WAVES)
    frequencies = np.stack([length * np.cos(angle), length * np.sin(angle)], axis=1)
    weights = random.normal(0, _CONTRAST / math.sqrt(_WAVES / 4), (_WAVES, channels))
    return Waves(frequencies, random.uniform(0, 2 * np.pi, _WAVES), weights)


def _threshold(
    flatness: Waves, options: SyntheticOptions, centre: tuple[float, float], half: tuple[float, float]
) -> float:
    """Find the level below which the share asked for of the surface lies, on a grid over its bounding box."""
    if options.textureless == 0:
        return -math.inf
    frame = (options.width, options.height)
    x, y = (
        np.linspace(max(0.0, middle - reach), min(side, middle + reach), 64)
        for middle, reach, side in zip(centre, half, frame, strict=True)
    )
    columns, rows = np.meshgrid(x, y)
    level = float(np.quantile(flatness(columns, rows), options.textureless))
    return math.nextafter(level, math.inf) if options.textureless < 1 else math.inf


def _relight(image: Floats, lighting: float) -> Floats:
    """Light a view differently: gain ``1 - 0.3 s``, gamma ``1 + 0.6 s``, a gradient of ``40 s`` gray levels across."""
    if lighting == 0:
        return image
    gradient = 40 * lighting * np.linspace(-0.5, 0.5, image.shape[1])[:, np.newaxis]
    relit: Floats = 255 * (1 - 0.3 * lighting) * np.clip(image / 255, 0, 1) ** (1 + 0.6 * lighting) + gradient
    return relit


def _expose(image: Floats, noise: float, seed: list[int]) -> ImageArray:
    noisy = image + np.random.default_rng(seed).normal(0, noise, image.shape) if noise else image
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
