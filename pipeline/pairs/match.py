"""Match a user's own pair: ``pipeline.match``, and what comes back from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from os import PathLike, fspath
from threading import Thread
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import Calibration, Dataset, DisparityRange, SceneSource, open_dataset
from semidense.datasets.pairs.arrays import array_pair
from semidense.datasets.pairs.options import PairOptions, file_names, pair_spec
from semidense.pipeline.api import Cache, Task, run, status
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.pairs.findings import findings, without_texture
from semidense.pipeline.pairs.wishes import Wishes, refuse_unknown, wished
from semidense.pipeline.plan.config import Settings
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.presets import OWN_PAIRS
from semidense.pipeline.plan.steps import SPLIT
from semidense.pipeline.results.result import Result
from semidense.stages.disparity import depth as geometry
from semidense.stages.evaluation.calibration.table import Outcome, Table, outcome

Unit = Literal["mm", "cm", "m"]
_NAMED = ("d_min", "d_max", "calib", "unit", "settings", "preset", "cache", "watch", "workers")


@dataclass(frozen=True, eq=False)
class Match:
    """A matched pair. All maps belong to the left view unless an attribute says otherwise.

    Attributes:
        scene: where it comes from.
        wishes: what was asked for.
        result: the run that made the map.
        others: the runs that made the look at the pair and, if asked for, the right view's map.
    """

    scene: SceneSource
    wishes: Wishes
    result: Result
    others: tuple[Result, ...]

    @cached_property
    def disparity(self) -> NDArray[np.float32]:
        """(y, x) float32, px, ``x_right = x_left - d``; NaN where there is none."""
        return self._array(self.wishes.product, "disparity")

    @cached_property
    def raw(self) -> NDArray[np.float32]:
        """(y, x) float32, px: the map before anything was dropped."""
        return self._array("disparity", "disparity")

    @cached_property
    def confidence(self) -> NDArray[np.float32]:
        """(y, x) float32 in [0, 1]: how sure it is that ``raw`` is right; calibrated, if that was asked for."""
        return self._array(self.wishes.confidence, "confidence")

    @cached_property
    def guessed(self) -> NDArray[np.bool_]:
        """(y, x) bool: pixels whose disparity was filled in."""
        return self._array("filled", "guessed") if self.wishes.fill else np.zeros(self.scene.size, bool)

    @cached_property
    def right_disparity(self) -> NDArray[np.float32]:
        """(y, x) float32, px, right view, ``x_left = x_right + d``: its raw map.

        Raises:
            UsageError: if it was not asked for.
        """
        return self._array("right_disparity", "disparity")

    @cached_property
    def image(self) -> NDArray[Any]:
        """(y, x, band) uint8 or uint16: the left view."""
        return self._array("images", "left")

    @cached_property
    def depth(self) -> NDArray[np.float32]:
        """(y, x) float32, metres; NaN where there is no disparity, or it means infinity.

        Raises:
            UsageError: if the pair has no calibration.
        """
        known = self.calibration
        return geometry.depth(self.disparity, known.focal, known.baseline / 1000, known.doffs)

    def points(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Return the points in space, (point, 3) float32 metres (right, up, towards the viewer), and their colours.

        Without a principal point in the calibration, the image's centre stands for it. Raises what `calibration` does.
        """
        from semidense.pipeline.figures.colours import view_rgb  # Matplotlib takes a second to load

        rows, columns = self.scene.size
        known, colours = self.calibration, view_rgb(self.image[np.isfinite(self.depth)])
        centre = known.centre or ((columns - 1) / 2, (rows - 1) / 2)
        return geometry.points(self.depth, known.focal, centre, known.focal_y, known.skew), colours

    @property
    def calibration(self) -> Calibration:
        """What depth needs.

        Raises:
            UsageError: if the pair has none.
        """
        if self.scene.calibration is None:
            raise UsageError(f"{self.scene.name}: depth needs a calibration; give calib.txt, OpenCV's or ROS's files")
        return self.scene.calibration

    @property
    def R(self) -> float:  # noqa: N802 - the paper's name
        """The least confidence that was kept."""
        return float(self._array("semidense", "R")[0])

    @property
    def filtered_by(self) -> Mapping[str, Any]:
        """The settings of the filter, whether they were wishes or not."""
        return self.made("semidense").step.settings

    @cached_property
    def basis(self) -> Outcome | None:
        """What the wanted error came to in training scenes; None without one, or if the confidence needs no table."""
        found, wanted = self._find("calibration"), self.filtered_by.get("max_error")
        if wanted is None or found is None:
            return None
        calibration = self.result.store.read(found.key)
        return outcome(Table.of(calibration), calibration["log_odds"], wanted, calibration["tolerance"])

    @property
    def expected_error(self) -> float | None:
        """The share of wrong pixels to expect among those that the wanted error keeps; None if there is none.

        Raises:
            UsageError: if neither an error nor calibrated confidences were asked for.
        """
        kept = np.isfinite(self._array("semidense", "disparity"))
        right = self._array("calibrated_confidence", "confidence")[kept]
        return float(np.mean(1 - right, dtype=np.float64)) if right.size else None

    @property
    def density(self) -> float:
        """The share of the image's pixels that have a disparity."""
        return float(np.isfinite(self.disparity).mean())

    @property
    def disparities(self) -> DisparityRange:
        """The range that was searched."""
        settings = self.made("costvolume").step.settings
        return DisparityRange(settings["d_min"], settings["d_max"])

    @cached_property
    def survey(self) -> dict[str, NDArray[Any]]:
        """The arrays of the look at the pair."""
        return self.result.store.read(self.made("survey").key)

    @property
    def warnings(self) -> list[str]:
        """What looks wrong with the pair: files, calibration, or exchanged, unrectified, identical or blank views."""
        views = self._find("distinctiveness")
        blank = without_texture(self.result.store.read(views.key)) if views else ()
        return [*self.scene.warnings, *self.misfits, *blank]

    @cached_property
    def misfits(self) -> list[str]:
        """Those of the warnings that tell how the views do not fit together: a picture of ``survey`` shows where."""
        aligned, estimated = self.shifts is not None, bool(self.scene.open_ends)
        return findings(self.survey, self.disparities, self.scene.calibration, aligned=aligned, estimated=estimated)

    @cached_property
    def shifts(self) -> tuple[float, float] | None:
        """How far the rows of the right view were shifted for the matching, px: least and most; None: not at all."""
        made = self._find("alignment")
        if made is None:
            return None
        arrays = self.result.store.arrays(made.key)
        rows, columns = (np.asarray(arrays[name][...], np.float64) for name in ("rows", "columns"))
        if not (rows.any() or columns.any()):
            return None
        return float(rows.min() + columns.min()), float(rows.max() + columns.max())

    def made(self, product: str) -> Made:
        """Return the result of one of the pair's products.

        Raises:
            UsageError: if it was not made.
        """
        found = self._find(product)
        if found is None:
            raise UsageError(f"{product} of {self.scene.name} was not asked for")
        return found

    def _find(self, product: str) -> Made | None:
        """Return the result of one of the pair's products; None if it was not made."""
        made = (each for result in (self.result, *self.others) for each in result.made.values())
        own = (self.scene.name, SPLIT)
        return next((each for each in made if each.step.product == product and each.step.scene in own), None)

    def _array(self, product: str, name: str) -> NDArray[Any]:
        return np.asarray(self.result.store.arrays(self.made(product).key)[name][...])


def match(
    left: object,
    right: object,
    *,
    d_min: int | None = None,
    d_max: int | None = None,
    calib: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    unit: Unit | None = None,
    settings: Settings = (),
    preset: str = OWN_PAIRS,
    cache: Cache = None,
    watch: Watch | None = None,
    workers: int | None = None,
    **wishes: Any,  # noqa: ANN401 - those of Wishes
) -> Match:
    """Match one rectified pair, reusing all that is cached.

    Args:
        left: a file, or (y, x), (y, x, 3) RGB, uint8 or uint16: the reference view.
        right: the other view, of the same size.
        d_min: smallest disparity to search, px; None for the calibration's, else an estimate.
        d_max: largest one.
        calib: a calibration file, or a left and a right one of ROS; ``docs/own-pictures.md`` lists the formats.
        unit: of a calibration that does not tell it, such as OpenCV's.
        settings: settings of the configuration, over those of the preset.
        preset: named settings to start from: ``robust``, or ``paper`` for the method of the paper.
        cache: the cache's folder or URL, or an opened cache.
        watch: told how it goes on.
        workers: threads; None for one a core.
        **wishes: the attributes of `Wishes`, such as ``R=0.8``, ``density=0.8`` or ``subpixel=True``.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
    """
    refuse_unknown("match", wishes, _NAMED)
    options = PairOptions(file_names(calib), unit, d_min, d_max)
    dataset = _dataset(left, right, options)
    if (count := len(dataset.scenes)) != 1:
        raise UsageError(f"{left} and {right} are {count} pairs; match one at a time, or use `pipeline match`")
    task = Task(dataset, settings=settings, cache=cache, preset=preset)
    return match_all(task, Wishes(**wishes), watch=watch, workers=workers)[0]


def _dataset(left: object, right: object, options: PairOptions) -> Dataset:
    if isinstance(left, str | PathLike) and isinstance(right, str | PathLike):
        return open_dataset(pair_spec([fspath(left), fspath(right)], options))
    return array_pair(left, right, options)


def match_all(
    task: Task,
    wishes: Wishes,
    *,
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
) -> list[Match]:
    """Match every pair of a dataset; as `match`, with a ``Task`` for what all verbs share, its preset too."""
    task = wished(task, wishes)
    dataset = task.open()
    task = replace(task, dataset=dataset)
    if not scheduler and status(task, "survey").todo():
        # The look at a new pair takes a second and does without torch, which takes as long to load.
        Thread(target=import_module, args=("torch",)).start()
    products = ("survey", wishes.product, *(["right_disparity"] if wishes.right_view else []))
    survey, result, *right = (
        run(task, product, watch=watch, scheduler=scheduler, workers=workers) for product in products
    )
    return [Match(scene, wishes, result, (survey, *right)) for scene in dataset.scenes]
