"""Score a disparity map that another matcher made: ``pipeline.score``, and what comes back from it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike, fspath
from typing import Any

import numpy as np

from semidense.datasets import Dataset, DisparityRange, open_dataset
from semidense.datasets.pairs.arrays import array_pair
from semidense.datasets.pairs.options import PairOptions, file_names, pair_spec
from semidense.pipeline.api import Cache, Task, run
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.pairs.findings import same_picture
from semidense.pipeline.pairs.match import Match, Unit
from semidense.pipeline.pairs.wishes import Wishes, with_wishes
from semidense.pipeline.plan.config import Settings
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.presets import FOREIGN

_WISHES = ("R", "density", "max_error")
"""What can be wished of a map that is there: it is filtered, and nothing else."""


class Score(Match):
    """A map of another matcher with its confidence; `Match` says what its attributes hold.

    ``raw`` is the map as it was read, ``disparity`` what is left of it.
    """

    @property
    def disparities(self) -> DisparityRange:
        """The range of the map, or of its scene."""
        return self.scene.disparities

    @cached_property
    def misfits(self) -> list[str]:
        """Nothing: no look was taken at how the views fit together."""
        return []

    @property
    def warnings(self) -> list[str]:
        """What looks wrong: with the files, one view given twice, a map that fits better in another reading."""
        return [*self.scene.warnings, *self._misread]

    @cached_property
    def _misread(self) -> list[str]:
        from semidense.stages.evaluation.evidence.foreign.misreading import misreading
        from semidense.stages.transforms.gray import to_gray

        if self.scene.one_view:
            return []
        left, right = to_gray(self.image), to_gray(self._array("images", "right"))
        if same := same_picture(float(np.mean(left == right))):
            return same
        found = misreading(left, right, self.raw)
        return [] if found is None else [found]


def score(
    left: object,
    disparity: object,
    right: object | None = None,
    *,
    scale: float | None = None,
    none: float | None = None,
    calib: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    unit: Unit | None = None,
    settings: Settings = (),
    cache: Cache = None,
    watch: Watch | None = None,
    workers: int | None = None,
    **wishes: Any,  # noqa: ANN401 - those of Wishes
) -> Score:
    """Say how far a disparity map that another matcher made can be trusted, reusing all that is cached.

    Args:
        left: a file, or (y, x), (y, x, 3) RGB, uint8 or uint16: the view that the map belongs to.
        disparity: a file (PFM, PNG, TIFF, NPY), or (y, x) of any numbers: its map, ``x_right = x_left - d``.
        right: the other view; with it, our own costs of the map's disparities are asked too, which tells much more.
        scale: stored value of 1 px, below 0 to turn the sign; None: recognised, or refused.
        none: stored value of pixels without a disparity; None: recognised. NaN and infinity always are.
        calib: a calibration file, for depth and points.
        unit: of a calibration that does not tell it.
        settings: settings of the configuration, over those of the preset ``foreign``.
        cache: the cache's folder or URL, or an opened cache.
        watch: told how it goes on.
        workers: threads; None for one a core.
        **wishes: ``R``, ``density`` or ``max_error``; see `Wishes`, whose other attributes are for `match` alone.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
    """
    if beyond := [name for name in wishes if name not in _WISHES]:
        raise UsageError(f"score takes no {beyond[0]}; it takes {', '.join(_WISHES)}, one of them")
    if disparity is None:
        raise UsageError("the disparity map is None: was its file read?")
    options = PairOptions(file_names(calib), unit, scale=scale, none=none)
    dataset = _dataset(left, disparity, right, options)
    task = Task(dataset, settings=settings, cache=cache, preset=FOREIGN)
    return score_one(task, Wishes(**wishes), watch=watch, workers=workers)


def _dataset(left: object, disparity: object, right: object | None, options: PairOptions) -> Dataset:
    paths = [fspath(each) for each in (left, right, disparity) if isinstance(each, str | PathLike)]
    if len(paths) < 2 + (right is not None):
        return array_pair(left, right, options, disparity=disparity)
    return open_dataset(pair_spec(paths[:-1], replace(options, disparity=paths[-1])))


def score_one(
    task: Task,
    wishes: Wishes,
    *,
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Score:
    """Score the map of a dataset's only scene; as `score`, with a ``Task`` for what all verbs share."""
    task = with_wishes(task, wishes)
    task = replace(task, dataset=task.open())
    result = run(task, wishes.product, watch=watch, scheduler=scheduler, workers=workers)
    return Score(task.open().scenes[0], wishes, result, ())
