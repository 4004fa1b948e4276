"""The products ``aggregated`` and ``right_aggregated``: the disparity of least aggregated cost, and its evidence."""

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.aggregation.edges import smooth
from semidense.stages.disparity.aggregation.median import median
from semidense.stages.disparity.aggregation.strips import Strip, Volume, aggregate
from semidense.stages.disparity.aggregation.winner import NONE, v_fit, winner
from semidense.stages.disparity.declaration import AggregatedParams
from semidense.stages.disparity.evidence import FEATURES, evidence
from semidense.stages.disparity.right_view import right_costs
from semidense.stages.stage import CostVolume, Images, StageError
from semidense.stages.transforms.gray import to_gray


class MirroredRight:
    """The right view's cost volume, mirrored: rows are made of the left view's when they are read.

    Mirrored, the right view is the left one of a pair: its pixel ``x`` meets ``x - d``.
    """

    def __init__(self, left: Volume, d_min: int) -> None:
        self._left, self._d_min = left, d_min
        self.shape = left.shape

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Return the costs of some rows, (y, x, d)."""
        return right_costs(np.asarray(self._left[rows]), self._d_min)[:, ::-1]


class Aggregated(TypedDict):
    """The product ``aggregated``: (y, x) disparities in px, NaN: none; (feature, y, x) what the costs say of them."""

    disparity: NDArray[np.float32]
    evidence: NDArray[np.float16]


class OfCosts(TypedDict):
    """The views and the costs, which are read strip by strip."""

    images: Images
    costvolume: CostVolume


def compute_aggregated(params: AggregatedParams, inputs: OfCosts) -> Aggregated:
    """Compute the product ``aggregated``; see ``aggregate``, ``winner``, ``v_fit``, ``median`` and ``evidence``.

    Raises:
        StageError: if volume, coordinate ``d`` and view do not fit together.
    """
    return _maps(params, *_volume(inputs), to_gray(inputs["images"]["left"]))


def compute_right_aggregated(params: AggregatedParams, inputs: OfCosts) -> Aggregated:
    """Compute the product ``right_aggregated``: the same of the right view, by the same volume."""
    volume, d_min = _volume(inputs)
    made = _maps(params, MirroredRight(volume, d_min), d_min, to_gray(inputs["images"]["right"])[:, ::-1])
    return {
        "disparity": np.ascontiguousarray(made["disparity"][:, ::-1]),
        "evidence": np.ascontiguousarray(made["evidence"][..., ::-1]),
    }


def _volume(inputs: OfCosts) -> tuple[Volume, int]:
    """Return the volume, not read yet, and its smallest disparity."""
    volume, d = inputs["costvolume"]["cost"], np.asarray(inputs["costvolume"]["d"])
    if d.size == 0 or volume.shape[2:] != d.shape:
        raise StageError(f"the cost volume has shape {volume.shape}, its coordinate d {d.shape}: they must agree")
    return volume, int(d[0])


def _maps(params: AggregatedParams, volume: Volume, d_min: int, gray: NDArray[np.uint8]) -> Aggregated:
    """Return disparity and evidence, filled strip by strip; the evidence is that of the winner, before the median."""
    disparity = np.empty(gray.shape, np.float32)
    found = np.empty((len(FEATURES), *gray.shape), np.float16)
    for strip in aggregate(volume, smooth(gray), d_min, params):
        index = winner(strip)
        disparity[strip.rows] = _disparity(strip, index, params)
        found[:, strip.rows] = evidence(strip, index, params.paths)
    return {"disparity": median(disparity, params.median), "evidence": found}


def _disparity(strip: Strip, index: NDArray[np.int32], params: AggregatedParams) -> NDArray[np.float32]:
    """Return the disparity of each winner, refined if asked for, NaN where there is none."""
    whole = (index + strip.single.d_min).astype(np.float32)
    shift = v_fit(strip, index) if params.subpixel else np.float32(0)
    return np.where(index == NONE, np.float32(np.nan), whole + shift)
