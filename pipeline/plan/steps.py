"""The steps of a run: which products are made from which, for the scenes and configurations at hand.

A step is a product of one scene (or of the training split) with its settings. Several configurations
share the steps in which they agree, so a sweep computes nothing twice. Nothing here looks at a cache.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from semidense.cache import Recipe, code_parts
from semidense.datasets import Dataset, SceneSource
from semidense.pipeline.plan import images_and_truth as sources
from semidense.pipeline.plan import shipped_weights as shipped
from semidense.pipeline.plan.config import Config, nearest
from semidense.pipeline.plan.environment import environment
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.resolution import require_trainable, resolved
from semidense.pipeline.plan.training_split import outside, with_folds
from semidense.stages.catalog import CATALOG, STAGES
from semidense.stages.stage import Params, Stage

PACKAGES = ("semidense",)
NETS = ("matching_net", "descriptor_net", "evaluation_net")
"""Products that are networks."""
LEARNT = tuple(shipped.WEIGHTS)
"""Products that come with the package, unless one trains."""
PRODUCTS = ("images", "truth", *(stage.product for stage in CATALOG))
"""The products of the dataflow, in order."""
ALL_PRODUCTS = ("images", "truth", *STAGES)
"""They and the baselines, in order; the names that ``--upto`` takes."""
SPLIT = "training split"
"""Stands for a scene in steps that belong to all training scenes together."""


@dataclass(frozen=True)
class Step:
    """One product of one scene, or of the training split.

    Attributes:
        id: names product, scene and everything it is made from; equal for equal work.
        stage: its declaration.
        scene: the scene's name, or ``SPLIT``.
        dataset: the scene's dataset, without a path.
        argument: what its function is given first: settings, or the source to read.
        settings: the part of the key that says how: plain JSON.
        inputs: ids of the steps it is made from, by product; of a split step, one a training scene.
        size: rows and columns of the image; None for a split step.
        code: hash of every module that decides the result.
        environment: what else changes its bits.
        R: the confidence threshold that a product below ``semidense`` was made with.
        configuration: all settings of the first variant that needs it, with its own as they were resolved.
    """

    id: str
    stage: Stage
    scene: str
    dataset: str
    argument: Any
    settings: Mapping[str, Any]
    inputs: Mapping[str, tuple[str, ...]]
    size: tuple[int, int] | None
    code: Mapping[str, str]
    environment: Mapping[str, str]
    R: float | None = None
    configuration: Mapping[str, Any] = field(default_factory=dict)

    @property
    def product(self) -> str:
        """The name of its product."""
        return self.stage.product

    @property
    def label(self) -> dict[str, str]:
        """What people call its result, whatever its settings."""
        return {"product": self.product, "dataset": self.dataset, "scene": self.scene}

    @property
    def name(self) -> str:
        """Product and scene, for messages."""
        return f"{self.product} of {self.scene}"

    def recipe(self, digests: Mapping[str, str]) -> Recipe:
        """Return the recipe, given the output digest of each input step by its id."""
        inputs: dict[str, str | list[str]] = {
            product: [digests[step] for step in ids] if self.takes_list(product) else digests[ids[0]]
            for product, ids in self.inputs.items()
        }
        return Recipe(self.product, self.code, self.settings, inputs, self.environment)

    def takes_list(self, product: str) -> bool:
        """Return whether an input comes once for each training scene."""
        return self.stage.scope == "split" and _scope(product) == "scene"


def _scope(product: str) -> str:
    return STAGES[product].scope if product in STAGES else "scene"


@dataclass
class Graph:
    """The steps of a run in an order in which each comes after its inputs; what was asked for, by scene.

    Attributes:
        steps: by id, in order.
        targets: ids of the products that were asked for, each with its variant.
        notes: what a person should know, such as scenes left out.
    """

    steps: dict[str, Step] = field(default_factory=dict)
    targets: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Request:
    """What is to be made.

    Attributes:
        dataset: the scenes.
        configs: one configuration, or several of a sweep, by the name of the variant (empty for a single one).
        upto: the product to stop at.
        train: train the networks instead of taking the shipped weights.
        training: the scenes to train on; needed with ``train``, and for products that are always learnt.
        notes: what a person should know of it.
        also: further products of each scene that has a truth, beside ``upto``.
        leave_out: leave out scenes that are trained on.
    """

    dataset: Dataset
    configs: Mapping[str, Config]
    upto: str = "metrics"
    train: bool = False
    training: tuple[SceneSource, ...] = ()
    notes: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    leave_out: bool = True

    def __post_init__(self) -> None:
        """Refuse a product that does not exist."""
        if self.upto not in ALL_PRODUCTS:
            raise UsageError(f"no product {self.upto!r}; {nearest(self.upto, ALL_PRODUCTS)}")


def build(request: Request) -> Graph:
    """Return the steps that a request needs.

    Raises:
        UsageError: if there is nothing to do, or settings do not go together.
        StageError: if shipped weights are needed and there are none.
    """
    graph = Graph(notes=list(request.notes))
    trained_on = [scene.image_identity() for scene in request.training if request.leave_out]
    for variant, config in request.configs.items():
        builder = _Builder(graph, config, request)
        graph.targets += [(step_id, variant) for step_id in _targets(builder, trained_on)]
    # The order of the products is one in which each comes after its inputs, whichever scenes they belong to.
    graph.steps = dict(sorted(graph.steps.items(), key=lambda item: ALL_PRODUCTS.index(item[1].product)))
    graph.notes = list(dict.fromkeys(graph.notes))
    if not graph.targets:
        raise UsageError(f"{request.dataset.spec}: no scene is left to work on; {'; '.join(graph.notes)}")
    return graph


def _targets(builder: "_Builder", trained_on: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Add what one configuration asks for, but for the pairs that are trained on; yield the ids of its last steps."""
    upto, notes = builder.request.upto, builder.graph.notes
    if upto in STAGES and STAGES[upto].scope == "split":
        yield builder.product(upto, None)
        return
    for scene in builder.request.dataset.scenes:
        if scene.image_identity() in trained_on:
            notes.append(f"{scene.name} is a training scene: it is left out, since nothing is tested on it")
        elif upto in ("truth", "metrics") and not scene.has_truth:
            notes.append(f"{scene.name} has no ground truth: there are no metrics for it")
            yield builder.product("images" if upto == "truth" else _known(scene, "semidense", notes), scene)
        else:
            yield from (builder.product(_known(scene, each, notes), scene) for each in (upto, *builder.request.also))


def needs_range(product: str) -> bool:
    """Return whether a product of a scene is made from costs, for which its range of disparities must be known."""
    return product != "truth" and ALL_PRODUCTS.index(product) >= ALL_PRODUCTS.index("costvolume")


def _known(scene: SceneSource, product: str, notes: list[str]) -> str:
    """Return the product, or the one to stop at while the scene's range is open."""
    if not (scene.open_ends and needs_range(product)):
        return product
    notes.append(f"{scene.name}: the range of disparities is estimated first; a run shows what comes after `survey`")
    return "survey"


@dataclass
class _Builder:
    """Adds the steps of one configuration to a graph.

    Attributes:
        graph: what the steps are added to.
        config: of these steps.
        request: what they are for.
        known: ids of the steps that it added, by product and scene.
    """

    graph: Graph
    config: Config
    request: Request
    known: dict[tuple[str, int], str] = field(default_factory=dict)

    def product(self, product: str, scene: SceneSource | None) -> str:
        """Add the step of a product, and before it those it is made from; return its id."""
        scene = None if _scope(product) == "split" else scene
        asked = product, id(scene)
        if asked not in self.known:
            self.known[asked] = self._add_product(product, scene)
        return self.known[asked]

    def _add_product(self, product: str, scene: SceneSource | None) -> str:
        if product == "images" and scene:
            return self._add_source(sources.IMAGES, scene, scene.image_identity())
        if product == "truth" and scene:
            bounds = [scene.disparities.minimum, scene.disparities.maximum]
            return self._add_source(sources.TRUTH, scene, scene.truth_identity() | {"range": bounds})
        trained = self.request.train and product not in self.config.training.shipped
        if product in LEARNT and not trained:
            return self._add_shipped(product)
        if product == "calibration":
            return self._calibration()
        stage = STAGES[product]
        if "channels" in stage.inputs:
            require_trainable(self.config, product)
        needed = getattr(self.config.section(product), "inputs", stage.inputs)
        inputs = {name: self._inputs(stage, name, scene) for name in stage.inputs if name in needed}
        return self._add_stage(stage, scene, inputs)

    def _inputs(self, stage: Stage, product: str, scene: SceneSource | None) -> tuple[str, ...]:
        if stage.scope == "split" and _scope(product) == "scene":
            return tuple(self.product(product, source) for source in self.request.training)
        return (self.product(product, scene),)

    def _calibration(self) -> str:
        """Add the calibration, for which all networks that score a training scene learnt from other folds."""
        scenes = self.request.training
        config = with_folds(self.config, [scene.name for scene in scenes])
        folds = config.calibration.fold_of_scene or ()
        requests = {fold: replace(self.request, training=outside(scenes, folds, fold)) for fold in set(folds)}
        builders = {fold: replace(self, config=config, request=requests[fold], known={}) for fold in requests}
        stage = STAGES["calibration"]
        inputs = {
            name: tuple(builders[fold].product(name, scene) for scene, fold in zip(scenes, folds, strict=True))
            for name in stage.inputs
        }
        return replace(self, config=config)._add_stage(stage, None, inputs)

    def _add_source(self, stage: Stage, scene: SceneSource, identity: Mapping[str, Any]) -> str:
        code = code_parts(stage.module, PACKAGES) | code_parts(scene.reader, PACKAGES)
        return self._add(stage, scene, scene, identity, {}, code)

    def _add_shipped(self, product: str) -> str:
        stage, name = shipped.WEIGHTS[product], shipped.weights_name(product, self.config.costvolume.mode)
        settings = {"shipped": shipped.weights_digest(name)}
        return self._add(stage, None, name, settings, {}, code_parts(stage.module, PACKAGES))

    def _add_stage(self, stage: Stage, scene: SceneSource | None, inputs: Mapping[str, tuple[str, ...]]) -> str:
        params = resolved(self.config.section(stage.product), scene)
        settings = params.model_dump(mode="json") | {"tiles": stage.tiling(params)}
        return self._add(stage, scene, params, settings, inputs, code_parts(stage.module, PACKAGES))

    @cached_property
    def _settings(self) -> dict[str, Any]:
        return self.config.model_dump(mode="json")

    def _configuration(self, product: str, argument: object) -> dict[str, Any]:
        """Return all settings, a step's own as they were resolved for it."""
        own = {product: argument.model_dump(mode="json")} if isinstance(argument, Params) else {}
        return {**self._settings, **(own if product in self._settings else {})}

    def _add(
        self,
        stage: Stage,
        scene: SceneSource | None,
        argument: object,
        settings: Mapping[str, Any],
        inputs: Mapping[str, tuple[str, ...]],
        code: Mapping[str, str],
    ) -> str:
        name, dataset, size = (scene.name, scene.dataset, scene.size) if scene else (SPLIT, SPLIT, None)
        identity = json.dumps([stage.product, name, dataset, size, settings, inputs], sort_keys=True)
        step_id = hashlib.sha256(identity.encode()).hexdigest()[:16]
        if step_id not in self.graph.steps:
            filtered = stage.product in ("semidense", "metrics") and self.config.semidense.by_R
            self.graph.steps[step_id] = Step(
                id=step_id,
                stage=stage,
                scene=name,
                dataset=dataset,
                argument=argument,
                settings=dict(settings),
                inputs=dict(inputs),
                size=size,
                code=dict(code),
                environment=environment(stage),
                R=self.config.semidense.R if filtered else None,
                configuration=self._configuration(stage.product, argument),
            )
        return step_id
