"""The paper's experiments side by side: raw maps, error at equal density, confidence measures.

Baselines are products like all others: each is computed once and then read from the cache. A baseline
whose packages or training scenes are missing is left out, with the reason.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from semidense.pipeline.api import Data, Options, Task, carry_out
from semidense.pipeline.comparison.ablation import ablation_rows
from semidense.pipeline.comparison.maps import map_rows
from semidense.pipeline.comparison.methods import LOWERED, MATCHERS, matcher_rows, measure_rows, ours
from semidense.pipeline.comparison.prepared import EXPERIMENTS, Prepared, prepare
from semidense.pipeline.comparison.rows import (
    Judged,
    Row,
    curve_rows,
    density_rows,
    raw_rows,
)
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.arguments import Texts
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.results.metric_rows import METHOD, mean_rows
from semidense.pipeline.results.result import Result
from semidense.stages.stage import Arrays

_SHIPPED = ", shipped weights"


@dataclass(frozen=True)
class Comparison:
    """What a comparison found.

    Attributes:
        rows: a row an experiment, scene, method, mask, threshold and, on a curve, R; see ``metric_rows.FIGURES``.
        unavailable: ``method`` and ``why`` of what was not run.
        notes: what a person should know.
        result: of the run behind it, with every product.
    """

    rows: list[Row]
    unavailable: list[dict[str, str]]
    notes: tuple[str, ...]
    result: Result

    @property
    def means(self) -> list[Row]:
        """The rows' means over the scenes."""
        return mean_rows(self.rows)

    @property
    def scenes(self) -> list[str]:
        """The names of the scenes, in order."""
        return list(dict.fromkeys(row["scene"] for row in self.rows))

    @property
    def R(self) -> float | None:  # noqa: N802 - the paper's name
        """The least confidence that our semi-dense map keeps; None where a density was asked for instead."""
        return next(iter(_asked(self.result).values()))["semidense"].step.R

    def arrays(self, scene: str) -> dict[str, Arrays]:
        """Return the arrays of every product of a scene that was asked for, in memory."""
        return _read(self.result, _asked(self.result)[scene])

    def images(self, scene: str) -> Arrays:
        """Return the views of a scene."""
        return self.result.store.read(_asked(self.result)[scene]["images"].key)


def compare(
    dataset: Data | Task = "motorcycle",
    experiments: Texts = EXPERIMENTS,
    train_on: str | None = None,
    protocols: Texts = (),
    *,
    without: Texts = (),
    maps: Mapping[str, str] | None = None,
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    **options: Unpack[Options],
) -> Comparison:
    """Run the paper's experiments on the scenes of a dataset that have a ground truth.

    Args:
        dataset: what to work on: a dataset, or a task that ``options`` refine. The two networks have their shipped
            weights.
        experiments: of ``EXPERIMENTS``.
        train_on: dataset whose training scenes O1 and CCNN learn from, and on which matching-Nets with different
            channels are trained from nothing, alike; without it, those rows are left out.
        protocols: of ``PROTOCOLS``: the paper's own, by which both networks are trained and tested beside ours.
        without: products of other matchers and measures that are left out, such as ``mc_cnn_accurate``; with
            ``ablation``, no matching-Nets with different channels are trained.
        maps: files with the maps of further matchers, by name: ``PATTERN[,scale=S][,none=V]`` with one ``*`` for the
            scene's name. They are scored by the preset ``foreign``.
        watch: as for ``run``.
        scheduler: as for ``run``.
        workers: as for ``run``.
        **options: as for ``run``.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
    """
    task = Task.of(dataset, **options)
    prepared = prepare(task, experiments, train_on, protocols, without=without, maps=maps)
    return carry_out_comparison(prepared, watch=watch, scheduler=scheduler, workers=workers)


def carry_out_comparison(
    prepared: Prepared, *, watch: Watch | None = None, scheduler: str | None = None, workers: int | None = None
) -> Comparison:
    """Make what is prepared, and return the comparison; see ``compare``."""

    def make(request: Request) -> Result:
        return carry_out(prepared.task, request, (), watch, scheduler, workers)

    result = make(prepared.own)
    rows = list(_rows(result, prepared.experiments))
    if prepared.ablation:
        rows += ablation_rows(make(prepared.ablation))
    for name, wanted in prepared.named:
        rows += _named(_rows(make(wanted), prepared.experiments), name)
    for name, wanted in prepared.maps:
        rows += _map_rows(name, make(wanted), result, prepared.experiments)
    return Comparison(rows, prepared.unavailable, (*prepared.notes, *result.plan.notes), result)


def _asked(result: Result) -> dict[str, dict[str, Made]]:
    """Return what a run was asked for: scene -> product -> result."""
    found: dict[str, dict[str, Made]] = {}
    for step_id, _ in result.plan.targets:
        made = result.made[step_id]
        found.setdefault(made.step.scene, {})[made.step.product] = made
    return found


def _read(result: Result, products: Mapping[str, Made]) -> dict[str, Arrays]:
    return {product: result.store.read(made.key) for product, made in products.items()}


def _rows(result: Result, experiments: Sequence[str]) -> Iterator[Row]:
    for scene, made in _asked(result).items():
        products = _read(result, made)
        judged = Judged(scene, products["truth"])
        for experiment in experiments:
            yield from _EXPERIMENT[experiment](judged, products, made["semidense"].step.R)


def _map_rows(name: str, found: Result, own: Result, experiments: Sequence[str]) -> Iterator[Row]:
    """Yield the rows of maps from files, beside those of our own map."""
    beside = _asked(own)
    for scene, made in _asked(found).items():
        products = _read(found, made)
        yield from map_rows(
            name, Judged(scene, products["truth"]), products, ours(_read(own, beside[scene])), experiments
        )


def _named(rows: Iterable[Row], name: str) -> Iterator[Row]:
    """Yield rows under the name of a protocol or a preset; the curve stays that of the task's own settings."""
    for row in rows:
        if row["experiment"] != "curve":
            yield row | {"method": f"{row['method'].removesuffix(_SHIPPED)}, {name}"}


def _raw(judged: Judged, products: Mapping[str, Arrays], _: float | None) -> Iterator[Row]:
    yield from raw_rows(judged, f"{METHOD}{_SHIPPED}", products["disparity"]["disparity"])
    for method, product in MATCHERS.items():
        if product in products:
            yield from raw_rows(judged, method, products[product]["dense"])
    if "mc_cnn_accurate" in products:
        yield from raw_rows(judged, LOWERED, products["mc_cnn_accurate"]["dense"] - np.float32(0.5))


def _density(judged: Judged, products: Mapping[str, Arrays], R: float | None) -> Iterator[Row]:
    yield from (row | {"R": R} for row in density_rows(judged, METHOD, products["semidense"]["disparity"]))
    yield from matcher_rows(judged, products)
    yield from curve_rows(judged, ours(products))


def _auc(judged: Judged, products: Mapping[str, Arrays], _: float | None) -> Iterator[Row]:
    yield from measure_rows(judged, products)


_EXPERIMENT = {"raw": _raw, "density": _density, "auc": _auc}
