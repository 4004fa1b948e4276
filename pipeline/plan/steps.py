"""The steps of a run: which products are made from which, for the scenes and configurations at hand.

A step is a product of one scene (or of the training split) with its settings. Several configurations
share the steps in which they agree, so a sweep computes nothing twice. Nothing here looks at a cache.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from semidense.cache import Recipe, code_parts
from semidense.datasets import Dataset, SceneSource
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.shipped_weights import Weights
from semidense.stages.catalog import READ, STAGES
from semidense.stages.stage import NoParams, Params, Stage

NETS = ("matching_net", "descriptor_net", "evaluation_net")
"""Products that are networks."""
SPLIT = "training split"
"""Stands for a scene in steps that belong to all training scenes together."""
_NAMED = 3
"""Scenes that a note on many names; the others are counted."""
Argument = Params | SceneSource | Weights
"""What the function of a step is given first: its settings, or what it reads."""


def products() -> tuple[str, ...]:
    """Return the names that ``--upto`` takes, in an order in which each comes after those it is made from."""
    return (*READ, *STAGES)


def place(product: str) -> int:
    """Return the position of a product in that order; one whose package is not installed any more stands last."""
    return [*products(), product].index(product)


@dataclass(frozen=True, repr=False)
class Step:
    """One product of one scene, or of the training split.

    Attributes:
        id: names product, scene and everything it is made from; equal for equal work.
        stage: its declaration.
        scene: the scene's name, or ``SPLIT``.
        dataset: the scene's dataset, without a path.
        argument: what its function is given first: its settings, or what it reads.
        settings: the part of the key that says how: plain JSON.
        inputs: ids of the steps it is made from, by product; of a split step, one a training scene.
        size: rows and columns of the image; None for a split step.
        code: hash of every module that decides the result.
        environment: what else changes its bits.
        R: the confidence threshold that a product below ``semidense`` was made with.
        configuration: all settings of the first variant that needs it, with its own as they were resolved.
        asked: the same as they were asked for, without what was found for a scene.
    """

    id: str
    stage: Stage
    scene: str
    dataset: str
    argument: Argument
    settings: Mapping[str, Any]
    inputs: Mapping[str, tuple[str, ...]]
    size: tuple[int, int] | None
    code: Mapping[str, str]
    environment: Mapping[str, str]
    R: float | None = None
    configuration: Mapping[str, Any] = field(default_factory=dict)
    asked: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return product and scene."""
        return f"<Step {self.name}>"

    @property
    def product(self) -> str:
        """The name of its product."""
        return self.stage.product

    @property
    def params(self) -> Params:
        """Its settings; those of a product that is read are empty."""
        return self.argument if isinstance(self.argument, Params) else NoParams()

    @property
    def label(self) -> dict[str, str]:
        """What people call its result, whatever its settings."""
        return {"product": self.product, "dataset": self.dataset, "scene": self.scene}

    @property
    def name(self) -> str:
        """Product and scene, for messages."""
        return f"{self.product} of {self.scene}"

    @property
    def tile_rows(self) -> int | None:
        """Rows of one of its tiles; None if it is not tiled."""
        if self.stage.tile_rows is None or self.size is None:
            return None
        return self.stage.tile_rows * self.stage.chunks_a_tile(self.params, self.size[1])

    @property
    def tiles(self) -> int:
        """How many tasks make it: one a tile."""
        if self.tile_rows is None or self.size is None:
            return 1
        return -(-self.size[0] // self.tile_rows)

    @property
    def lengths(self) -> dict[str, int]:
        """How long the dimensions of its arrays are, as far as that is known before it is made."""
        image = {"y": self.size[0], "x": self.size[1]} if self.size else {}
        return {**image, **self.stage.sizes(self.params)}

    @property
    def declared_bytes(self) -> int | None:
        """Bytes of its arrays before compression; None where a length or a type is known only once it is made."""
        sizes = self.lengths
        if self.size is None or any(each.dtype is None or not {*each.dims} <= {*sizes} for each in self.stage.outputs):
            return None
        return sum(prod(sizes[dim] for dim in each.dims) * np.dtype(each.dtype).itemsize for each in self.stage.outputs)

    def recipe(self, digests: Mapping[str, str]) -> Recipe:
        """Return the recipe, given the output digest of each input step by its id."""
        inputs: dict[str, str | list[str]] = {
            product: [digests[step] for step in ids] if self.takes_list(product) else digests[ids[0]]
            for product, ids in self.inputs.items()
        }
        return Recipe(self.product, self.code, self.settings, inputs, self.environment)

    def takes_list(self, product: str) -> bool:
        """Return whether an input comes once for each training scene."""
        return self.stage.scope == "split" and scope_of(product) == "scene"


def scope_of(product: str) -> str:
    """Return whether a product is made for each scene or once for the training split."""
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
        if self.upto not in products():
            raise UsageError(f"no product {self.upto!r}; {nearest(self.upto, products())}")


def made_from(product: str) -> frozenset[str]:
    """Return a product of a scene and all that it is made from; what is learnt from other scenes is left out."""
    stage = STAGES.get(product)
    inputs = stage.inputs if stage and stage.scope == "scene" else ()
    return frozenset({product}).union(*(made_from(each) for each in inputs))


def needs_range(product: str) -> bool:
    """Return whether the range of disparities must be known for a product of a scene."""
    stages = (STAGES[each] for each in made_from(product) if each in STAGES)
    return any("d_min" in stage.params.model_fields for stage in stages)


def code_of(*modules: str) -> dict[str, str]:
    """Return the hashes of modules and of all that they import from this package or their own."""
    packages = ("semidense", *(module.partition(".")[0] for module in modules))
    return {name: part for module in modules for name, part in code_parts(module, tuple(sorted({*packages}))).items()}


def without_truth(product: str) -> str:
    """Return the last product on the way to one that needs a truth which can be made without it."""
    ways = [each for each in products() if each in made_from(product) and "truth" not in made_from(each)]
    return ways[-1] if ways else READ[0]


def known_so_far(scene: SceneSource, product: str, unknown: list[str]) -> str:
    """Return the product, or the one to stop at while the scene's range is open; add its name to the unknown then."""
    if not (scene.open_ends and needs_range(product)):
        return product
    unknown.append(scene.name)
    return "survey"


def named(scenes: Sequence[str]) -> str:
    """Return the names of scenes for a sentence; of many the first, and how many more there are.

    >>> named(["a"]), named(["a", "b"]), named([*"abcdefg"])
    ('a', 'a and b', 'a, b, c and 4 more')
    """
    if len(scenes) > _NAMED + 1:
        return f"{', '.join(scenes[:_NAMED])} and {len(scenes) - _NAMED} more"
    return " and ".join(filter(None, (", ".join(scenes[:-1]), scenes[-1])))


def note_on(scenes: Sequence[str], one: str, several: str) -> list[str]:
    """Return one note on scenes, however many they are; none on none.

    Args:
        scenes: their names; a repeated one counts once.
        one: what is said of a single scene, after its name.
        several: what is said of several, after their names.
    """
    names = list(dict.fromkeys(scenes))
    return [f"{named(names)} {one if len(names) == 1 else several}"] if names else []


def doubts(scenes: Sequence[SceneSource]) -> Iterator[str]:
    """Yield each warning once, after the names of its scenes."""
    found: dict[str, list[str]] = {}
    for scene in scenes:
        for warning in scene.warnings:
            found.setdefault(warning, []).append(scene.name)
    yield from (f"{named(names)}: {warning}" for warning, names in found.items())


def notes(
    upto: str, trained: Sequence[str], learnt: Sequence[str], untold: Sequence[str], unknown: Sequence[str]
) -> Iterator[str]:
    """Yield a note on the scenes of each kind: trained on, perhaps known to the weights, without truth, or range."""
    is_, are = "is a training scene:", "are training scenes:"
    left_out = "left out, since nothing is tested on"
    yield from note_on(trained, f"{is_} it is {left_out} it", f"{are} they are {left_out} them")
    known = "the package's weights may have learnt from"
    yield from note_on(
        learnt, f"{is_} {known} it, so its figures are no test", f"{are} {known} them, so their figures are no test"
    )
    lacks = f"no ground truth: no {upto} can be made for"
    yield from note_on(untold, f"has {lacks} it", f"have {lacks} them")
    open_ = "no known range of disparities: it is estimated first; a run shows what comes after `survey`"
    yield from note_on(unknown, f"has {open_}", f"have {open_}")
