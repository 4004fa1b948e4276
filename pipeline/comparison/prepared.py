"""What a comparison will make: one request for each kind of run, and what cannot be made."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from semidense.datasets import Dataset, SceneSource, open_dataset
from semidense.pipeline.api import Task, planned
from semidense.pipeline.comparison.ablation import ABLATION, ablation_request
from semidense.pipeline.comparison.maps import map_requests
from semidense.pipeline.comparison.methods import MATCHERS, MEASURES
from semidense.pipeline.comparison.paper_figures import NAMED
from semidense.pipeline.comparison.protocols import PROTOCOLS, protocol_requests, require_protocols
from semidense.pipeline.plan.arguments import Texts, texts
from semidense.pipeline.plan.config import setting_texts
from semidense.pipeline.plan.environment import missing_packages
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.plan import Plan
from semidense.pipeline.plan.presets import DEFAULT
from semidense.pipeline.plan.steps import Request, note_on
from semidense.pipeline.plan.training_split import training_scenes
from semidense.stages.catalog import STAGES

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
ALWAYS = ("images", "truth", "disparity", "confidence")
_UNTRAINED = "needs a training set: name one with --train-on"
_LEFT_OUT = "left out on request"


@dataclass(frozen=True)
class Prepared:
    """What a comparison will make.

    Attributes:
        task: what all its runs share.
        experiments: of ``EXPERIMENTS``.
        own: the request with the task's settings, and with every other matcher and measure.
        ablation: the request for matching-Nets that see different channels; None if they are left out.
        named: further requests, each with the name that its rows get.
        maps: requests that score the maps of further matchers, each with the matcher's name.
        unavailable: ``method`` and ``why`` of what will not be run.
        notes: what a person should know.
    """

    task: Task
    experiments: tuple[str, ...]
    own: Request
    ablation: Request | None
    named: tuple[tuple[str, Request], ...]
    maps: tuple[tuple[str, Request], ...]
    unavailable: list[dict[str, str]]
    notes: tuple[str, ...]

    def plan(self) -> Plan:
        """Return the plan of all runs as one, with each product once. Nothing is made."""
        requests = (self.own, self.ablation, *(request for _, request in (*self.named, *self.maps)))
        plans = [planned(self.task, request) for request in requests if request]
        steps = {each.step.id: each for plan in plans for each in plan.steps}
        return Plan(tuple(steps.values()), plans[0].targets, (*self.notes, *plans[0].notes))


def prepare(
    task: Task,
    experiments: Texts = EXPERIMENTS,
    train_on: str | None = None,
    protocols: Texts = (),
    *,
    without: Texts = (),
    maps: Mapping[str, str] | None = None,
) -> Prepared:
    """Return what a comparison will make; arguments and errors are those of ``compare``."""
    experiments, protocols = texts("experiments", experiments), texts("protocols", protocols)
    without = texts("without", without)
    _require(task, experiments)
    require_protocols(protocols)
    _require_others(without)
    training = training_scenes(open_dataset(train_on)) if train_on else ()
    plain = task.request("semidense")
    dataset, notes = _with_truth(plain.dataset)
    products, unavailable = _available(experiments, bool(training), without)
    request = dataclasses.replace(plain, dataset=dataset, training=training, also=(*ALWAYS, *products))
    lenient = [
        (PROTOCOLS[name], each) for name in protocols for each in protocol_requests(name, task, dataset, training)
    ]
    trained = "raw" in experiments and not _no_ablation(bool(training), without)
    ablation = ablation_request(task, dataset, training) if trained else None
    named = (*_beside(task, dataset, training), *lenient)
    given = tuple(map_requests(task, dataset, maps or {}, ALWAYS))
    return Prepared(task, experiments, request, ablation, named, given, unavailable, tuple(notes))


def _beside(task: Task, dataset: Dataset, training: tuple[SceneSource, ...]) -> Iterator[tuple[str, Request]]:
    """Yield the requests of ``BESIDE`` with the task's settings; nothing if the task has a preset of its own."""
    for name, settings in BESIDE.items() if task.preset == DEFAULT else ():
        other = dataclasses.replace(task, preset="robust", settings=(*settings, *setting_texts(task.settings)))
        request = other.request("semidense")
        yield name, dataclasses.replace(request, dataset=dataset, training=training, also=ALWAYS)


def _require(task: Task, experiments: Sequence[str]) -> None:
    for name in experiments:
        if name not in EXPERIMENTS:
            raise UsageError(f"no experiment {name!r}; {nearest(name, EXPERIMENTS)}")
    if not experiments:
        raise UsageError(f"no experiment was named; there are {', '.join(EXPERIMENTS)}")
    if task.train:
        raise UsageError("a comparison takes the shipped networks; what is trained beside them is named by train_on")


def _require_others(products: Sequence[str]) -> None:
    others = sorted({*MATCHERS.values(), *(product for product, _ in MEASURES.values()), "ablation"} - {*ALWAYS})
    for product in products:
        if product not in others:
            raise UsageError(f"--without {product}: no such matcher or measure; {nearest(product, others)}")


def _with_truth(dataset: Dataset) -> tuple[Dataset, list[str]]:
    """Return the dataset without scenes of unknown truth, and a note on those."""
    known = tuple(scene for scene in dataset.scenes if scene.has_truth)
    if not known:
        raise UsageError(f"{dataset.spec}: no scene has a ground truth, so there is nothing to compare with")
    others = [scene.name for scene in dataset.scenes if not scene.has_truth]
    left_out = note_on(others, "has no ground truth: it is left out", "have no ground truth: they are left out")
    return dataclasses.replace(dataset, scenes=known), left_out


def _available(
    experiments: Sequence[str], trained: bool, without: Sequence[str]
) -> tuple[tuple[str, ...], list[dict[str, str]]]:
    """Return the products that the experiments need and that can be made, and why others cannot."""
    wanted = {method: product for method, product in MATCHERS.items() if {"raw", "density"} & set(experiments)}
    if "auc" in experiments:
        wanted |= {method: product for method, (product, _) in MEASURES.items() if product not in ALWAYS}
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
