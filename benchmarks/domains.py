"""How maps and confidence do in several worlds beside SGBM: ``python -m benchmarks.domains DATASET ...``.

Each scene is matched by a preset with the package's weights, and by OpenCV's SGBM. The tables have the mean over the
scenes of each data set: what is wrong in the dense map, at SGBM's density and at R = 0.9; what comes of a wanted error.
Pixels that both views see count, a pixel without a disparity is wrong in a dense map. A data set in another layout is
described by a small file (``toml:FILE``).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.harness import write
from semidense.datasets import open_dataset
from semidense.pipeline.api import Task, carry_out
from semidense.pipeline.execution.progress import ProgressWatch
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.results.result import Result
from semidense.stages.evaluation.filtering import threshold_for_error
from semidense.stages.metrics.confidence import auc

THRESHOLDS = (1.0, 2.0, 3.0)
"""Errors above which a disparity is wrong, px."""
WISHES = (0.01, 0.02, 0.05)
"""Shares of wrong pixels that are asked for; wrong is what the calibration calls so, more than 1 px."""
ECE_BINS = 10
Flags = NDArray[np.bool_]
Values = NDArray[np.float32]
Figures = Mapping[str, float]


def main(
    dataset: Annotated[list[str], typer.Argument(help="such as kitti2015:DIR, eth3d:DIR, toml:FILE")],
    preset: Annotated[str, typer.Option(help="named settings")] = "robust",
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
) -> None:
    """Print and write the figures of each data set."""
    found = {spec: _figures(Task(spec, settings=setting or (), preset=preset, cache=cache)) for spec in dataset}
    write("domains", {"preset": preset, "settings": setting or [], "datasets": found})
    _print(
        "% wrong: dense, at SGBM's density, R = 0.9", found, [f"{name}>{t:g}" for t in THRESHOLDS for name in _SHARES]
    )
    _print("what is kept, and the order", found, ["scenes", "kept, SGBM", "kept, R = 0.9", "AUC", "ECE > 1 px"])
    _print("a wanted error: % wrong (> 1 px) of % kept", found, [f"{w:g} {what}" for w in WISHES for what in _KEPT])


_SHARES = ("dense ", "SGBM dense ", "at its density ", "SGBM ", "R = 0.9 ")
_KEPT = ("wrong", "kept")


def _print(title: str, found: Mapping[str, Figures], names: Sequence[str]) -> None:
    table = Table("", *found, title=title, box=None)
    for name in names:
        table.add_row(name, *(f"{figures[name]:.4g}" for figures in found.values()))
    Console(width=160).print(table)


def _figures(task: Task) -> Figures:
    """Return the mean of each figure over the scenes with a truth."""
    scenes = [scene for scene in open_dataset(str(task.dataset)).scenes if scene.has_truth]
    request = Request(
        open_dataset(str(task.dataset)).select([scene.name for scene in scenes]), {"": task.configuration()},
        "calibrated_confidence", also=("confidence", "disparity", "truth", "sgm"),
    )  # fmt: skip
    with ProgressWatch() as watch:
        result = carry_out(task, request, (), watch, None, None)
    rows = [_of_scene(result, scene.name) for scene in scenes]
    return {name: float(np.nanmean([row[name] for row in rows])) for name in rows[0]} | {"scenes": len(rows)}


def _of_scene(result: Result, scene: str) -> Figures:
    truth = result.open("truth", scene)
    mask = truth["nonocc"].values & np.isfinite(truth["disparity"].values)
    own, theirs = result.open("disparity", scene)["disparity"].values, result.open("sgm", scene)
    score = result.open("confidence", scene)["confidence"].values
    chance = result.open("calibrated_confidence", scene)["confidence"].values
    sgm, dense = theirs["disparity"].values, theirs["dense"].values
    kept, share = score >= np.float32(0.9), np.isfinite(sgm)[mask].mean()
    densest = mask & (score >= np.quantile(score[mask], 1 - share))
    row = {"kept, SGBM": 100 * float(share), "kept, R = 0.9": 100 * float(kept[mask].mean())}
    for limit in THRESHOLDS:
        right = np.abs(own - truth["disparity"].values) <= limit
        right_sgm, right_dense = (np.abs(each - truth["disparity"].values) <= limit for each in (sgm, dense))
        values = (
            _wrong(right, mask), _wrong(right_dense, mask), _wrong(right, densest),
            _wrong(right_sgm, mask & np.isfinite(sgm)), _wrong(right, mask & kept),
        )  # fmt: skip
        row |= {f"{name}>{limit:g}": value for name, value in zip(_SHARES, values, strict=True)}
    right = np.abs(own - truth["disparity"].values) <= 1
    row |= {"AUC": auc(score[mask], right[mask]), "ECE > 1 px": _calibration_error(chance[mask], right[mask])}
    for wish in WISHES:
        sure = mask & (chance >= threshold_for_error(wish, own, chance))
        row |= {f"{wish:g} wrong": _wrong(right, sure), f"{wish:g} kept": 100 * float(sure[mask].mean())}
    return row


def _wrong(right: Flags, among: Flags) -> float:
    """Return the share of wrong pixels, %; NaN of no pixels."""
    return 100 * float(1 - right[among].mean()) if among.any() else float("nan")


def _calibration_error(chance: Values, right: Flags) -> float:
    """Return the expected calibration error: how far the share of right pixels is from their probability, in bins."""
    bins = np.minimum((chance * ECE_BINS).astype(int), ECE_BINS - 1)
    gaps = [abs(float((chance - right)[bins == each].sum())) for each in range(ECE_BINS)]
    return sum(gaps) / chance.size


if __name__ == "__main__":
    typer.run(main)
