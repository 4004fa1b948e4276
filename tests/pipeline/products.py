"""Every product of a 4 x 6 image with the disparities 0 to 4, made by hand."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from semidense.stages.evaluation.calibration.declaration import BINS
from semidense.stages.evaluation.calibration.table import EDGES, probability
from semidense.stages.metrics.errors import THRESHOLDS
from semidense.stages.metrics.ranking import RANKED
from semidense.stages.metrics.stage import FIGURES

N = np.nan
DISPARITY = np.array(
    [[N, 1, 1, 2, 2, 2], [N, 1, 1, 2, 2, 2], [0, 1, 3, 3, 4, 4], [0, 1, 3, 3, 4, 4]],
    np.float32,
)
CURVE = np.array([3, 1, 2, -1, 0], np.float16)
"""Costs of every pixel: the winner is 3 px, the runner-up minimum 1 px."""


def images() -> xr.Dataset:
    view = np.arange(72, dtype=np.uint8).reshape(4, 6, 3)
    return xr.Dataset(
        {
            "left": (("y", "x", "band"), view),
            "right": (("y", "x", "band"), view[:, ::-1]),
            "moments": (("view", "moment"), np.array([[36.0, 20.0], [35.0, 21.0]])),
        }
    )


def truth() -> xr.Dataset:
    nonocc = np.isfinite(DISPARITY)
    nonocc[3] = False
    return xr.Dataset(
        {
            "disparity": (("y", "x"), DISPARITY),
            "nonocc": (("y", "x"), nonocc),
            "mask_kind": ("kind", np.array([3], np.int8)),
        }
    )


def channels() -> xr.Dataset:
    values = np.linspace(-1, 1, 2 * 3 * 4 * 6, dtype=np.float32).reshape(2, 3, 4, 6)
    return xr.Dataset({"channels": (("view", "channel", "y", "x"), values)})


def alignment() -> xr.Dataset:
    return xr.Dataset(
        {
            "rows": ("y", np.linspace(-0.1, 0.1, 4, dtype=np.float32)),
            "columns": ("x", np.linspace(0.2, 0.4, 6, dtype=np.float32)),
            "offsets": (("match", "place"), np.float32([[1, 2, 0.3], [3, 4.5, 0.4], [0, 1, 0.1]])),
        }
    )


def matching_samples() -> xr.Dataset:
    truth = np.tile(np.array([[1, 2, N], [1, 3, 3]], np.float32), (8, 1, 1))
    return xr.Dataset(
        {
            "scene": ("sample", np.arange(8, dtype=np.int32) % 2),
            "mirrored": ("sample", np.arange(8) < 3),
            "disparities": (("sample", "slot"), np.tile(np.array([1, 3, 0], np.int32), (8, 1))),
            "truth": (("sample", "row", "column"), truth),
        }
    )


def evaluation_samples() -> xr.Dataset:
    labels = np.tile(np.array([[1, 0, -1, 1], [1, 1, 1, 1]], np.int8), (7, 1, 1))
    return xr.Dataset(
        {
            "scene": ("sample", np.arange(7, dtype=np.int32) % 3),
            "labels": (("sample", "row", "column"), labels),
        }
    )


def foreign_samples() -> xr.Dataset:
    return xr.Dataset(
        {
            "kind": ("crop", np.repeat(np.arange(4, dtype=np.int8), 2)),
            "error": (("crop", "row", "column"), np.tile(np.float32([[0, 0.5, np.nan], [1, 2, 9]]), (8, 1, 1))),
        }
    )


def network() -> xr.Dataset:
    return xr.Dataset(
        {
            "parameters": ("parameter", np.linspace(-1, 1, 101, dtype=np.float32)),
            "loss": ("step", np.linspace(0.7, 0.1, 80, dtype=np.float32)),
        }
    )


def shipped() -> xr.Dataset:
    return network().assign_attrs(params='{"shipped": "0123"}')


def costvolume() -> xr.Dataset:
    cost = np.tile(CURVE, (4, 6, 1))
    for disparity in range(5):
        cost[:, :disparity, disparity] = N
    return xr.Dataset({"cost": (("y", "x", "d"), cost)}, coords={"d": np.arange(5, dtype=np.int16)})


def disparity() -> xr.Dataset:
    return xr.Dataset({"disparity": (("y", "x"), DISPARITY)})


def confidence() -> xr.Dataset:
    return xr.Dataset({"confidence": (("y", "x"), np.linspace(0, 1, 24, dtype=np.float32).reshape(4, 6))})


def calibration() -> xr.Dataset:
    pixels = 200 * np.ones((3, BINS), np.int64)
    wrong = np.round(pixels * (1 - probability((EDGES[1:] + EDGES[:-1]) / 2))).astype(np.int64)
    return xr.Dataset(
        {
            "right": (("scene", "bin"), pixels - wrong),
            "wrong": (("scene", "bin"), wrong),
            "score": ("map", [0.1234, 0.1112, 0.1199]),
            "log_odds": ("edge", 0.8 * EDGES - 0.1),
            "tolerance": ("all", [1.0]),
        }
    )


def metrics() -> xr.Dataset:
    figures = {name: (("mask", "threshold"), np.full((2, 4), 12.5)) for name in FIGURES}
    figures["pixels"] = (("mask", "threshold"), np.full((2, 4), 1234))
    figures["bad"] = (("mask", "threshold"), np.full((2, 4), N))
    return xr.Dataset(figures, coords={"threshold": list(THRESHOLDS)})


def ranking() -> xr.Dataset:
    return metrics()[list(RANKED)]


def survey() -> xr.Dataset:
    matches = np.array([[1, 4, 2, 0], [2, 3, 1, 0], [2, 4, 2, 1]], np.float32)
    return xr.Dataset(
        {
            "matches": (("match", "field"), matches),
            "range": ("bound", np.array([0, 4], np.float32)),
            "step": ("all", np.array([1], np.int32)),
            "left": (("row", "column"), np.arange(24, dtype=np.uint8).reshape(4, 6)),
        }
    )


def distinctiveness() -> xr.Dataset:
    silent = np.linspace(0, 2, 24, dtype=np.float32).reshape(4, 6)
    return xr.Dataset({view: (("y", "x"), silent, {"long_name": f"{view} view"}) for view in ("left", "right")})


def evidence_samples() -> xr.Dataset:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(20, 14)).astype(np.float32)
    error = rng.exponential(size=20).astype(np.float32)
    return xr.Dataset({"features": (("pixel", "feature"), features), "error": ("pixel", error)})


def cost_margin() -> xr.Dataset:
    margin = np.where(np.isnan(DISPARITY), N, 2).astype(np.float32)
    return xr.Dataset({"margin": (("y", "x"), margin, {"long_name": "margin", "units": "log-odds"})})


PRODUCTS: dict[str, Callable[[], xr.Dataset]] = {
    "images": images,
    "truth": truth,
    "survey": survey,
    "alignment": alignment,
    "channels": channels,
    "matching_samples": matching_samples,
    "matching_net": network,
    "descriptor_net": network,
    "costvolume": costvolume,
    "disparity": disparity,
    "evaluation_samples": evaluation_samples,
    "evaluation_net": shipped,
    "distinctiveness": distinctiveness,
    "cost_margin": cost_margin,
    "evidence_samples": evidence_samples,
    "evidence_net": shipped,
    "confidence": confidence,
    "evidence_confidence": confidence,
    "foreign_samples": foreign_samples,
    "foreign_net": shipped,
    "foreign_confidence": confidence,
    "calibration": calibration,
    "calibrated_confidence": confidence,
    "semidense": disparity,
    "right_disparity": disparity,
    "aggregated": disparity,
    "right_aggregated": disparity,
    "refined": disparity,
    "filled": disparity,
    "ranking": ranking,
    "metrics": metrics,
}
