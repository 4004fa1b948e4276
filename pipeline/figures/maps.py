"""Figures of what has the image's rows and columns: images, truth, channels, disparities, confidence."""

from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import NONE, ORANGE, SKY, view_rgb
from semidense.pipeline.figures.drawing import (
    Scale,
    confidence_scale,
    disparity_scale,
    draw_classes,
    draw_map,
    image_panels,
    legend_below,
    none_patch,
    share_patch,
)
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.images_and_truth import MASK_KINDS
from semidense.pipeline.results.opening import recorded
from semidense.stages.transforms.declaration import ORDER

_VIEWS = ("left view (reference)", "right view")


def draw_images(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw both views side by side, with the mean and the deviation of their gray levels."""
    views = dataset["left"].values, dataset["right"].values
    axes = image_panels(figure, views[0].shape[:2], columns=2)[0]
    for each, view, name, (mean, std) in zip(axes, views, _VIEWS, dataset["moments"].values, strict=True):
        each.imshow(view_rgb(view))
        each.set_title(f"{name}: gray {mean:.0f} ± {std:.0f} of 255")


def draw_truth(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the true disparity, and which of its pixels both views see."""
    disparity, nonocc = dataset["disparity"].values, dataset["nonocc"].values.astype(bool)
    known = np.isfinite(disparity)
    left, right = image_panels(figure, disparity.shape, columns=2)[0]
    draw_map(left, disparity, disparity_scale(disparity, "true disparity (px)"))
    left.set_title("true disparity of the left view")
    draw_classes(right, np.where(nonocc, 2, known.astype(int)), (NONE, ORANGE, SKY))
    right.set_title(f"visibility; source of the mask: {MASK_KINDS[int(dataset['mask_kind'].values[0])]}")
    legend_below(
        figure,
        (
            none_patch(disparity, "truth unknown"),
            share_patch(known & ~nonocc, "known, hidden in the right view", ORANGE),
            share_patch(nonocc, "nonocc: known and seen in both views", SKY),
        ),
    )


def draw_channels(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw a grid: a row a channel, a column a view; both views of a channel share one scale."""
    channels = dataset["channels"].values  # view channel y x
    names = _channel_names(dataset)
    axes = image_panels(figure, channels.shape[2:], rows=len(names), columns=2)
    for row, (name, views) in enumerate(zip(names, channels.swapaxes(0, 1), strict=True)):
        scale = Scale(matplotlib.colormaps["gray"], float(views.min()), float(views.max()), f"{name} (pure number)")
        for column, (view, side) in enumerate(zip(views, _VIEWS, strict=True)):
            draw_map(axes[row, column], view, scale)
            axes[row, column].set_title(f"{name}, {side}")


def _channel_names(dataset: xr.Dataset) -> list[str]:
    """Return the names of the channels: those in use, as the product's settings tell."""
    count = dataset.sizes["channel"]
    names = list(recorded(dataset, "params").get("use", ORDER))
    return names if len(names) == count else [f"channel {index}" for index in range(count)]


def draw_disparity(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw a disparity map, with the share of pixels that have none."""
    disparity = dataset["disparity"].values
    axes = image_panels(figure, disparity.shape)[0, 0]
    draw_map(axes, disparity, disparity_scale(disparity))
    _tell_none(figure, disparity)


def _tell_none(figure: Figure, values: NDArray[Any]) -> None:
    """Tell the share of pixels without a value below a map; nothing where each pixel has one."""
    if not np.isfinite(values).all():
        legend_below(figure, (none_patch(values),))


def draw_confidence(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw a confidence map on a scale of log-odds."""
    confidence = dataset["confidence"].values
    axes = image_panels(figure, confidence.shape)[0, 0]
    draw_map(axes, confidence, confidence_scale())
    axes.set_title("probability that the disparity is right")
    _tell_none(figure, confidence)


def draw_any(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the maps of a product side by side, each on its own scale.

    Raises:
        UsageError: if no array has the image's rows and columns.
    """
    maps = [array for array in dataset.data_vars.values() if array.dims == ("y", "x")]
    if not maps:
        raise UsageError("this product has no map (y, x) to draw")
    height, width = maps[0].shape
    axes = image_panels(figure, (height, width), columns=len(maps))[0]
    for each, array in zip(axes, maps, strict=True):
        values = array.values.astype(np.float32)
        draw_map(each, values, disparity_scale(values, f"{array.name} ({array.attrs.get('units', '1')})"))
        lacking = float(np.mean(~np.isfinite(values)))
        told = f"; none: {100 * lacking:.1f} %" if lacking else ""
        each.set_title(f"{array.attrs.get('long_name', array.name)}{told}")
