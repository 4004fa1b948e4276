"""A map as few pixels in colours, with a line that says what they mean."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from pipeline.views.colours import confidence_rgb, disparity_rgb, disparity_span
from pipeline.views.thinned import step_for

_PIXELS = 100_000
"""Of a map that a small picture is made from, about."""


class Small(NamedTuple):
    """A picture for a terminal: (y, x, 3) uint8, and its legend."""

    rgb: NDArray[np.uint8]
    legend: str


def small_picture(product: str, dataset: xr.Dataset) -> Small | None:
    """Return a small picture of a product; None for one that is no map of a scene.

    Args:
        product: its name.
        dataset: as ``pipeline.opening.open_product`` gives it; every n-th pixel is read.
    """
    maps = [name for name in ("disparity", "confidence") if name in dataset and dataset[name].dims == ("y", "x")]
    if product != "images" and not maps:
        return None
    step = step_for(dataset.sizes["y"], dataset.sizes["x"], _PIXELS)
    thin = dataset.isel(y=slice(None, None, step), x=slice(None, None, step))
    if product == "images":
        view = thin["left"].values
        eight = (view >> 8).astype(np.uint8) if view.dtype == np.uint16 else view
        return Small(np.broadcast_to(eight, (*eight.shape[:2], 3)), "left view")
    if maps[0] == "confidence":
        return Small(confidence_rgb(thin["confidence"].values), "confidence: blue 0, yellow 1, black none")
    return small_disparity(thin["disparity"].values)


def small_disparity(disparity: NDArray[np.float32]) -> Small:
    """Return a small picture of a disparity map (y, x), px; NaN is black, and its share told of the whole map."""
    height, width = disparity.shape
    step = step_for(height, width, _PIXELS)
    low, high = disparity_span(disparity)
    share = 100 * np.count_nonzero(np.isnan(disparity)) / max(disparity.size, 1)
    legend = f"disparity: blue {low:g} px (far), yellow {high:g} px (near), black none ({share:.1f} %)"
    return Small(disparity_rgb(disparity[::step, ::step], low, high), legend)
