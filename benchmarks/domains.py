"""How maps and confidence do in several worlds beside SGBM: ``python -m benchmarks.domains DATASET ...``.

Each scene is matched by a preset with the package's weights, and by OpenCV's SGBM. The tables have the mean over the
scenes of each data set: what is wrong in the dense map, at SGBM's density and at R = 0.9; what comes of a wanted error.
Pixels that both views see count, a pixel without a disparity is wrong in a dense map. Where SGBM keeps more pixels than
have a confidence above 0, the rest is filled up at random. A data set in another layout is described by a small file
(``toml:FILE``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from semidense.stages.metrics.confidence import Ranking

THRESHOLDS = (1.0, 2.0, 3.0)
"""Errors above which a disparity is wrong, px."""
WISHES = (0.01, 0.02, 0.05)
"""Shares of wrong pixels that are asked for; the calibration calls a pixel wrong that is off by more than 1 px."""
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
    _print(
        "what is kept, and the order",
        found,
        ["scenes", "kept, SGBM", "kept, R = 0.9", "AUC", *(f"ECE > {limit:g} px" for limit in THRESHOLDS)],
    )
    _print("a wanted error: % wrong of % kept", found, [f"{w:g} {what}" for w in WISHES for what in _KEPT])


_SHARES = ("dense ", "SGBM dense ", "at its density ", "SGBM ", "R = 0.9 ")
_KEPT = ("kept", *(f"wrong > {limit:g} px" for limit in THRESHOLDS))


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


@dataclass(frozen=True)
class _Maps:
    """The maps of a scene, (y, x) each: disparities in px, scores in [0, 1], and the pixels that count."""

    truth: Values
    mask: Flags
    own: Values
    sgm: Values
    sgm_dense: Values
    score: Values
    chance: Values

    @classmethod
    def of(cls, result: Result, scene: str) -> "_Maps":
        truth, sgm = result.open("truth", scene), result.open("sgm", scene)
        return cls(
            truth["disparity"].values,
            truth["nonocc"].values & np.isfinite(truth["disparity"].values),
            result.open("disparity", scene)["disparity"].values,
            sgm["disparity"].values,
            sgm["dense"].values,
            result.open("confidence", scene)["confidence"].values,
            result.open("calibrated_confidence", scene)["confidence"].values,
        )

    @property
    def sgm_share(self) -> float:
        """The share of the pixels that SGBM keeps."""
        return float(np.isfinite(self.sgm)[self.mask].mean())

    def right(self, disparity: Values, limit: float) -> Flags:
        """Return where a map is right."""
        return np.abs(disparity - self.truth) <= limit

    def wrong(self, disparity: Values, limit: float, among: Flags | None = None) -> float:
        """Return the share of wrong pixels among some of those that count, %; NaN of no pixels."""
        chosen = self.mask if among is None else self.mask & among
        return 100 * float(1 - self.right(disparity, limit)[chosen].mean()) if chosen.any() else float("nan")


def _of_scene(result: Result, scene: str) -> Figures:
    maps = _Maps.of(result, scene)
    kept, ranking = maps.score >= np.float32(0.9), Ranking.of(maps.score[maps.mask])
    right = maps.right(maps.own, 1)[maps.mask]
    return {
        "kept, SGBM": 100 * maps.sgm_share,
        "kept, R = 0.9": 100 * float(kept[maps.mask].mean()),
        "AUC": ranking.auc(right),
        **{
            f"ECE > {limit:g} px": _calibration_error(maps.chance[maps.mask], maps.right(maps.own, limit)[maps.mask])
            for limit in THRESHOLDS
        },
        **{name: value for limit in THRESHOLDS for name, value in _shares(maps, kept, ranking, limit).items()},
        **{name: value for wish in WISHES for name, value in _promised(maps, wish).items()},
    }


def _shares(maps: _Maps, kept: Flags, ranking: Ranking, limit: float) -> Figures:
    count = max(1, round(maps.sgm_share * np.count_nonzero(maps.mask)))
    values = (
        maps.wrong(maps.own, limit),
        maps.wrong(maps.sgm_dense, limit),
        100 * float(ranking.wrong(maps.right(maps.own, limit)[maps.mask])[count - 1]) / count,
        maps.wrong(maps.sgm, limit, np.isfinite(maps.sgm)),
        maps.wrong(maps.own, limit, kept),
    )
    return {f"{name}>{limit:g}": value for name, value in zip(_SHARES, values, strict=True)}


def _promised(maps: _Maps, wish: float) -> Figures:
    sure = maps.chance >= threshold_for_error(wish, maps.own, maps.chance)
    wrong = {f"{wish:g} wrong > {limit:g} px": maps.wrong(maps.own, limit, sure) for limit in THRESHOLDS}
    return {f"{wish:g} kept": 100 * float(sure[maps.mask].mean()), **wrong}


def _calibration_error(chance: Values, right: Flags) -> float:
    """Return the expected calibration error: how far the share of right pixels is from their probability, in bins."""
    bins = np.minimum((chance * ECE_BINS).astype(int), ECE_BINS - 1)
    gaps = [abs(float((chance - right)[bins == each].sum())) for each in range(ECE_BINS)]
    return sum(gaps) / chance.size


if __name__ == "__main__":
    typer.run(main)
