"""The paper's own protocols, more lenient than ours: they also train on the test pairs, or on pairs like them."""

import dataclasses
import re
from collections.abc import Sequence

from semidense.datasets import Dataset, SceneSource
from semidense.pipeline.api import Task
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.plan.training_split import assign_folds, outside

FOLDS = 2
"""Number of parts of the scenes; each part is tested with networks trained on the others."""
PROTOCOLS = {"same": "trained on the same pairs", "folds": f"{FOLDS}-fold"}
"""The name of each protocol in tables, by the name that ``--protocol`` takes."""


def require_protocols(names: Sequence[str]) -> None:
    """Raise a UsageError if a protocol does not exist."""
    for name in names:
        if name not in PROTOCOLS:
            raise UsageError(f"no protocol {name!r}; {nearest(name, PROTOCOLS)}")


def protocol_requests(name: str, task: Task, dataset: Dataset, training: tuple[SceneSource, ...]) -> list[Request]:
    """Return the requests that train and test both networks by a protocol.

    Args:
        name: of ``PROTOCOLS``.
        task: gives the settings.
        dataset: the scenes to test on; those that are among ``training`` are left out.
        training: further scenes to learn from; with ``same`` none of them is used.

    Raises:
        UsageError: if there are fewer scenes than folds.
    """
    seen = [scene.image_identity() for scene in training]
    scenes = tuple(scene for scene in dataset.scenes if scene.image_identity() not in seen)
    plain = task.request("semidense")
    tested = dataclasses.replace(dataset, scenes=scenes)
    wanted = dataclasses.replace(plain, dataset=tested, train=True, also=("truth", "disparity", "confidence"))
    if name == "same":
        return [dataclasses.replace(wanted, training=scenes, leave_out=False)]
    folds = assign_folds([_place(scene) for scene in scenes], FOLDS)
    parts = {
        fold: tuple(scene for scene, other in zip(scenes, folds, strict=True) if other == fold)
        for fold in sorted(set(folds))
    }
    return [
        dataclasses.replace(
            wanted,
            dataset=dataclasses.replace(dataset, scenes=part),
            training=(*training, *outside(scenes, folds, fold)),
        )
        for fold, part in parts.items()
    ]


def _place(scene: SceneSource) -> str:
    """Return a scene's name without Middlebury's last letter: E, another exposure, or L, another lighting."""
    return re.sub(r"(?<=[a-z])[EL]$", "", scene.name)
