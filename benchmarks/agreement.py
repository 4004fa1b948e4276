"""How much the map's agreement should weigh in the confidence: ``python -m benchmarks.agreement DATASET``.

The training scenes are matched and scored as for the calibration, each by networks that have not seen it (``make
calibration`` makes the same products). For each window and weight the table has the mean AUC, and below it
the typical agreement: the geometric mean over the right pixels. So none of the numbers comes from a test scene.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, write
from semidense.pipeline.api import Task, run
from semidense.pipeline.results.result import Result
from semidense.stages.evaluation.agreement import agreement
from semidense.stages.evaluation.declaration import ConfidenceParams
from semidense.stages.metrics.confidence import auc, optimal_auc

WINDOWS = (9, 13, 17, 21, 25, 29, 33)
WEIGHTS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
TOLERANCE = 1.0
"""Largest error of a right disparity, px."""
Values = NDArray[np.float64]


def main(
    dataset: Annotated[str, typer.Argument(help="the training scenes, such as middlebury:DIR")],
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
    window: Annotated[list[int] | None, typer.Option(help="instead of the usual ones")] = None,
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
) -> None:
    """Print and write the mean AUC for each window and weight."""
    result = run(Task(dataset, cache=cache, settings=setting or (), train=True), "calibration")
    windows = tuple(window or WINDOWS)
    scenes = sorted({made.step.scene for made in result.made.values() if made.step.product == "confidence"})
    areas: dict[int, list[Values]] = {each: [] for each in windows}
    alone: dict[int, list[float]] = {each: [] for each in windows}
    typical: dict[int, list[float]] = {each: [] for each in windows}
    optimal = []
    for scene in scenes:
        disparity, log_odds, right, visible = _scored(result, scene)
        optimal.append(optimal_auc(1 - float(right.mean())))
        for side in windows:
            share = np.log(agreement(disparity, side).astype(np.float64))[visible]
            areas[side].append(np.array([auc(log_odds + weight * share, right) for weight in WEIGHTS]))
            alone[side].append(auc(share, right))
            typical[side].append(float(share[right].mean()))
    found = {side: np.mean(areas[side], 0).tolist() for side in windows}
    only = {side: float(np.mean(alone[side])) for side in windows}
    usual = {side: float(np.exp(np.mean(typical[side]))) for side in windows}
    used = ConfidenceParams()
    write(
        "agreement",
        {
            "scenes": scenes, "weights": WEIGHTS, "auc": found, "auc of agreement alone": only,
            "typical agreement": usual, "auc, optimal": float(np.mean(optimal)),
            "defaults": {"window": used.window, "agreement": used.agreement, "typical": used.typical},
        },
    )  # fmt: skip
    print(f"mean AUC over {len(scenes)} scenes, each scored by a network that has not seen it")
    print(f"a perfect order has {np.mean(optimal):.4f}")
    Console(width=160).print(_table(found, only, usual))


def _scored(result: Result, scene: str) -> tuple[NDArray[np.float32], Values, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return a scene's raw map; of its pixels that count the net's log-odds and which are right; and where they are."""
    scored = result.find("confidence", scene).step.inputs["disparity"][0]  # others are of networks that have seen it
    disparity = result.store.arrays(result.made[scored].key)["disparity"][...]
    truth = result.open("truth", scene)
    visible = truth["nonocc"].values & np.isfinite(truth["disparity"].values)
    network = result.open("confidence", scene)["network"].values.astype(np.float64)[visible]
    network = np.clip(network, 1e-7, 1 - 1e-7)
    right = (np.abs(disparity - truth["disparity"].values) <= TOLERANCE)[visible]
    return disparity, np.log(network / (1 - network)), right, visible


def _table(found: Mapping[int, Sequence[float]], only: Mapping[int, float], usual: Mapping[int, float]) -> Table:
    table = Table("window, px", *(f"weight {weight:g}" for weight in WEIGHTS), "agreement alone", "typical", box=None)
    for side, areas in found.items():
        table.add_row(str(side), *(f"{area:.4f}" for area in areas), f"{only[side]:.4f}", f"{usual[side]:.3f}")
    return table


if __name__ == "__main__":
    as_command(main)
