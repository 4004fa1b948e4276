"""How maps and confidence do in several worlds beside SGBM: ``python -m benchmarks.domains DATASET ...``.

Each scene is matched by a preset with the package's weights, and by OpenCV's SGBM; ``--pandora MAPS`` adds the maps
that ``python -m benchmarks.pandora`` wrote. The tables have the mean over the scenes of each data set: what is wrong in
the dense map, at the density of the others and at R = 0.9; what comes of a wanted error, which counts a disparity as
right within 1, 2 or 3 px (the calibration has a table for each).
Pixels that both views see count, a pixel without a disparity is wrong in a dense map. Where another matcher keeps more
pixels than have a confidence above 0, the rest is filled up at random. The expected calibration error (ECE) is of the
pixels with a confidence above 0: a veto sets pixels to 0 to keep them out, which is no probability. A data set in
another layout is described by a small file (``toml:FILE``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, write
from semidense.datasets import SceneSource, open_dataset, read_pfm
from semidense.pipeline.api import Task, carry_out
from semidense.pipeline.execution.progress import ProgressWatch
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.shipped_weights import TOLERANCES
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.results.result import Result
from semidense.stages.evaluation.filtering import threshold_for_error
from semidense.stages.metrics.confidence import Ranking

WISHES = (0.01, 0.02, 0.05)
"""Shares of wrong pixels that are asked for."""
ECE_BINS = 10
Flags = NDArray[np.bool_]
Values = NDArray[np.float32]
Figures = Mapping[str, float]


def main(
    dataset: Annotated[list[str], typer.Argument(help="such as kitti2015:DIR, eth3d:DIR, toml:FILE")],
    preset: Annotated[str, typer.Option(help="named settings")] = "robust",
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
    pandora: Annotated[Path | None, typer.Option(help="folder of Pandora's maps, of all data sets")] = None,
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
) -> None:
    """Print and write the figures of each data set."""
    tasks = [Task(spec, settings=setting or (), preset=preset, cache=cache) for spec in dataset]
    if pandora is not None:
        _require_maps([scene for task in tasks for scene in _with_truth(task)], pandora)
    found = {str(task.dataset): _figures(task, pandora) for task in tasks}
    write("domains", {"preset": preset, "settings": setting or [], "datasets": found})
    others = ["SGBM"] if pandora is None else ["SGBM", "Pandora"]
    shares = ["dense", *(name.format(other) for other in others for name in _OF_OTHER), "R = 0.9"]
    _print("% wrong", found, [f"{name} >{limit:g}" for limit in TOLERANCES for name in shares])
    errors = [f"{name} > {limit:g} px" for name in _ECE for limit in TOLERANCES]
    kept = [f"kept, {name}" for name in (*others, "R = 0.9")]
    _print("what is kept, and the order", found, ["scenes", *kept, "AUC", *errors])
    _print("a wanted error: % wrong of % kept", found, [f"{w:g} {what}" for w in WISHES for what in _KEPT])


_ECE = ("ECE", "ECE a scene", "ECE with vetoed")
_OF_OTHER = ("{} dense", "at {}'s density", "{}")
"""Wrong in another matcher's dense map, in ours at the density of its checked one, and in the checked one."""
_KEPT = tuple(f"{what} {limit:g} px" for limit in TOLERANCES for what in ("kept, within", "wrong, >"))


def _print(title: str, found: Mapping[str, Figures], names: Sequence[str]) -> None:
    table = Table("", *found, title=title, box=None)
    for name in names:
        table.add_row(name, *(f"{figures[name]:.4g}" for figures in found.values()))
    Console(width=160).print(table)


def _figures(task: Task, pandora: Path | None) -> Figures:
    """Return the mean of each figure over the scenes with a truth, and the calibration error of all their pixels."""
    scenes = _with_truth(task)
    chosen = open_dataset(str(task.dataset)).select([scene.name for scene in scenes])

    def made(tolerance: float, watch: Watch) -> Result:
        config = task.and_settings([f"calibration.tolerance={tolerance:g}"]).configuration()
        also = ("confidence", "disparity", "truth", "sgm")
        return carry_out(task, Request(chosen, {"": config}, "calibrated_confidence", also=also), (), watch, None, None)

    with ProgressWatch() as watch:
        results = {tolerance: made(tolerance, watch) for tolerance in TOLERANCES}
    maps = [_Maps.of(results, scene.name, pandora) for scene in scenes]
    rows = [_of_scene(each) for each in maps]
    means = {name: float(np.nanmean([row[name] for row in rows])) for name in rows[0]}
    errors = {name: value for limit in TOLERANCES for name, value in _calibration_errors(maps, limit).items()}
    return means | errors | {"scenes": len(rows)}


def _with_truth(task: Task) -> list[SceneSource]:
    return [scene for scene in open_dataset(str(task.dataset)).scenes if scene.has_truth]


def _require_maps(scenes: Sequence[SceneSource], pandora: Path) -> None:
    """Refuse a folder that lacks a map, before anything is matched."""
    for scene in scenes:
        for file in _files_of(pandora, scene.name):
            if not file.is_file():
                raise typer.BadParameter(f"{file} is not there: make it by `python -m benchmarks.pandora`")


def _files_of(pandora: Path, scene: str) -> tuple[Path, Path]:
    """Return the files of Pandora's maps of a scene: dense, and checked."""
    name = scene.rsplit("/", 1)[-1]
    return pandora / f"{name}.pfm", pandora / f"{name}.checked.pfm"


class _Other(NamedTuple):
    """Another matcher's map, (y, x) disparities in px, before and after its checks."""

    dense: Values
    checked: Values


@dataclass(frozen=True)
class _Maps:
    """The maps of a scene, (y, x) each: disparities in px, scores in [0, 1], and the pixels that count.

    ``chance`` has a map for each tolerance.
    """

    truth: Values
    mask: Flags
    own: Values
    others: Mapping[str, _Other]
    score: Values
    chance: Mapping[float, Values]

    @classmethod
    def of(cls, results: Mapping[float, Result], scene: str, pandora: Path | None) -> "_Maps":
        result = results[TOLERANCES[0]]
        truth, sgm = result.open("truth", scene), result.open("sgm", scene)
        others = {"SGBM": _Other(sgm["dense"].values, sgm["disparity"].values)}
        if pandora is not None:
            others["Pandora"] = _Other(*map(read_pfm, _files_of(pandora, scene)))
        return cls(
            truth["disparity"].values,
            truth["nonocc"].values & np.isfinite(truth["disparity"].values),
            result.open("disparity", scene)["disparity"].values,
            others,
            result.open("confidence", scene)["confidence"].values,
            {limit: of.open("calibrated_confidence", scene)["confidence"].values for limit, of in results.items()},
        )

    def kept_by(self, other: _Other) -> float:
        """Return the share of the pixels that another matcher keeps."""
        return float(np.isfinite(other.checked)[self.mask].mean())

    def right(self, disparity: Values, limit: float) -> Flags:
        """Return where a map is right."""
        return np.abs(disparity - self.truth) <= limit

    def gaps(self, limit: float, among: Flags) -> NDArray[np.float64]:
        """Return by how much the probabilities of some pixels exceed what is right of them.

        (tenth + 1,) sums: one for each tenth of probability, and the number of pixels.
        """
        chosen = self.mask & among
        chance, right = self.chance[limit][chosen], self.right(self.own, limit)[chosen]
        tenths = np.minimum((chance * ECE_BINS).astype(int), ECE_BINS - 1)
        return np.append(np.bincount(tenths, chance - right, ECE_BINS), chance.size)

    def wrong(self, disparity: Values, limit: float, among: Flags | None = None) -> float:
        """Return the share of wrong pixels among some of those that count, %; NaN of no pixels."""
        chosen = self.mask if among is None else self.mask & among
        return 100 * float(1 - self.right(disparity, limit)[chosen].mean()) if chosen.any() else float("nan")


def _of_scene(maps: _Maps) -> Figures:
    kept, ranking = maps.score >= np.float32(0.9), Ranking.of(maps.score[maps.mask])
    right = maps.right(maps.own, 1)[maps.mask]
    return {
        **{f"kept, {name}": 100 * maps.kept_by(other) for name, other in maps.others.items()},
        "kept, R = 0.9": 100 * float(kept[maps.mask].mean()),
        "AUC": ranking.auc(right),
        **{name: value for limit in TOLERANCES for name, value in _shares(maps, kept, ranking, limit).items()},
        **{name: value for wish in WISHES for name, value in _promised(maps, wish).items()},
    }


def _calibration_errors(scenes: Sequence[_Maps], limit: float) -> Figures:
    """Return the expected calibration error: of all pixels together, of a scene in the mean, with vetoed pixels."""
    told = [maps.gaps(limit, maps.score > 0) for maps in scenes]
    whole = [maps.gaps(limit, maps.mask) for maps in scenes]
    a_scene = float(np.mean([_error(each) for each in told]))
    errors = _error(np.sum(told, axis=0)), a_scene, _error(np.sum(whole, axis=0))
    return {f"{name} > {limit:g} px": error for name, error in zip(_ECE, errors, strict=True)}


def _error(gaps: NDArray[np.float64]) -> float:
    return float(np.abs(gaps[:-1]).sum() / gaps[-1])


def _shares(maps: _Maps, kept: Flags, ranking: Ranking, limit: float) -> Figures:
    shares = {"dense": maps.wrong(maps.own, limit)}
    order = ranking.wrong(maps.right(maps.own, limit)[maps.mask])
    for name, other in maps.others.items():
        count = max(1, round(maps.kept_by(other) * np.count_nonzero(maps.mask)))
        values = (
            maps.wrong(other.dense, limit),
            100 * float(order[count - 1]) / count,
            maps.wrong(other.checked, limit, np.isfinite(other.checked)),
        )
        shares |= {what.format(name): value for what, value in zip(_OF_OTHER, values, strict=True)}
    shares["R = 0.9"] = maps.wrong(maps.own, limit, kept)
    return {f"{name} >{limit:g}": value for name, value in shares.items()}


def _promised(maps: _Maps, wish: float) -> Figures:
    found = {}
    for limit, chance in maps.chance.items():
        sure = chance >= threshold_for_error(wish, maps.own, chance)
        found[f"{wish:g} kept, within {limit:g} px"] = 100 * float(sure[maps.mask].mean())
        found[f"{wish:g} wrong, > {limit:g} px"] = maps.wrong(maps.own, limit, sure)
    return found


if __name__ == "__main__":
    as_command(main)
