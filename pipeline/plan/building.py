"""Build the steps of a request: what each product is made from, and with which settings.

Several configurations share the steps in which they agree, so a sweep computes nothing twice. No cache is looked at.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from pydantic import ValidationError

from semidense.datasets import SceneSource
from semidense.pipeline.plan.config import Config, one_line
from semidense.pipeline.plan.environment import environment
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.images_and_truth import Source, require_views, source_of
from semidense.pipeline.plan.shipped_weights import Weights, weights_of, weights_stage
from semidense.pipeline.plan.steps import (
    SPLIT,
    Argument,
    Graph,
    Request,
    Step,
    code_of,
    doubts,
    known_so_far,
    made_from,
    notes,
    place,
    scope_of,
    without_truth,
)
from semidense.pipeline.plan.training_split import held_out_scenes, outside, require_trainable, spread, with_folds
from semidense.stages.catalog import STAGES
from semidense.stages.compute.precision import resolve
from semidense.stages.evaluation.calibration.declaration import CalibrationParams
from semidense.stages.evaluation.filtering import SemidenseParams
from semidense.stages.stage import Params, Stage


def build(request: Request) -> Graph:
    """Return the steps that a request needs.

    Raises:
        UsageError: if there is nothing to do, or settings do not go together.
        StageError: if shipped weights are needed and there are none.
    """
    graph = Graph(notes=[*request.notes, *doubts(request.dataset.scenes)])
    trained_on = [scene.image_identity() for scene in request.training if request.leave_out]
    for variant, config in request.configs.items():
        builder = _Builder(graph, config, request)
        graph.targets += [(step_id, variant) for step_id in _targets(builder, trained_on)]
    graph.steps = dict(sorted(graph.steps.items(), key=lambda item: place(item[1].product)))
    graph.notes = [*dict.fromkeys(graph.notes)]
    if not graph.targets:
        raise UsageError(f"{request.dataset.spec}: no scene is left to work on; {'; '.join(graph.notes) or 'none'}")
    return graph


def _targets(builder: "_Builder", trained_on: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Add what one configuration asks for, but for the pairs that are trained on; yield the ids of its last steps."""
    upto = builder.request.upto
    if upto in STAGES and STAGES[upto].scope == "split":
        yield builder.product(upto, None)
        return
    if builder.config.training.held_out:
        yield from builder.held_out(upto)
        return
    trained, learnt, untold, unknown = list[str](), list[str](), list[str](), list[str]()
    judged = "truth" in made_from(upto)
    for scene in builder.request.dataset.scenes:
        if trained_on and scene.image_identity() in trained_on:
            trained.append(scene.name)
        elif judged and not scene.has_truth:
            untold.append(scene.name)
            yield builder.product(known_so_far(scene, without_truth(upto), unknown), scene)
        else:
            if judged and scene.split == "train" and not builder.request.training:
                learnt.append(scene.name)
            yield from (
                builder.product(known_so_far(scene, each, unknown), scene) for each in (upto, *builder.request.also)
            )
    builder.graph.notes += notes(upto, trained, learnt, untold, unknown)


@dataclass
class _Builder:
    """Adds the steps of one configuration to a graph.

    Attributes:
        graph: what the steps are added to.
        config: of these steps.
        request: what they are for.
        known: ids of the steps that it added, by product and scene.
        unseeing: by training scene, the builder whose networks have not seen it; folds share it with the whole.
        mapped: ids of the training scenes whose maps are learnt from; folds have those of the whole.
    """

    graph: Graph
    config: Config
    request: Request
    known: dict[tuple[str, int], str] = field(default_factory=dict)
    unseeing: dict[int, "_Builder"] = field(default_factory=dict)
    mapped: set[int] = field(default_factory=set)

    def product(self, product: str, scene: SceneSource | None) -> str:
        """Add the step of a product, and before it those it is made from; return its id."""
        scene = None if scope_of(product) == "split" else scene
        asked = product, id(scene)
        if asked not in self.known:
            self.known[asked] = self._add_product(product, scene)
        return self.known[asked]

    def held_out(self, product: str) -> Iterator[str]:
        """Add a product of each training scene that was asked for, made by networks that have not seen it."""
        dataset = self.request.dataset
        judged = held_out_scenes(self.config, dataset, self._mapped() if self.request.train else ())
        if len(judged) < (asked := sum(scene.split == "train" for scene in dataset.scenes)):
            self.graph.notes.append(
                f"training.held_out judges {len(judged)} of {asked} training scenes: those that the confidence "
                "learns from (training.maps says how many of each data set)"
            )
        yield from (self._not_having_seen(scene).product(product, scene) for scene in judged)

    def _add_product(self, product: str, scene: SceneSource | None) -> str:
        if scene and (source := source_of(product, scene)):
            return self._add_source(source, scene)
        if product not in STAGES:
            raise UsageError(f"{product} is read from a scene: name a dataset")
        if STAGES[product].learnt and (weights := self._weights(product)):
            return self._add(weights_stage(product), None, weights, {"shipped": weights.digest}, {})
        if STAGES[product].cross_fitted:
            return self._add_cross_fitted(product)
        stage, params = self._chosen(product)
        if "channels" in stage.inputs:
            require_trainable(self.config, product)
        params = resolved(params, scene)
        require_views(stage, scene)
        needed = getattr(params, "inputs", stage.inputs)
        if scene and "calibration" in needed and source_of("costvolume", scene):
            self._require_own_calibration(scene)
        inputs = {name: self._inputs(stage, name, scene) for name in stage.inputs if name in needed}
        return self._add_stage(stage, params, scene, inputs)

    def _require_own_calibration(self, scene: SceneSource) -> None:
        """Refuse a calibration of our costs for those of another matcher: it says nothing about them."""
        if not self.config.choice("weights", "calibration"):
            raise UsageError(
                f"{scene.name}: its costs come from a file, and no calibration of maps of such costs is known; "
                "give R or a density instead, or a calibration of your own (weights.calibration=FILE)"
            )

    def _weights(self, product: str) -> Weights | None:
        """Return the file that stands in for learning a product; None if it is learnt."""
        trained = self.request.train and product not in self.config.training.shipped
        return None if trained and not self.config.choice("weights", product) else weights_of(self.config, product)

    def _chosen(self, product: str) -> tuple[Stage, Params]:
        """Return the stage that makes a product, and its settings: its own, or the one that ``use`` names.

        Raises:
            UsageError: if that one makes something else, or is made from the product itself.
        """
        other = self.config.choice("use", product) or product
        if other not in STAGES:
            raise UsageError(f"use.{product} = {other!r}: no product {other!r}; {nearest(other, STAGES)}")
        if (stage := STAGES[other]) is (own := STAGES[product]):
            return stage, self.config.section(stage.section or other)
        arrays = {output.name: output.dims for output in stage.outputs}
        missing = [output.name for output in own.outputs if arrays.get(output.name) != output.dims]
        if missing or stage.scope != own.scope or product in made_from(other):
            why = f"it has no array {missing[0]!r} with its dimensions" if missing else f"it is made from {product}"
            raise UsageError(f"use.{product} = {other!r}: {other} cannot take the place of {product}, {why}")
        stage = replace(stage, product=product, section=stage.section or other)
        return stage, self.config.section(stage.section)

    def _inputs(self, stage: Stage, product: str, scene: SceneSource | None) -> tuple[str, ...]:
        if not (stage.scope == "split" and scope_of(product) == "scene"):
            return (self.product(product, scene),)
        if not any("costvolume" in made_from(each) for each in stage.inputs):
            return tuple(self.product(product, source) for source in self.request.training)
        if self.request.training and not self._mapped():
            raise UsageError(f"{stage.product}: its maps are of one fold; change training.maps or calibration.folds")
        cross_fitted = stage.cross_fitted or self.config.training.cross_fit
        return tuple(
            (self._not_having_seen(source) if cross_fitted else self).product(product, source)
            for source in self._mapped()
        )

    def _add_cross_fitted(self, product: str) -> str:
        """Add a product of all training scenes, each scored by networks that learnt from other folds."""
        stage, config = STAGES[product], self._with_folds()
        inputs = {name: self._inputs(stage, name, None) for name in stage.inputs}
        params = config.of(product, CalibrationParams)
        every = zip(self.request.training, params.fold_of_scene or (), strict=True)
        folds = tuple(fold for scene, fold in every if scene in self._mapped())
        params = params.model_copy(update={"fold_of_scene": folds})
        return replace(self, config=config)._add_stage(stage, resolved(params, None), None, inputs)

    def _mapped(self) -> list[SceneSource]:
        """Return the training scenes whose maps are learnt from; a fold has those that the whole has."""
        scenes = self.request.training
        self.mapped = self.mapped or {id(scene) for scene in spread(scenes, self.config.training.maps)}
        return [scene for scene in scenes if id(scene) in self.mapped]

    def _with_folds(self) -> Config:
        return with_folds(self.config, [scene.name for scene in self.request.training])

    def _not_having_seen(self, scene: SceneSource) -> "_Builder":
        """Return the builder whose networks learn from the folds that a training scene is not in."""
        if not self.unseeing:
            scenes, config = self.request.training, self._with_folds()
            folds = config.of("calibration", CalibrationParams).fold_of_scene or ()
            requests = {fold: replace(self.request, training=outside(scenes, folds, fold)) for fold in set(folds)}
            builders = {fold: replace(self, config=config, request=requests[fold], known={}) for fold in requests}
            self.unseeing.update({id(each): builders[fold] for each, fold in zip(scenes, folds, strict=True)})
        return self.unseeing[id(scene)]

    def _add_source(self, source: Source, scene: SceneSource) -> str:
        identity = source.identity(scene)
        known = replace(scene, digests=identity["files"])  # what is read must be what the key names
        return self._add(source.stage, scene, known, identity, {}, source.reader or scene.reader)

    def _add_stage(
        self, stage: Stage, params: Params, scene: SceneSource | None, inputs: Mapping[str, tuple[str, ...]]
    ) -> str:
        settings = params.model_dump(mode="json") | {"tiles": stage.tiling(params)} | stage.plugin_identity
        return self._add(stage, scene, params, settings, inputs)

    @cached_property
    def _settings(self) -> dict[str, Any]:
        return self.config.to_dict()

    def _configuration(self, product: str, argument: object) -> dict[str, Any]:
        """Return all settings, a step's own as they were resolved for it."""
        own = argument.model_dump(mode="json") if isinstance(argument, Params) else {}
        return {name: own or known if name == product else known for name, known in self._settings.items()}

    def _add(
        self,
        stage: Stage,
        scene: SceneSource | None,
        argument: Argument,
        settings: Mapping[str, Any],
        inputs: Mapping[str, tuple[str, ...]],
        *modules: str,
    ) -> str:
        name, dataset, size = (scene.name, scene.dataset, scene.size) if scene else (SPLIT, SPLIT, None)
        identity = json.dumps([stage.product, name, dataset, size, settings, inputs], sort_keys=True)
        step_id = hashlib.sha256(identity.encode()).hexdigest()[:16]
        if step_id not in self.graph.steps:
            semidense = self.config.of("semidense", SemidenseParams)
            filtered = semidense.by_R and "semidense" in (stage.product, *stage.inputs)
            self.graph.steps[step_id] = Step(
                id=step_id,
                stage=stage,
                scene=name,
                dataset=dataset,
                argument=argument,
                settings=dict(settings),
                inputs=dict(inputs),
                size=size,
                code=code_of(stage.module, *modules),
                environment=environment(stage),
                R=semidense.R if filtered else None,
                configuration=self._configuration(stage.product, argument),
                asked=self._settings,
            )
        return step_id


def resolved(params: Params, scene: SceneSource | None) -> Params:
    """Return the settings with what was left open filled in: the scene's range, this CPU's precision."""
    settings, update = dict(params), dict[str, Any]()
    if "precision" in settings:
        update["precision"] = resolve(settings["precision"], transformed=getattr(params, "transformed", False))
    if scene:
        _require_within(settings, scene)
        known = {
            "right": not scene.one_view,
            "d_min": max(scene.disparities.minimum, 1 - scene.size[1]),
            "d_max": min(scene.disparities.maximum, scene.size[1] - 1),  # a file may claim any number
        }
        update |= {name: value for name, value in known.items() if settings.get(name, value) is None}
    if not update:
        return params
    try:
        return type(params).model_validate(settings | update)
    except ValidationError as error:
        raise UsageError(f"{scene.name if scene else 'training split'}: {one_line(error)}") from None


def _require_within(settings: Mapping[str, Any], scene: SceneSource) -> None:
    """Refuse a range that no pixel of the image can have: it would only fill memory and disk."""
    for name in ("d_min", "d_max"):
        if abs(value := settings.get(name) or 0) >= scene.size[1]:
            raise UsageError(f"{scene.name}: {name} is {value} px, but the image is only {scene.size[1]} px wide")
