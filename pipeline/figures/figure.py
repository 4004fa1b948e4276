"""A figure of any product, and the files they are saved to.

Matplotlib's objects are used directly: nothing here touches pyplot or any other state that callers share.
"""

from collections.abc import Callable, Mapping
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from semidense.pipeline.figures.calibration import draw_calibration
from semidense.pipeline.figures.colours import confidence_rgb, disparity_rgb, disparity_span
from semidense.pipeline.figures.cost_volume import draw_costs
from semidense.pipeline.figures.curves import error_curve_figure
from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.figures.maps import (
    draw_any,
    draw_channels,
    draw_confidence,
    draw_disparity,
    draw_images,
    draw_truth,
)
from semidense.pipeline.figures.metrics_table import draw_metrics
from semidense.pipeline.figures.survey import draw_alignment, draw_survey
from semidense.pipeline.figures.training import (
    draw_evaluation_samples,
    draw_foreign_samples,
    draw_matching_samples,
    draw_network,
)
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.opening import recorded

__all__ = [
    "confidence_rgb",
    "disparity_rgb",
    "disparity_span",
    "error_curve_figure",
    "figure",
    "product_title",
]

_DRAW: Mapping[str, Callable[..., None]] = {
    "images": draw_images,
    "truth": draw_truth,
    "survey": draw_survey,
    "alignment": draw_alignment,
    "channels": draw_channels,
    "matching_samples": draw_matching_samples,
    "matching_net": draw_network,
    "descriptor_net": draw_network,
    "costvolume": draw_costs,
    "disparity": draw_disparity,
    "evaluation_samples": draw_evaluation_samples,
    "evaluation_net": draw_network,
    "evidence_net": draw_network,
    "confidence": draw_confidence,
    "evidence_confidence": draw_confidence,
    "foreign_samples": draw_foreign_samples,
    "foreign_net": draw_network,
    "foreign_confidence": draw_confidence,
    "calibration": draw_calibration,
    "calibrated_confidence": draw_confidence,
    "semidense": draw_disparity,
    "right_disparity": draw_disparity,
    "aggregated": draw_disparity,
    "right_aggregated": draw_disparity,
    "refined": draw_disparity,
    "filled": draw_disparity,
    "ranking": draw_metrics,
    "metrics": draw_metrics,
    **dict.fromkeys(("sgm", "census", "sncc", "mc_cnn", "mc_cnn_accurate"), draw_disparity),
    **dict.fromkeys(("o1", "ccnn"), draw_confidence),
    **dict.fromkeys(("distinctiveness", "cost_margin"), draw_any),
    "ccnn_net": draw_network,
}
"""What draws each product that has a figure."""
_TOLD = {
    "channels": ("rank_window", "companion_window", "companion_rays"),
    "matching_samples": ("form", "samples"),
    "matching_net": ("head", "steps"),
    "descriptor_net": ("steps",),
    "costvolume": ("d_min", "d_max", "precision", "mode"),
    "disparity": ("subpixel",),
    "evaluation_samples": ("form", "samples", "tolerance"),
    "evaluation_net": ("steps",),
    "confidence": ("precision",),
    "calibration": ("folds",),
    "semidense": ("R", "density", "max_error"),
    "refined": ("left_right", "subpixel"),
}
"""The settings that a title tells."""
_SPOKEN = {"True": "on", "False": "off"}


def figure(
    product: str,
    dataset: xr.Dataset,
    *,
    title: str,
    pixel: tuple[int, int] | None = None,
    disparity: int | None = None,
    truth: xr.Dataset | None = None,
) -> Figure:
    """Return a figure of a product, with units on every axis and black for what has no value.

    Args:
        product: its name, such as ``semidense``.
        dataset: the product, as ``open_product`` gives it. Of a cost volume, slices are read alone.
        title: stands above, taken literally; ``product_title`` makes one.
        pixel: of a cost volume, row and column of the pixel whose curve is drawn; None for one near the centre.
        disparity: of a cost volume, the disparity of the slice, px; None for the usual one in the middle rows.
        truth: of a cost volume, the product ``truth`` of its scene, to be marked on the curve; None marks nothing.

    Raises:
        UsageError: if a product of another package has no map; if a pixel, disparity or truth is given for another
            product than a cost volume; if a pixel or disparity lies outside the volume.
    """
    draw = _DRAW.get(product, draw_any)
    options = {"pixel": pixel, "disparity": disparity, "truth": truth}
    chosen = {name: value for name, value in options.items() if value is not None}
    if chosen and product != "costvolume":
        raise UsageError(f"{product}: a {next(iter(chosen))} is chosen in a costvolume, not in this product")
    drawn = new_figure(title)
    draw(drawn, dataset, **chosen)
    return drawn


def product_title(dataset: xr.Dataset) -> str:
    """Return scene, product and the settings that matter of a cached product, from the provenance in its ``attrs``.

    >>> about = {"label": '{"scene": "Teddy", "product": "semidense"}', "params": '{"R": 0.9, "tiles": "128 rows"}'}
    >>> product_title(xr.Dataset(attrs=about))
    'Teddy: semidense (R 0.9)'
    """
    label = recorded(dataset, "label")
    product = label.get("product", "product")
    settings = _told(product, recorded(dataset, "params"))
    return f"{label.get('scene', 'no scene')}: {product}" + (f" ({settings})" if settings else "")


def _told(product: str, params: Mapping[str, Any]) -> str:
    if "shipped" in params:
        return "shipped weights"
    names = [name for name in _TOLD.get(product, ()) if params.get(name) is not None]
    names = [name for name in names if not (name == "R" and {"density", "max_error"} & set(names))]
    return ", ".join(f"{name.replace('_', ' ')} {_SPOKEN.get(str(params[name]), params[name])}" for name in names)
