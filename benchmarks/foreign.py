"""Our score of other matchers' maps: ``python -m benchmarks.foreign middlebury:DIR/MiddEval3/trainingQ``.

Each matcher's dense map is ordered by our score without and with the right view, and by the evaluation-Net alone: the
area under the error curve of each, and of a perfect order. Beside them is how many of the pixels that the matcher's own
checks keep are wrong, and how many of as many pixels, and of 70 %, that our score keeps. Pixels that both views see,
wrong above 1 px.
"""

import argparse
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import SceneSource, open_dataset
from semidense.pipeline.plan.images_and_truth import read_images
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.catalog import STAGES
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.foreign.confidence import compute_foreign_confidence
from semidense.stages.evaluation.evidence.foreign.declaration import MATCHERS, ForeignConfidenceParams
from semidense.stages.metrics.confidence import error_at_density
from semidense.stages.metrics.errors import Errors, counted
from semidense.stages.metrics.ranking import ranked
from semidense.stages.stage import Array
from semidense.stages.transforms.channels import channels

TOLERANCE = 1.0
DENSITY = 0.7
NETS = ("evaluation_net", "foreign_net", "descriptor_net")
COLUMNS = ("AUC net", "AUC left", "AUC both", "perfect", "checks %", "kept %", "left %", "both %", "left 70", "both 70")


def figures(scene: SceneSource, matcher: str, nets: Mapping[str, Any]) -> list[float]:
    """Return the figures of one map, in the order of ``COLUMNS``."""
    found = scene.load()
    truth, stage, given = found.truth, STAGES[matcher], {"images": read_images(scene, {})}
    if truth is None:
        return [np.nan] * len(COLUMNS)
    bounds = {"d_min": scene.disparities.minimum, "d_max": scene.disparities.maximum}
    made = stage.function()(stage.params.model_validate(bounds), given)
    checks = Errors.of(made["disparity"], truth.disparity, truth.nonocc)
    kept = 1 - checks.invalid() / 100
    block = _block(given["images"], made["dense"], channels(found.left, found.right), nets)
    scores = [_score(block, right) for right in (False, True)]
    areas = [
        ranked(made["dense"], score, truth.disparity, truth.nonocc)[TOLERANCE]
        for score in (scores[0]["network"], scores[0]["confidence"], scores[1]["confidence"])
    ]
    correct = Errors.of(made["dense"], truth.disparity, truth.nonocc).absolute <= TOLERANCE
    judged = [score["confidence"][counted(truth.disparity, truth.nonocc)] for score in scores]
    errors = [error_at_density(each, correct, share) for share in (kept, DENSITY) for each in judged]
    return [*(area["auc"] for area in areas), areas[0]["auc_optimal"], checks.bad(TOLERANCE), 100 * kept, *errors]


def _score(block: Mapping[str, Any], right: bool) -> Mapping[str, NDArray[np.float32]]:
    return {**compute_foreign_confidence(ForeignConfidenceParams(right=right, precision="bfloat16"), block)}  # type: ignore[arg-type]


def _block(images: Mapping[str, Array], disparity: Array, views: Array, nets: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the score is made from, as one tile with its context."""
    around = (RADIUS, RADIUS)
    return {
        "images": {"left": np.pad(images["left"], (around, around, (0, 0)), mode="edge"), "moments": images["moments"]},
        "disparity": {"disparity": np.pad(disparity, RADIUS, mode="edge")},
        "channels": {"channels": np.pad(views, ((0, 0), (0, 0), around, around), mode="edge")},
        **nets,
    }


def rows(dataset: str, matchers: list[str]) -> Iterator[tuple[str, str, list[float]]]:
    """Yield matcher, scene and figures."""
    nets = {name: read_network(shipped_weights(name, "exact"), {}) for name in NETS}
    for matcher in matchers:
        for scene in open_dataset(dataset).scenes:
            yield matcher, scene.name, figures(scene, matcher, nets)


def main() -> None:
    """Print a row a map, and the means of each matcher."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--matcher", action="append", choices=MATCHERS, help="may be repeated; default: all")
    given = parser.parse_args()
    print(f"{'':24}" + "".join(f"{name:>10}" for name in COLUMNS))
    by_matcher: dict[str, list[list[float]]] = {}
    for matcher, scene, found in rows(given.dataset, given.matcher or [*MATCHERS]):
        by_matcher.setdefault(matcher, []).append(found)
        print(_line(f"{matcher} {scene}", found), flush=True)
    for matcher, each in by_matcher.items():
        print(_line(f"{matcher}, mean", np.nanmean(each, axis=0)))


def _line(name: str, found: list[float] | NDArray[np.float64]) -> str:
    return f"{name:24}" + "".join(f"{value:10.4f}" for value in found)


if __name__ == "__main__":
    main()
