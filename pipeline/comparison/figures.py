"""Draw a comparison: a dot for each scene and method, and error against invalid pixels."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from numpy.typing import NDArray

from semidense.pipeline.comparison.experiments import Comparison
from semidense.pipeline.comparison.methods import MATCHERS
from semidense.pipeline.figures.colours import BLUE, QUIET, RED, disparity_rgb, disparity_span
from semidense.pipeline.figures.curves import draw_matchers
from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.results.metric_rows import FIGURES, METHOD, Row, mean_name, mean_rows, over_scenes
from semidense.stages.stage import Array, Arrays
from semidense.stages.transforms.gray import to_gray

_LETTERS = 7
"""Letters of an axis label in an inch of the figure, beside the names of the methods."""
_MARKED = (0.0, 0.5, 0.9, 0.99)
"""Values of R that are written beside the curve."""


def dots_figure(rows: Sequence[Row], figure: str, *, title: str, width: float = 9.5) -> Figure:
    """Return a figure with a line a method: a dot a scene, and a bar at their mean.

    Args:
        rows: of one experiment, mask and threshold; the first method is drawn at the top. Where they have an
            ``auc_optimal``, its mean is drawn as a line across. A method that lacks a scene has no bar: its mean could
            not be compared.
        figure: the key that is drawn.
        title: stands above.
        width: of the figure, inches.
    """
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    over = mean_name(len(scenes))
    means = {_escaped(row["method"]): row if row["scene"] == over else {} for row in mean_rows(rows)}
    drawn = new_figure(title)
    drawn.set_size_inches(width, 1.8 + 0.45 * len(means))
    axes = drawn.subplots()
    axes.barh(
        list(means),
        [row.get(figure, 0) for row in means.values()],
        color=QUIET,
        label=f"{over} scenes" if len(scenes) > 1 else scenes[0],
    )
    for method in means if len(scenes) > 1 else ():
        values = [row[figure] for row in rows if _escaped(row["method"]) == method and figure in row]
        axes.plot(values, [method] * len(values), "o", color=BLUE, markersize=4, label="a scene")
    optimal = next((row["auc_optimal"] for row in means.values() if "auc_optimal" in row), None)
    if optimal is not None:
        axes.axvline(optimal, color=RED, linestyle="--", label=f"{'mean ' * (len(scenes) > 1)}area of a perfect order")
    axes.invert_yaxis()
    shown, judged = FIGURES[figure], rows[0]
    unit = "" if shown.unit == "1" else f" ({shown.unit})"
    told = f"{shown.meaning}{unit}; mask {judged['mask']}, wrong above {judged['threshold_px']:g} px"
    axes.set(xlabel=fill(told, int(_LETTERS * width)), xlim=(0, None))
    axes.locator_params(axis="x", nbins=5)
    axes.grid(axis="x", alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    _literal(drawn.legend(*_first_of_each(handles, labels), loc="outside lower center", ncols=3, frameon=False))
    return drawn


def _escaped(name: str) -> str:
    return name.replace("$", r"\$")


def _literal(legend: Legend) -> None:
    """Take the names in a legend as they are: dollars make no mathematics of them."""
    for text in legend.get_texts():
        text.set_parse_math(False)


def _first_of_each(handles: Sequence[Any], labels: Sequence[str]) -> tuple[list[Any], list[str]]:
    first = dict(reversed(list(zip(labels, handles, strict=True))))
    return list(first.values()), list(first)


def density_figure(means: Sequence[Row]) -> Figure:
    """Return error against invalid pixels: our curve over R, a point each other matcher.

    Args:
        means: mean rows of one mask and threshold, of the experiments ``curve`` and ``density``. A matcher whose mean
            is over fewer scenes than our curve is left out.
    """
    drawn = new_figure("Error versus invalid pixels")
    drawn.set_size_inches(9.5, 6)
    axes = drawn.subplots()
    curve = [row for row in means if row["experiment"] == "curve" and "bad" in row]
    axes.plot([row["invalid"] for row in curve], [row["bad"] for row in curve], color=BLUE, linewidth=2)
    axes.lines[0].set_label(f"{METHOD}, over R")
    for row in curve:
        if row["R"] in _MARKED:
            place = row["invalid"], row["bad"]
            axes.plot(*place, ".", color=BLUE, markersize=9)
            axes.annotate(f"R = {row['R']:g}", place, xytext=(6, 6), textcoords="offset points", fontsize="small")
    judged = next((row for row in means if row["experiment"] == "curve"), means[0])
    mask, threshold, scenes = judged["mask"], judged["threshold_px"], judged["scene"]
    others = [row for row in means if row["experiment"] == "density" and "bad" in row and "R" not in row]
    draw_matchers(axes, [row for row in others if row["scene"] == scenes])
    axes.set_xlabel(f"invalid: {mask} pixels without a disparity (%), {over_scenes(judged)}")
    axes.set_ylabel(f"bad: reported {mask} pixels off by more than {threshold:g} px (%)")
    axes.margins(x=0.12)
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=-1)
    axes.grid(alpha=0.3)
    _literal(axes.legend(loc="upper right", frameon=False))
    return drawn


SCENES = 3
"""Scenes on a sheet, at most."""
_FLAT = 2
"""Gray levels between neighbours up to which a pixel counts as untextured."""
_WIDTH = 2.6
"""Width of a picture, inches."""


def sheets(found: Comparison) -> dict[str, Figure]:
    """Return two sheets by file name: the scenes whose views are lit most differently, and those of least texture.

    A lone scene has only ``texture.png``: the other would be the same.
    """
    images = {scene: found.images(scene) for scene in found.scenes}
    if len(images) == 1:
        return {"texture.png": _sheet(found, list(images), "Maps")}
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


def _sheet(found: Comparison, scenes: list[str], title: str) -> Figure:
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
        f"{METHOD} raw": products["disparity"]["disparity"],
        METHOD + (f", R = {R:g}" if R is not None else ""): products["semidense"]["disparity"],
        **{name: products[product]["disparity"] for name, product in MATCHERS.items() if product in products},
    }
    left = np.repeat(to_gray(products["images"]["left"])[..., np.newaxis], 3, axis=2)
    return {"left view": left} | {name: disparity_rgb(values, *span) for name, values in maps.items()}
