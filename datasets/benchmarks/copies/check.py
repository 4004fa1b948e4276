"""Check a scene of a copy: that it loads, that its truth lies in its range, and that it is the truth of its images."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from semidense.datasets.benchmarks.copies.consistency import best_scale, fits
from semidense.datasets.errors import DatasetError
from semidense.datasets.scene import DisparityRange, Scene, SceneSource, Truth


@dataclass(frozen=True)
class Checked:
    """What was found in a scene.

    Attributes:
        scene: its name.
        problems: what is wrong, a line each; none for a sound scene.
        size: rows and columns.
        truth: whether there is one; the following are None without.
        known: share of the pixels whose truth is known, 0 to 1.
        visible: share of those that both views see, 0 to 1.
        least: the smallest true disparity, px.
        largest: the largest.
        fit: mean correlation of the views at the truth, -1 to 1.
        scale: the multiple of the truth that fits best; 1 for a sound scene.
    """

    scene: str
    problems: tuple[str, ...]
    size: tuple[int, int]
    truth: bool = False
    known: float | None = None
    visible: float | None = None
    least: float | None = None
    largest: float | None = None
    fit: float | None = None
    scale: float | None = None
    warnings: tuple[str, ...] = field(default=())


def check_scene(source: SceneSource) -> Checked:
    """Load a scene and check it; what is wrong with it is told, not raised."""
    try:
        scene = source.load()
    except DatasetError as error:
        return Checked(source.name, (str(error),), source.size, source.has_truth)
    if scene.truth is None:
        return Checked(source.name, (), source.size, warnings=source.warnings)
    return _check_truth(source, scene, scene.truth)


def _check_truth(source: SceneSource, scene: Scene, truth: Truth) -> Checked:
    known = ~np.isnan(truth.disparity)
    if not known.any():
        return Checked(source.name, ("the truth is unknown everywhere",), source.size, truth=True)
    found = fits(scene, truth)
    least, largest, scale = float(np.nanmin(truth.disparity)), float(np.nanmax(truth.disparity)), best_scale(found)
    return Checked(
        source.name,
        (*_range_problems(least, largest, source.disparities), *_fit_problems(found, scale)),
        source.size,
        truth=True,
        known=float(known.mean()),
        visible=float(truth.nonocc.sum() / known.sum()),
        least=least,
        largest=largest,
        fit=found[1.0],
        scale=scale,
        warnings=source.warnings,
    )


def _range_problems(least: float, largest: float, searched: DisparityRange) -> Iterator[str]:
    if least < searched.minimum or largest > searched.maximum:
        yield (
            f"the truth reaches from {least:.4g} to {largest:.4g} px, but {searched.minimum} to {searched.maximum} px "
            "are searched"
        )


def _fit_problems(found: dict[float, float], scale: float) -> Iterator[str]:
    if np.isnan(found[1.0]):
        yield "no pixel of the truth is seen by both views: whether it is of these images cannot be told"
    elif scale != 1:
        what = "its mirror image" if scale == -1 else f"{scale:g} times the truth"
        yield (
            f"{what} carries the right view onto the left one better (correlation {found[scale]:.2f}) than the truth "
            f"itself ({found[1.0]:.2f}): the scale or the direction of the truth is wrong, or the views are swapped"
        )
