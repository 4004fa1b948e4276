"""Our score of each kind of map that it learnt from: ``python -m benchmarks.kinds middlebury:DIR``.

``make foreign`` makes the same crops of the training scenes. They are divided into three parts, siblings together, and
each part is scored by a net that learnt from the other two. The area under the error curve (AUC) is that of all crops
of a kind in a scene, hidden pixels too, wrong above 1 px; the mean over the scenes. Beside our score without and with
the right view are the evaluation-Net alone, which has seen these scenes, and a perfect order.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.harness import as_command, write
from semidense.pipeline.api import Task, run
from semidense.pipeline.plan.training_split import assign_folds
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import REACH
from semidense.stages.evaluation.evidence.foreign.declaration import KINDS, OF_CELLS, ForeignNetParams
from semidense.stages.evaluation.evidence.foreign.train import train_foreign_net
from semidense.stages.evaluation.evidence.of_map import NETWORK
from semidense.stages.metrics.confidence import auc, optimal_auc

PARTS = 3
SHIPPED = 'training.shipped=["matching_net", "descriptor_net", "evaluation_net"]'
COLUMNS = ("wrong %", "net", "left", "both", "perfect")

Crops = Mapping[str, NDArray[Any]]


def main(
    dataset: Annotated[str, typer.Argument(help="the training scenes, such as middlebury:DIR")],
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
) -> None:
    """Print and write the figures of each kind, and their mean."""
    task = Task(dataset, cache=cache, settings=["costvolume.mode=fast", SHIPPED, *(setting or ())], train=True)
    params = task.configuration().of("foreign_net", ForeignNetParams)
    made = run(task, "foreign_net")
    keys = {each.step.scene: each.key for each in made.made.values() if each.step.product == "foreign_samples"}
    scenes = {name: {k: v[...] for k, v in made.store.arrays(key).items()} for name, key in sorted(keys.items())}
    parts = dict(zip(scenes, assign_folds(list(scenes), PARTS), strict=True))
    figures: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    for part in range(PARTS):
        learnt = [crops for name, crops in scenes.items() if parts[name] != part]
        parameters = train_foreign_net(params, {"foreign_samples": learnt})["parameters"]  # type: ignore[typeddict-item]
        for name in (name for name in scenes if parts[name] == part):
            for kind, row in zip(KINDS, _figures(scenes[name], parameters, params.tolerance), strict=True):
                figures[kind].append(row)
    means = {kind: np.mean(rows, axis=0).tolist() for kind, rows in figures.items()}
    means["mean"] = np.mean(list(means.values()), axis=0).tolist()
    write("kinds", {"scenes": list(scenes), "columns": COLUMNS, "means": means})
    print(f"{'':34}" + "".join(f"{column:>10}" for column in COLUMNS))
    for kind, row in means.items():
        print(f"{kind:34}" + "".join(f"{value:10.4f}" for value in row))


def _figures(crops: Crops, parameters: NDArray[np.float32], tolerance: float) -> Iterator[list[float]]:
    """Yield the figures of each kind of map of a scene, in the order of ``COLUMNS``."""
    for kind in range(len(KINDS)):
        chosen = crops["kind"] == kind
        known, error = crops["features"][chosen].astype(np.float32), crops["error"][chosen]
        judged = np.isfinite(error)
        right = error[judged] <= tolerance
        alone = known.copy()
        alone[:, -len(OF_CELLS) :] = 0
        net = known[:, NETWORK, REACH:-REACH]
        left, both = (np.stack([weigh(parameters, crop) for crop in each]) for each in (alone, known))
        areas = [auc(order[judged], right) for order in (net, left, both)]
        wrong = 1 - float(right.mean())
        yield [100 * wrong, *areas, optimal_auc(wrong)]


if __name__ == "__main__":
    as_command(main)
