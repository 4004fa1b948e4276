"""The scenes to train on; and their folds, so that each can be scored by networks that have not seen it."""

from collections.abc import Sequence
from typing import TypeVar

from semidense.datasets import Dataset, SceneSource
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.catalog import STAGES
from semidense.stages.evaluation.calibration.declaration import CalibrationParams
from semidense.stages.evaluation.filtering import SemidenseParams
from semidense.stages.learning.schedule import Schedule
from semidense.stages.stage import Params
from semidense.stages.transforms.declaration import ChannelsParams

_Scene = TypeVar("_Scene")


def training_scenes(dataset: Dataset) -> tuple[SceneSource, ...]:
    """Return the scenes of a dataset that may be trained on and have a truth.

    Raises:
        UsageError: if there is none.
    """
    scenes = tuple(scene for scene in dataset.scenes if scene.split == "train" and scene.has_truth)
    if not scenes:
        raise UsageError(
            f"{dataset.spec} has no training scene: name a dataset that has some with "
            "--set training.dataset=middlebury:DIR"
        )
    return scenes


def with_folds(config: Config, names: Sequence[str]) -> Config:
    """Return the configuration of the folds: which scenes are in which, and the schedule of their networks.

    All networks of a fold are trained, since those that come with the package have seen its scenes, for so many steps
    that they see a scene as often as the networks of all scenes do.

    Raises:
        UsageError: if the folds that are set do not fit the scenes, or there are fewer scenes than folds.
    """
    params = config.of("calibration", CalibrationParams)
    folds = params.fold_of_scene or assign_folds(names, params.folds)
    if len(folds) != len(names) or len(set(folds)) < 2:
        raise UsageError(
            f"calibration.fold_of_scene names {len(set(folds))} folds of {len(folds)} scenes; there are {len(names)} "
            "training scenes, and it takes two folds at least"
        )
    share = 1 - 1 / len(set(folds))
    sections = {stage.product: config.section(stage.product) for stage in STAGES.values() if stage.learnt}
    nets = {name: net for name, net in sections.items() if isinstance(net, Schedule)}
    update: dict[str, Params] = {name: net.shortened(share) for name, net in nets.items()}
    update["calibration"] = params.model_copy(update={"fold_of_scene": folds})
    update["training"] = config.training.model_copy(update={"shipped": ()})
    update["weights"] = type(config.section("weights"))()
    return config.model_copy(update=update)


def held_out_scenes(config: Config, dataset: Dataset, training: Sequence[SceneSource]) -> list[SceneSource]:
    """Return the training scenes that are judged by networks of the other folds: those of the dataset.

    Raises:
        UsageError: if nothing is trained, the dataset has no training scene, or a calibration would be needed.
    """
    if not training:
        raise UsageError("training.held_out judges the training scenes by networks of other scenes: add --train")
    semidense = config.of("semidense", SemidenseParams)
    if semidense.calibrated or semidense.max_error is not None:
        raise UsageError("training.held_out: its networks have no calibration; give R or a density instead")
    asked = {(scene.dataset, scene.name) for scene in dataset.scenes}
    scenes = [scene for scene in training if (scene.dataset, scene.name) in asked]
    if not scenes:
        raise UsageError(f"{dataset.spec}: training.held_out judges training scenes, and none is named")
    return scenes


def outside(scenes: Sequence[_Scene], folds: Sequence[int], fold: int) -> tuple[_Scene, ...]:
    """Return the scenes that are not of a fold.

    >>> outside("abc", folds=(0, 1, 1), fold=0)
    ('b', 'c')
    """
    return tuple(scene for scene, other in zip(scenes, folds, strict=True) if other != fold)


def spread(scenes: Sequence[SceneSource], most: int | None) -> tuple[SceneSource, ...]:
    """Return at most so many scenes of each data set, evenly spread over it, in their order; all for None."""
    if most is None:
        return tuple(scenes)
    sets: dict[str, list[SceneSource]] = {}
    for scene in scenes:
        sets.setdefault(scene.dataset, []).append(scene)
    return tuple(scene for each in sets.values() for scene in _every_so_often(each, min(most, len(each))))


def _every_so_often(scenes: Sequence[_Scene], count: int) -> list[_Scene]:
    """Return so many of the scenes, evenly spread.

    >>> _every_so_often("abcdef", 2)
    ['c', 'f']
    """
    total = len(scenes)
    return [scene for place, scene in enumerate(scenes) if (place + 1) * count // total > place * count // total]


def assign_folds(names: Sequence[str], folds: int) -> tuple[int, ...]:
    """Return the fold of each scene: the smallest one so far, siblings together.

    Raises:
        UsageError: if there are fewer scenes than folds.

    >>> assign_folds(["Art", "Cloth1", "Cloth2", "Dolls"], folds=2)
    (0, 1, 1, 0)
    """
    if len(names) < folds:
        raise UsageError(f"{folds} folds take {folds} scenes at least, one each, and there are {len(names)}")
    each = families(names, folds)
    fold_of: dict[str, int] = {}
    sizes = [0] * folds
    for family in each:
        fold = fold_of.setdefault(family, sizes.index(min(sizes)))
        sizes[fold] += 1
    return tuple(fold_of[family] for family in each)


def families(names: Sequence[str], fewest: int = 2) -> list[str]:
    """Return what each name shares with its siblings: such as ``Cloth1`` and ``Cloth2``, they show much the same.

    With fewer families than ``fewest`` each goes its own way.

    >>> families(["Art", "Cloth1", "Cloth2"])
    ['Art', 'Cloth', 'Cloth']
    """
    shared = [name.rstrip("0123456789") for name in names]
    return shared if len(set(shared)) >= fewest else list(names)


def require_trainable(config: Config, product: str) -> None:
    """Refuse to train with another light where the first channel is not a standardised gray one.

    Raises:
        UsageError: if the product's ``relight`` is on and ``channels.use`` leaves gray out or ``channels.gray`` is raw.
    """
    if not getattr(config.section(product), "relight", 0):
        return
    channels = config.of("channels", ChannelsParams)
    if "gray" not in channels.use:
        told = f"{product}.relight changes the light of the gray channel, which channels.use leaves out"
        raise UsageError(f"{told}: set {product}.relight=0")
    if channels.gray == "raw":
        told = f"{product}.relight changes the light of a standardized gray channel, and channels.gray is raw"
        raise UsageError(f"{told}: set {product}.relight=0")
