"""Our score of other matchers' maps: ``python -m benchmarks.foreign middlebury:DIR/trainingQ --pandora MAPS``.

Each matcher's dense map is ordered by our score without and with the right view, by the evaluation-Net alone, by the
difference to the matcher's map of the right view, and Pandora's maps by its own ambiguity and risk: the area under the
error curve of each, and of a perfect order. Beside them is how many of the pixels that the matcher's own checks keep
are wrong, and how many of as many pixels, and of 70 %, that our score keeps and that a perfect order would. Pixels that
both views see, wrong above 1 px. MAPS is what ``python -m benchmarks.pandora`` wrote; without it Pandora is left out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.harness import as_command
from semidense.datasets import SceneSource, Truth, open_dataset, read_pfm
from semidense.pipeline.plan.images_and_truth import read_images
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.catalog import STAGES
from semidense.stages.compute.precision import resolve
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import REACH
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
PANDORA = "pandora"
MEASURES = ("net", "left", "both", "views", "ambiguity", "risk")
COLUMNS = (*MEASURES, "perfect", "checks %", "kept %", "left %", "both %", "left 70", "both 70", "least 70")
"""Areas under the error curve first: of the evaluation-Net alone, our score with the left view and with both, the
difference between the matcher's maps of both views, Pandora's two measures, a perfect order."""


@dataclass(frozen=True)
class Matched:
    """A matcher's map of a scene.

    Attributes:
        dense: (y, x) float32, px, before its checks.
        checked: the same after them.
        measures: (y, x) float32 by name, of ``MEASURES``: confidences of its own, higher is surer.
    """

    dense: NDArray[np.float32]
    checked: NDArray[np.float32]
    measures: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


def matched(scene: SceneSource, matcher: str) -> Matched:
    """Return the map of one of ``MATCHERS``, and how well it agrees with its map of the right view."""
    stage = STAGES[matcher]
    bounds = {"d_min": scene.disparities.minimum, "d_max": scene.disparities.maximum}
    params, images = stage.params.model_validate(bounds), read_images(scene, {})
    made = stage.function()(params, {"images": images})
    # Mirrored, the right view is a left one.
    swapped = {"left": images["right"][:, ::-1], "right": images["left"][:, ::-1], "moments": images["moments"][::-1]}
    of_right = stage.function()(params, {"images": swapped})["dense"][:, ::-1]
    return Matched(made["dense"], made["disparity"], {"views": -_difference(made["dense"], of_right)})


def _difference(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the difference to the disparity that the right view has where each disparity leads; infinite: none."""
    rows, columns = np.indices(left.shape)
    seen = np.rint(columns - np.nan_to_num(left)).astype(np.intp)
    inside = (seen >= 0) & (seen < left.shape[1])
    there = right[rows, np.clip(seen, 0, left.shape[1] - 1)]
    found: NDArray[np.float32] = np.nan_to_num(np.where(inside, np.abs(left - there), np.nan), nan=np.inf)
    return found


def read_pandora(scene: SceneSource, folder: Path) -> Matched:
    """Return Pandora's map of a scene and its two confidences, as ``benchmarks.pandora`` wrote them."""
    start = folder / scene.name.rsplit("/", 1)[-1]
    measures = {name: np.load(f"{start}.{name}.npy") for name in ("ambiguity", "risk")}
    return Matched(read_pfm(Path(f"{start}.pfm")), read_pfm(Path(f"{start}.checked.pfm")), measures)


def figures(scene: SceneSource, found: Matched, nets: Mapping[str, Any]) -> list[float]:
    """Return the figures of one map, in the order of ``COLUMNS``; NaN: the matcher has no such measure."""
    loaded = scene.load()
    if loaded.truth is None:
        return [np.nan] * len(COLUMNS)
    block = _block(read_images(scene, {}), found.dense, channels(loaded.left, loaded.right), nets)
    left, both = (_score(block, right) for right in (False, True))
    measures = {"net": left["network"], "left": left["confidence"], "both": both["confidence"], **found.measures}
    return [*_areas(loaded.truth, found.dense, measures), *_filtered(loaded.truth, found, left, both)]


def _areas(truth: Truth, dense: NDArray[np.float32], measures: Mapping[str, NDArray[np.float32]]) -> Iterator[float]:
    """Yield the area under the error curve by each of ``MEASURES``, and by a perfect order."""
    areas = {name: ranked(dense, each, truth.disparity, truth.nonocc)[TOLERANCE] for name, each in measures.items()}
    yield from (areas[name]["auc"] if name in areas else np.nan for name in MEASURES)
    yield areas["net"]["auc_optimal"]


def _filtered(truth: Truth, found: Matched, *scores: Mapping[str, NDArray[np.float32]]) -> Iterator[float]:
    """Yield what is wrong, %, of what the matcher's checks keep, and of as many and 70 % that a score keeps."""
    checks = Errors.of(found.checked, truth.disparity, truth.nonocc)
    kept = 1 - checks.invalid() / 100
    yield from (checks.bad(TOLERANCE), 100 * kept)
    correct = Errors.of(found.dense, truth.disparity, truth.nonocc).absolute <= TOLERANCE
    judged = [score["confidence"][counted(truth.disparity, truth.nonocc)] for score in scores]
    yield from (error_at_density(each, correct, share) for share in (kept, DENSITY) for each in judged)
    yield error_at_density(correct.astype(np.float32), correct, DENSITY)


def _score(block: Mapping[str, Any], right: bool) -> Mapping[str, NDArray[np.float32]]:
    params = ForeignConfidenceParams(right=right, precision=resolve("auto"))
    return {**compute_foreign_confidence(params, block)}  # type: ignore[arg-type]


def _block(images: Mapping[str, Array], disparity: Array, views: Array, nets: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the score is made from, as one tile with its context."""
    around = (RADIUS + REACH, RADIUS + REACH)
    return {
        "images": {"left": np.pad(images["left"], (around, around, (0, 0)), mode="edge"), "moments": images["moments"]},
        "disparity": {"disparity": np.pad(disparity, around, mode="edge")},
        "channels": {"channels": np.pad(views, ((0, 0), (0, 0), around, around), mode="edge")},
        **nets,
    }


def rows(dataset: str, matchers: list[str], pandora: Path | None) -> Iterator[tuple[str, str, list[float]]]:
    """Yield matcher, scene and figures."""
    nets = {name: read_network(shipped_weights(name, "exact"), {}) for name in NETS}
    for matcher in matchers:
        for scene in open_dataset(dataset).scenes:
            found = read_pandora(scene, pandora) if pandora and matcher == PANDORA else matched(scene, matcher)
            yield matcher, scene.name, figures(scene, found, nets)


def main(
    dataset: Annotated[str, typer.Argument(help="such as middlebury:DIR/MiddEval3/trainingQ")],
    matcher: Annotated[list[str] | None, typer.Option(help=f"{', '.join((*MATCHERS, PANDORA))}; default: all")] = None,
    pandora: Annotated[Path | None, typer.Option(help="folder that benchmarks.pandora wrote")] = None,
) -> None:
    """Print a row a map, and the means of each matcher."""
    chosen = matcher or [*MATCHERS, *([PANDORA] if pandora else [])]
    if unknown := set(chosen) - {*MATCHERS, PANDORA}:
        raise typer.BadParameter(f"no matcher is called {min(unknown)}: choose from {', '.join((*MATCHERS, PANDORA))}")
    if PANDORA in chosen and not pandora:
        raise typer.BadParameter("--matcher pandora needs its maps: --pandora FOLDER")
    print(f"{'':24}" + "".join(f"{name:>10}" for name in COLUMNS))
    by_matcher: dict[str, list[list[float]]] = {}
    for name, scene, found in rows(dataset, chosen, pandora):
        by_matcher.setdefault(name, []).append(found)
        print(_line(f"{name} {scene}", found), flush=True)
    for name, each in by_matcher.items():
        print(_line(f"{name}, mean", np.mean(each, axis=0)))


def _line(name: str, found: list[float] | NDArray[np.float64]) -> str:
    return f"{name:24}" + "".join(f"{value:10.4f}" for value in found)


if __name__ == "__main__":
    as_command(main)
