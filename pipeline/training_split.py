"""The scenes to train on; and their folds, so that each can be scored by a network that has not seen it."""

from collections.abc import Sequence
from typing import TypeVar

from datasets import Dataset, SceneSource
from pipeline.config import Config
from pipeline.errors import UsageError

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
    """Return the configuration with a fold for each training scene, and with the schedule of the folds' networks.

    Raises:
        UsageError: if the folds that are set do not fit the scenes, or there are fewer scenes than folds.
    """
    params = config.calibration
    folds = params.fold_of_scene or assign_folds(names, params.folds)
    if len(folds) != len(names) or len(set(folds)) < 2:
        raise UsageError(
            f"calibration.fold_of_scene names {len(set(folds))} folds of {len(folds)} scenes; there are {len(names)} "
            "training scenes, and it takes two folds at least"
        )
    parts = len(set(folds))
    # A network of a fold sees a scene as often as the network of all does.
    steps = params.steps or max(1, round(config.evaluation_net.steps * (parts - 1) / parts))
    update = {
        "calibration": params.model_copy(update={"fold_of_scene": folds}),
        "evaluation_net": config.evaluation_net.model_copy(update={"steps": steps}),
    }
    return config.model_copy(update=update)


def outside(scenes: Sequence[_Scene], folds: Sequence[int], fold: int) -> tuple[_Scene, ...]:
    """Return the scenes that are not of a fold.

    >>> outside("abc", folds=(0, 1, 1), fold=0)
    ('b', 'c')
    """
    return tuple(scene for scene, other in zip(scenes, folds, strict=True) if other != fold)


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
