"""O1: a random forest over features of the raw disparity map alone, each found in constant time a pixel as published.

Source: Poggi & Mattoccia, "Learning a general-purpose confidence measure based on O(1) features and a smarter
aggregation strategy for semi global matching", 3DV 2016.
"""

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import O1_SIDES, Forest, ForestParams, Scored
from semidense.stages.baselines.learning import OfScenes, draw_pixels, labelled_scenes
from semidense.stages.compute.kernel import kernel
from semidense.stages.stage import DisparityMap, NoParams, StageError, require_shape

FEATURES = 5 * len(O1_SIDES)
"""Five features for each window."""


def o1_features(disparity: NDArray[np.float32], rows: NDArray[Any], columns: NDArray[Any]) -> NDArray[np.float32]:
    """Return O1's features of some pixels of a raw disparity map.

    For each window of side 5, 7, 9 and 11, cut at the border and without its unknown pixels: the share of the window
    that has the centre's disparity; minus the logarithm of the share of different disparities; the median, of
    an even number of values the upper middle one; the distance of the centre from it; the variance. Disparities count
    by whole pixels where they are compared.

    Args:
        disparity: (y, x) float32, px, NaN unknown.
        rows: (pixel,) integers.
        columns: (pixel,) integers.

    Returns:
        (pixel, 20) float32; all 0 where the centre is unknown.

    Raises:
        StageError: if the map has not two dimensions.
    """
    require_shape("disparity", disparity, 2)
    features = np.zeros((len(rows), FEATURES), np.float32)
    places = np.column_stack([rows, columns]).astype(np.int64)
    _describe(np.ascontiguousarray(disparity), places, np.array(O1_SIDES) // 2, features)
    return features


@kernel
def _describe(
    disparity: NDArray[np.float32], places: NDArray[np.int64], radii: NDArray[np.int64], features: NDArray[np.float32]
) -> None:
    for index in range(len(places)):
        y, x = places[index]
        centre = disparity[y, x]
        if np.isnan(centre):
            continue
        for scale in range(len(radii)):
            r = radii[scale]
            window = disparity[max(0, y - r) : y + r + 1, max(0, x - r) : x + r + 1].copy().ravel()
            known = np.sort(window[~np.isnan(window)])
            features[index, 5 * scale : 5 * scale + 5] = _features_of(known, centre)


@kernel
def _features_of(known: NDArray[np.float32], centre: np.float32) -> NDArray[np.float32]:
    """Return the five features of a window's sorted disparities."""
    agree, different = 0, 0
    last = np.float32(np.nan)
    for value in known:
        whole = np.rint(value)
        agree += whole == np.rint(centre)
        different += whole != last
        last = whole
    size = known.size
    median = known[size // 2]
    mean = known.mean()
    result = np.empty(5, np.float32)
    result[0] = agree / size
    result[1] = -np.log(different / size)
    result[2] = median
    result[3] = abs(centre - median)
    result[4] = ((known - mean) ** 2).mean()
    return result


def train_forest(params: ForestParams, inputs: OfScenes) -> Forest:
    """Train O1's forest on the raw maps of the training scenes; return it as flat arrays.

    Returns:
        ``root`` int32 (tree,); ``feature``, ``lower``, ``upper`` int32, ``threshold`` float64 and ``right`` float32
        (node,); see the declaration.

    Raises:
        StageError: if the training pixels are all right or all wrong.
    """
    from sklearn.ensemble import RandomForestClassifier

    scenes = labelled_scenes(inputs, params.tolerance)
    chosen = draw_pixels([labels for _, labels in scenes], params.samples, params.seed)
    features = np.concatenate(
        [o1_features(disparity, *places) for (disparity, _), places in zip(scenes, chosen, strict=True)]
    )
    labels = np.concatenate([labels[places] for (_, labels), places in zip(scenes, chosen, strict=True)])
    if len(np.unique(labels)) < 2:
        raise StageError("the training maps hold no wrong disparity, or no right one: there is nothing to tell apart")
    forest = RandomForestClassifier(params.trees, max_depth=params.depth, random_state=params.seed)
    return _flatten([each.tree_ for each in forest.fit(features, labels).estimators_])


def _flatten(trees: list[Any]) -> Forest:
    """Return scikit-learn's trees as arrays over all nodes; children are counted over all trees."""
    root = np.cumsum([0, *(tree.node_count for tree in trees[:-1])])
    shares = [tree.value[:, 0, 1] / tree.value[:, 0].sum(axis=1) for tree in trees]
    return {
        "root": root.astype(np.int32),
        "feature": np.concatenate([tree.feature for tree in trees]).astype(np.int32),
        "threshold": np.concatenate([tree.threshold for tree in trees]),
        "lower": _children([tree.children_left for tree in trees], root),
        "upper": _children([tree.children_right for tree in trees], root),
        "right": np.concatenate(shares).astype(np.float32),
    }


def _children(trees: list[NDArray[Any]], root: NDArray[Any]) -> NDArray[np.int32]:
    """Return the children of each tree's nodes, counted over all trees."""
    return np.concatenate([nodes + first for nodes, first in zip(trees, root, strict=True)]).astype(np.int32)


def forest_confidence(forest: Forest, features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean over the trees of the share of right disparities at the leaf that each sample reaches.

    Args:
        forest: as ``train_forest`` returns it.
        features: (sample, 20) float32.

    Returns:
        (sample,) float32 in [0, 1].
    """
    result = np.empty(len(features), np.float32)
    _descend(
        features,
        forest["root"],
        forest["feature"],
        forest["threshold"],
        forest["lower"],
        forest["upper"],
        forest["right"],
        result,
    )
    return result


@kernel
def _descend(
    features: NDArray[np.float32],
    root: NDArray[np.int32],
    feature: NDArray[np.int32],
    threshold: NDArray[np.float64],
    lower: NDArray[np.int32],
    upper: NDArray[np.int32],
    right: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    for sample in range(len(features)):
        total = 0.0
        for first in root:
            node = first
            while feature[node] >= 0:
                below = features[sample, feature[node]] <= threshold[node]
                node = lower[node] if below else upper[node]
            total += right[node]
        result[sample] = total / len(root)


class OfForest(TypedDict):
    """The raw map and the forest that scores it."""

    disparity: DisparityMap
    o1_forest: Forest


def compute_o1(_: NoParams, inputs: OfForest) -> Scored:
    """Compute the product ``o1``: NaN where there is no disparity."""
    disparity = inputs["disparity"]["disparity"]
    rows, columns = np.nonzero(np.isfinite(disparity))
    confidence = np.full(disparity.shape, np.nan, np.float32)
    confidence[rows, columns] = forest_confidence(inputs["o1_forest"], o1_features(disparity, rows, columns))
    return {"confidence": confidence}
