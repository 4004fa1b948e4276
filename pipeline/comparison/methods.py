"""The other matchers and the confidence measures that are compared, and the rows of each."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.comparison.rows import Judged, Row, auc_rows, density_rows, equal_density
from semidense.stages.stage import Arrays

MATCHERS = {
    "SGM (OpenCV SGBM)": "sgm",
    "SNCC": "sncc",
    "census": "census",
    "MC-CNN fast": "mc_cnn",
    "MC-CNN accurate": "mc_cnn_accurate",
}
"""Other matchers, by name: their products have a ``dense`` map, and a ``disparity`` after their own checks."""
LOWERED = "MC-CNN accurate, 0.5 px subtracted"
"""MC-CNN's accurate weights give disparities about 0.5 px too high, which decides many errors above 1 px."""
MEASURES = {
    "this confidence": ("confidence", "confidence"),
    "evaluation-Net": ("confidence", "network"),
    "agreement": ("confidence", "agreement"),
    "APKR": ("cost_confidence", "apkr"),
    "O1": ("o1", "confidence"),
    "CCNN": ("ccnn", "confidence"),
    "left-right difference": ("cost_confidence", "lrd"),
    "PKRN": ("cost_confidence", "pkrn"),
    "cost": ("cost_confidence", "msm"),
}
"""Confidence measures of the raw map, by name: product and array. The first is that of the configuration."""


def ours(products: Mapping[str, Arrays]) -> dict[str, NDArray[np.float32]]:
    """Return what our method has to say of a scene, by name."""
    return {name: products[name][name] for name in ("disparity", "confidence")}


def matcher_rows(judged: Judged, products: Mapping[str, Arrays]) -> Iterator[Row]:
    """Yield what the other matchers' semi-dense maps do, and our error at the density of each.

    Args:
        judged: the scene.
        products: ``disparity``, ``confidence`` and those of the matchers that are there, by name.
    """
    for method, product in MATCHERS.items():
        if product in products:
            rows = density_rows(judged, method, products[product]["disparity"])
            yield from equal_density(rows, judged, ours(products))


def measure_rows(judged: Judged, products: Mapping[str, Arrays]) -> Iterator[Row]:
    """Yield the area under the error curve of each confidence measure of the raw map.

    Args:
        judged: the scene.
        products: ``disparity`` and those of the measures that are there, by name.
    """
    for method, (product, array) in MEASURES.items():
        if product in products:
            yield from auc_rows(judged, method, products[product][array], products["disparity"]["disparity"])
