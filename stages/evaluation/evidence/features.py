"""What is known of each pixel of a map by summed costs: what the costs say, and what the map looks like."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.precision import Precision
from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import MEANS, OF_MAP, OF_NEIGHBOURS
from semidense.stages.evaluation.evidence.of_map import compressed, middle, of_map
from semidense.stages.evaluation.evidence.windows import window_mean
from semidense.stages.stage import Images, Network, StageError

NAMES = (*OF_MAP, *FEATURES, *OF_NEIGHBOURS)
"""The order of the feature axis."""


def features(
    images: Images, disparity: Mapping[str, Any], evaluation_net: Network, precision: Precision
) -> NDArray[np.float32]:
    """Return the features of a map, of arrays with 50 px of context all round.

    Args:
        images: ``left`` (y + 100, x + 100, band) and ``moments``.
        disparity: ``disparity`` (y + 100, x + 100), px, and ``evidence`` (feature, y + 100, x + 100).
        evaluation_net: ``parameters``.
        precision: arithmetic of the evaluation-Net.

    Returns:
        (feature, y, x) float32, in the order of ``NAMES``, each as ``sign(v) ln(1 + |v|)``; 0 where nothing is known.

    Raises:
        StageError: if the map brings no evidence of costs.
    """
    if "evidence" not in disparity:
        raise StageError("the disparity map brings no evidence of its costs: set use.disparity=aggregated")
    evidence = disparity["evidence"].astype(np.float32)
    margin, difference, agrees = (
        evidence[FEATURES.index(name)] for name in ("aggregated_margin", "left_right", "agrees")
    )
    differs = np.where(np.isnan(difference), difference, difference > 1)
    around = margin, differs, agrees  # of the pixels that have a disparity: a hole beside them changes nothing
    means = [window_mean(each, side) for each in around for side in MEANS]
    from_map = of_map(images, disparity["disparity"], evaluation_net, precision)
    return compressed(np.concatenate([from_map, middle(evidence), means]))


def of_whole_map(
    images: Images, disparity: Mapping[str, Any], evaluation_net: Network, precision: Precision, rows: int = 0
) -> NDArray[np.float32]:
    """As ``features``, of arrays without context: beyond the image lies the nearest pixel, as in a tile.

    The result has so many ``rows`` more above and below.
    """
    above, beside = (RADIUS + rows, RADIUS + rows), (RADIUS, RADIUS)
    views: Images = {**images, "left": np.pad(images["left"], (above, beside, (0, 0)), mode="edge")}
    margins = {"disparity": (above, beside), "evidence": ((0, 0), above, beside)}
    padded = {name: np.pad(array, margins[name], mode="edge") for name, array in disparity.items()}
    return features(views, padded, evaluation_net, precision)
