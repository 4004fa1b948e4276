"""Products that are read, not computed: a scene's images and truth, and costs or a map that another matcher made.

They are cached like all others, so that every stage below reads from the cache alone, wherever it runs,
and a source file that changes makes stale exactly what depends on it. Their functions are given the
``SceneSource`` to read where those of the stages are given their settings.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.occlusion import left_right_check
from semidense.datasets.scene import SceneSource
from semidense.stages.stage import Array, Inputs, Output, Stage, StageError

MASK_KINDS = ("published", "left-right check", "warped truth", "exact", "non-occluded truth", "none")
"""Where a scene's non-occlusion mask comes from, in the order of the product's ``mask_kind``."""

IMAGES = Stage(
    product="images",
    inputs=(),
    outputs=(
        Output("left", ("y", "x", "band"), None, "1", "left view, the reference; 8 or 16 bits"),
        Output("right", ("y", "x", "band"), None, "1", "right view"),
        Output("moments", ("view", "moment"), "float64", "1", "mean and standard deviation of each view's 8-bit gray"),
    ),
    compute="semidense.pipeline.plan.images_and_truth:read_images",
)
TRUTH = Stage(
    product="truth",
    inputs=(),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "true disparity of the left view; NaN: unknown"),
        Output("nonocc", ("y", "x"), "bool", "1", "seen in both views, truth known"),
        Output("right_disparity", ("y", "x"), "float32", "px", "true disparity of the right view; NaN: unknown"),
        Output("right_nonocc", ("y", "x"), "bool", "1", "the same of the right view; all false: unknown"),
        Output("range", ("bound",), "int32", "px", "smallest and largest disparity of the scene"),
        Output("mask_kind", ("kind",), "int8", "1", "where nonocc comes from: index into " + ", ".join(MASK_KINDS)),
    ),
    compute="semidense.pipeline.plan.images_and_truth:read_truth",
)
COSTS = Stage(
    product="costvolume",
    inputs=(),
    outputs=(
        Output("cost", ("y", "x", "d"), "float16", "1", "cost of another matcher; lower is better, NaN: no such cell"),
        Output("d", ("d",), "int16", "px", "disparity"),
    ),
    compute="semidense.pipeline.plan.images_and_truth:read_costs",
)

EXTERNAL = Stage(
    product="disparity",
    inputs=(),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "disparity of another matcher; NaN: none"),),
    compute="semidense.pipeline.plan.images_and_truth:read_external",
)


@dataclass(frozen=True)
class Source:
    """A product that is read from a scene.

    Attributes:
        stage: its declaration.
        identity: names the content that it is read from, for the key.
        role: of the file without which it is not read but computed; None: it is always read.
        reader: module that reads it; empty: the scene's.
    """

    stage: Stage
    identity: Callable[[SceneSource], Mapping[str, Any]]
    role: str | None = None
    reader: str = ""


def _truth_identity(scene: SceneSource) -> dict[str, Any]:
    bounds = [scene.disparities.minimum, scene.disparities.maximum]
    return scene.truth_identity() | {"range": bounds}


def _costs_identity(scene: SceneSource) -> dict[str, Any]:
    return scene.identity(("costs",)) | {"d_min": scene.disparities.minimum}


def _map_identity(scene: SceneSource) -> dict[str, Any]:
    return scene.identity(("disparity",)) | {"reading": dict(scene.map_reading)}


SOURCES = {
    "images": Source(IMAGES, SceneSource.image_identity),
    "truth": Source(TRUTH, _truth_identity),
    "costvolume": Source(COSTS, _costs_identity, role="costs"),
    "disparity": Source(EXTERNAL, _map_identity, role="disparity", reader="semidense.datasets.pairs.map_files"),
}
"""By product."""


def source_of(product: str, scene: SceneSource) -> Source | None:
    """Return how a product of a scene is read; None if it is computed."""
    found = SOURCES.get(product)
    return found if found and (found.role is None or scene.has(found.role)) else None


def require_views(stage: Stage, scene: SceneSource | None) -> None:
    """Refuse to look at the right view of a scene that has none.

    Raises:
        StageError: if the stage does.
    """
    if scene and scene.one_view and "images" in stage.inputs and not stage.one_view:
        raise StageError(f"{scene.name}: {stage.product} needs the right view, which was not given")


def read_costs(scene: SceneSource, _: Inputs) -> dict[str, Array]:
    """Return the cost volume that came with a scene, without the cells that lie outside the right view."""
    cost, d = scene.load_costs(), np.arange(scene.disparities.minimum, scene.disparities.maximum + 1, dtype=np.int16)
    matched = np.arange(cost.shape[1])[:, None] - d  # column of the right view
    cost[:, (matched < 0) | (matched >= cost.shape[1])] = np.nan
    return {"cost": cost, "d": d}


def read_external(scene: SceneSource, _: Inputs) -> dict[str, Array]:
    """Return the disparity map that came with a scene."""
    return {"disparity": scene.load_map()}


def read_images(scene: SceneSource, _: Inputs) -> dict[str, Array]:
    """Return both views as (y, x, band), and the gray moments of each over the whole view."""
    from semidense.stages.transforms.gray import gray_moments, to_gray

    views = scene.load_images()
    left, right = (view.reshape(*view.shape[:2], -1) for view in views)
    return {"left": left, "right": right, "moments": np.array([gray_moments(to_gray(view)) for view in views])}


def read_truth(scene: SceneSource, _: Inputs) -> dict[str, Array]:
    """Return the ground truth of both views and the disparity range.

    Raises:
        StageError: if the scene has none.
    """
    found = scene.load_truth()
    if found is None:
        raise StageError(f"{scene.name} has no ground truth")
    right, right_nonocc = _right_truth(found.disparity, found.right)
    return {
        "disparity": found.disparity,
        "nonocc": found.nonocc,
        "right_disparity": right,
        "right_nonocc": right_nonocc,
        "range": np.array([scene.disparities.minimum, scene.disparities.maximum], np.int32),
        "mask_kind": np.array([MASK_KINDS.index(found.mask)], np.int8),
    }


def _right_truth(
    left: NDArray[np.float32], right: NDArray[np.float32] | None
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the right view's truth and what of it both views see: nothing where none is published."""
    if right is None:
        return np.full_like(left, np.nan), np.zeros(left.shape, bool)
    # Mirrored and exchanged, the right view is the left one of a rectified pair.
    return right, left_right_check(right[:, ::-1], left[:, ::-1])[:, ::-1]
