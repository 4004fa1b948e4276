"""Sheets to look at: the maps of several methods side by side, on the scenes that are hardest in one way."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.views.colours import disparity_rgb, disparity_span
from pipeline.views.panels import new_figure
from stages.stage import Array, Arrays
from stages.transforms.gray import to_gray

if TYPE_CHECKING:
    from pipeline.comparison import Comparison

SCENES = 3
"""Scenes on a sheet, at most."""
_OTHERS = {
    "sgm": "SGM",
    "sncc": "SNCC",
    "census": "census",
    "mc_cnn": "MC-CNN fast",
    "mc_cnn_accurate": "MC-CNN accurate",
}
_FLAT = 2
"""Gray levels between neighbours up to which a pixel counts as untextured."""
_WIDTH = 2.6
"""Width of a picture, inches."""


def sheets(found: "Comparison") -> dict[str, Figure]:
    """Return two sheets by file name: the scenes whose views are lit most differently, and those of least texture."""
    images = {scene: found.images(scene) for scene in found.scenes}
    return {
        "lighting.png": _sheet(found, _hardest(images, "lighting"), "Views lit most differently"),
        "texture.png": _sheet(found, _hardest(images, "texture"), "Least texture"),
    }


def _hardest(images: Mapping[str, Arrays], kind: str) -> list[str]:
    measure = {"lighting": lighting_difference, "texture": untextured_share}[kind]
    return sorted(images, key=lambda scene: -measure(images[scene]))[:SCENES]


def lighting_difference(images: Arrays) -> float:
    """Return how much the mean gray of the two views differs, in gray levels."""
    left, right = images["moments"][:, 0]
    return float(abs(left - right))


def untextured_share(images: Arrays) -> float:
    """Return the share of pixels whose gray differs from the next one's in both directions by at most 2 levels."""
    gray = to_gray(images["left"]).astype(np.int16)
    across, down = np.abs(np.diff(gray, axis=1))[:-1], np.abs(np.diff(gray, axis=0))[:, :-1]
    return float(np.mean((across <= _FLAT) & (down <= _FLAT)))


def _sheet(found: "Comparison", scenes: list[str], title: str) -> Figure:
    """Return a figure with a row a scene: view, truth, raw map, semi-dense map, the others' maps."""
    arrays = {scene: found.arrays(scene) for scene in scenes}
    rows = {scene: _pictures(products, found.R) for scene, products in arrays.items()}
    names = list(next(iter(rows.values())))
    height, width = next(iter(rows.values()))[names[0]].shape[:2]
    drawn = new_figure(f"{title}; blue: far, yellow: near, black: no disparity")
    drawn.set_size_inches(_WIDTH * len(names) + 0.5, len(rows) * (_WIDTH * height / width + 0.1) + 0.6)
    panels = drawn.subplots(len(rows), len(names), squeeze=False)
    for panel_row, (scene, pictures) in zip(panels, rows.items(), strict=True):
        for axes, (name, picture) in zip(panel_row, pictures.items(), strict=True):
            axes.imshow(picture, interpolation="nearest")
            axes.set(xticks=[], yticks=[], title=name if scene == scenes[0] else "")
        low, high = disparity_span(arrays[scene]["truth"]["disparity"])
        panel_row[0].set_ylabel(f"{scene}\n{low:g} to {high:g} px", parse_math=False)
    return drawn


def _pictures(products: Mapping[str, Arrays], R: float | None) -> dict[str, NDArray[np.uint8]]:
    """Return a scene's pictures by name; all disparities in the colours of the truth's range."""
    truth = products["truth"]["disparity"]
    span = disparity_span(truth)
    maps: dict[str, Array] = {
        "truth": truth,
        "dual-cnn raw": products["disparity"]["disparity"],
        "dual-cnn" + (f", R = {R:g}" if R is not None else ""): products["semidense"]["disparity"],
        **{name: products[product]["disparity"] for product, name in _OTHERS.items() if product in products},
    }
    left = np.repeat(to_gray(products["images"]["left"])[..., np.newaxis], 3, axis=2)
    return {"left view": left} | {name: disparity_rgb(values, *span) for name, values in maps.items()}
