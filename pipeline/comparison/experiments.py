"""The paper's experiments side by side: raw maps, error at equal density, confidence measures.

Baselines are products like all others: each is computed once and then read from the cache. A baseline
whose packages or training scenes are missing is left out, with the reason.
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semidense.datasets import Dataset, SceneSource, open_dataset
from semidense.pipeline.api import Task, carry_out
from semidense.pipeline.comparison.ablation import ABLATION, ablation_request, ablation_rows
from semidense.pipeline.comparison.methods import LOWERED, MATCHERS, MEASURES, matcher_rows, measure_rows, ours
from semidense.pipeline.comparison.paper_figures import NAMED
from semidense.pipeline.comparison.protocols import PROTOCOLS, protocol_requests, require_protocols
from semidense.pipeline.comparison.rows import (
    Judged,
    Row,
    curve_rows,
    density_rows,
    raw_rows,
)
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.config import setting_texts
from semidense.pipeline.plan.environment import missing_packages
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.presets import DEFAULT
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.plan.training_split import training_scenes
from semidense.pipeline.results.metric_rows import METHOD, mean_rows
from semidense.pipeline.results.result import Result
from semidense.stages.catalog import STAGES
from semidense.stages.stage import Arrays

EXPERIMENTS = ("raw", "density", "auc")
"""What is compared: dense maps, semi-dense maps, and confidence measures."""
BESIDE = {
    "preset robust, single costs": (
        "use.disparity=disparity",
        "use.right_disparity=right_disparity",
        "use.confidence=confidence",
    ),
    "preset robust": (),
}
"""Settings of the preset ``robust`` that stand beside the default ones, by name: without and with aggregation."""
_TAUGHT = ("o1", "ccnn")
"""Products that need training scenes; ``--train-on`` names them."""
_ALWAYS = ("images", "truth", "disparity", "confidence")
_SHIPPED = ", shipped weights"
_UNTRAINED = "needs a training set: name one with --train-on"
_LEFT_OUT = "left out on request"


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
    task: Task | str = "motorcycle",
    experiments: Sequence[str] = EXPERIMENTS,
    train_on: str | None = None,
    protocols: Sequence[str] = (),
    *,
    without: Sequence[str] = (),
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Comparison:
    """Run the paper's experiments on the scenes of a dataset that have a ground truth.

    Args:
        task: what to work on; a text is a dataset. The two networks have their shipped weights.
        experiments: of ``EXPERIMENTS``.
        train_on: dataset whose training scenes O1 and CCNN learn from, and on which matching-Nets with different
            channels are trained from nothing, alike; without it, those rows are left out.
        protocols: of ``PROTOCOLS``: the paper's own, by which both networks are trained and tested beside ours.
        without: products of other matchers and measures that are left out, such as ``mc_cnn_accurate``; with
            ``ablation``, no matching-Nets with different channels are trained.
        watch: as for ``run``.
        scheduler: as for ``run``.
        workers: as for ``run``.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
    """
    task = Task(task) if isinstance(task, str) else task
    _require(task, experiments)
    require_protocols(protocols)
    _require_others(without)
    training = training_scenes(open_dataset(train_on)) if train_on else ()
    plain = task.request("semidense")
    dataset, notes = _with_truth(plain.dataset)
    products, unavailable = _available(experiments, bool(training), without)
    request = dataclasses.replace(plain, dataset=dataset, training=training, also=(*_ALWAYS, *products))
    lenient = [(name, each) for name in protocols for each in protocol_requests(name, task, dataset, training)]
    result = carry_out(task, request, (), watch, scheduler, workers)
    rows = list(_rows(result, experiments))
    if "raw" in experiments and not _no_ablation(bool(training), without):
        ablation = ablation_request(task, dataset, training)
        rows += ablation_rows(carry_out(task, ablation, (), watch, scheduler, workers))
    for name, wanted in _beside(task, dataset, training):
        rows += _named(_rows(carry_out(task, wanted, (), watch, scheduler, workers), experiments), name)
    for protocol, wanted in lenient:
        trained = carry_out(task, wanted, (), watch, scheduler, workers)
        rows += _named(_rows(trained, experiments), PROTOCOLS[protocol])
    return Comparison(rows, unavailable, (*notes, *result.plan.notes), result)


def _beside(task: Task, dataset: Dataset, training: tuple[SceneSource, ...]) -> Iterator[tuple[str, Request]]:
    """Yield the requests of ``BESIDE`` with the task's settings; nothing if the task has a preset of its own."""
    for name, settings in BESIDE.items() if task.preset == DEFAULT else ():
        other = dataclasses.replace(task, preset="robust", settings=(*settings, *setting_texts(task.settings)))
        request = other.request("semidense")
        yield name, dataclasses.replace(request, dataset=dataset, training=training, also=_ALWAYS)


def _require(task: Task, experiments: Sequence[str]) -> None:
    for name in experiments:
        if name not in EXPERIMENTS:
            raise UsageError(f"no experiment {name!r}; {nearest(name, EXPERIMENTS)}")
    if not experiments:
        raise UsageError(f"no experiment was named; there are {', '.join(EXPERIMENTS)}")
    if task.train:
        raise UsageError("a comparison takes the shipped networks; what is trained beside them is named by train_on")


def _require_others(products: Sequence[str]) -> None:
    others = sorted({*MATCHERS.values(), *(product for product, _ in MEASURES.values()), "ablation"} - {*_ALWAYS})
    for product in products:
        if product not in others:
            raise UsageError(f"--without {product}: no such matcher or measure; {nearest(product, others)}")


def _with_truth(dataset: Dataset) -> tuple[Dataset, list[str]]:
    """Return the dataset without scenes of unknown truth, and a note for each of those."""
    known = tuple(scene for scene in dataset.scenes if scene.has_truth)
    if not known:
        raise UsageError(f"{dataset.spec}: no scene has a ground truth, so there is nothing to compare with")
    notes = [f"{scene.name} has no ground truth: it is left out" for scene in dataset.scenes if not scene.has_truth]
    return dataclasses.replace(dataset, scenes=known), notes


def _available(
    experiments: Sequence[str], trained: bool, without: Sequence[str]
) -> tuple[tuple[str, ...], list[dict[str, str]]]:
    """Return the products that the experiments need and that can be made, and why others cannot."""
    wanted = {method: product for method, product in MATCHERS.items() if {"raw", "density"} & set(experiments)}
    if "auc" in experiments:
        wanted |= {method: product for method, (product, _) in MEASURES.items() if product not in _ALWAYS}
    reasons = {product: _reason(product, trained, without) for product in wanted.values()}
    products = tuple(product for product, reason in reasons.items() if not reason)
    missing = {method: reasons[product] for method, product in wanted.items() if reasons[product]}
    if "raw" in experiments and (why := _no_ablation(trained, without)):
        missing |= dict.fromkeys(ABLATION, why)
    if "density" in experiments:
        missing |= dict.fromkeys(NAMED, "in the paper's plot only: its text gives no figure for error against invalid")
    return products, [{"method": method, "why": why} for method, why in missing.items()]


def _reason(product: str, trained: bool, without: Sequence[str]) -> str:
    """Return why a product cannot be made; empty if it can."""
    if product in without:
        return _LEFT_OUT
    inputs = (STAGES[name] for name in STAGES[product].inputs if name in STAGES)
    packages = [name for stage in (STAGES[product], *inputs) for name in missing_packages(stage)]
    if packages:
        return f"needs {' and '.join(packages)}: pip install 'semidense-stereo[baselines]'"
    return _UNTRAINED if product in _TAUGHT and not trained else ""


def _no_ablation(trained: bool, without: Sequence[str]) -> str:
    """Return why no matching-Nets with different channels are trained; empty if they are."""
    return _LEFT_OUT if "ablation" in without else "" if trained else _UNTRAINED


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
