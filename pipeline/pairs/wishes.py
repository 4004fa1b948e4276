"""What to do with the raw map of a user's own pair."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

from semidense.pipeline.api import Task
from semidense.pipeline.plan.arguments import require_flag, require_number
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.shipped_weights import weights_of
from semidense.stages.disparity.declaration import AggregatedParams, DisparityParams
from semidense.stages.evaluation.filtering import SemidenseParams


@dataclass(frozen=True)
class Wishes:
    """What to do with the raw map; by default it is filtered at R = 0.9 and nothing else.

    Attributes:
        R: least confidence that is kept; None for the configuration's.
        density: share of the image's pixels to keep instead, the most confident, in (0, 1].
        max_error: share of wrong pixels to expect among the kept instead, in (0, 1), by the pair's own confidences and
            how often such were right in training scenes that the networks had not seen.
        calibrated: take and give the confidence as the probability that was measured there.
        within: error up to which these two count a disparity as right, px; None for the configuration's.
        left_right: drop what the right view's map contradicts by more than ``tolerance`` px.
        tolerance: px; None for the configuration's, 1 by default.
        subpixel: move each whole disparity to the parabola's lowest point; maps that lie below a pixel already stay.
        fill: fill the holes with the background; the map is dense then, and partly guessed.
        right_view: make the right view's raw map too.

    Raises:
        UsageError: if a value is not of its type, or two contradict each other.
    """

    R: float | None = None
    density: float | None = None
    max_error: float | None = None
    calibrated: bool = False
    within: float | None = None
    left_right: bool = False
    tolerance: float | None = None
    subpixel: bool = False
    fill: bool = False
    right_view: bool = False

    def __post_init__(self) -> None:
        """Refuse values of another type, and what contradicts itself."""
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(each.default, bool):
                require_flag(each.name, value)
            elif value is not None:
                require_number(each.name, value)
        given = [name for name in ("R", "density", "max_error") if getattr(self, name) is not None]
        if len(given) > 1:
            raise UsageError(f"{' and '.join(given)} both say how much to keep; give one of them")
        if self.within is not None and self.max_error is None and not self.calibrated:
            raise UsageError("within says what a wanted error counts as right: give max-error or calibrated too")
        if self.tolerance is not None and not self.left_right:
            raise UsageError("tolerance says what left_right drops: give left_right too")

    @property
    def product(self) -> str:
        """The product that the wishes come down to."""
        return "filled" if self.fill else "refined" if self.left_right or self.subpixel else "semidense"

    @property
    def confidence(self) -> str:
        """The product that the confidence is taken from."""
        return "calibrated_confidence" if self.calibrated else "confidence"

    @property
    def settings(self) -> tuple[str, ...]:
        """The same as settings of the configuration."""
        given = {f"semidense.{name}": getattr(self, name) for name in ("R", "density", "max_error")}
        given["calibration.tolerance"] = self.within
        if self.calibrated:
            given |= {"semidense.calibrated": True}
        if self.left_right:
            given |= {"refined.left_right": True, "refined.tolerance": self.tolerance}
        if self.subpixel:
            given |= {"refined.subpixel": True}
        return tuple(f"{name}={str(value).lower()}" for name, value in given.items() if value is not None)


WISHES = tuple(each.name for each in fields(Wishes))


def refuse_unknown(verb: str, given: Iterable[str], named: Iterable[str]) -> None:
    """Refuse the first name that is no wish; ``named`` are the verb's own parameters: UsageError."""
    for name in given:
        if name not in WISHES:
            raise UsageError(f"{verb} has no parameter {name!r}; {nearest(name, (*named, *WISHES))}")


def with_wishes(task: Task, wishes: Wishes) -> Task:
    """Return the task with the settings that the wishes come down to.

    Raises:
        UsageError: if a setting is not valid, or replaces the R that was wished.
    """
    task = task.and_settings(wishes.settings)
    if wishes.R is not None and not task.configuration().of("semidense", SemidenseParams).by_R:
        raise UsageError(
            f"R = {wishes.R} says how much to keep, and so does semidense.density or semidense.max_error of the "
            "settings; give one of them"
        )
    return task


def wished(task: Task, wishes: Wishes) -> Task:
    """Return the task with the settings that the wishes come down to, checked before any image is read.

    A map whose disparities lie below a pixel already is not refined again.

    Raises:
        UsageError: if a setting is not valid.
        StageError: if the wishes need a calibration, and none is known for such maps.
    """
    task = with_wishes(task, wishes)
    config = task.configuration()
    filtered_by = config.of("semidense", SemidenseParams)
    calibrated = filtered_by.calibrated or filtered_by.max_error is not None
    if calibrated and not config.choice("use", "calibrated_confidence"):
        weights_of(config, "calibration")
    return task.and_settings(["refined.subpixel=false"]) if wishes.subpixel and _below_a_pixel(config) else task


def _below_a_pixel(config: Config) -> bool:
    """Return whether the raw map is refined where its winner is found."""
    if config.choice("use", "disparity") == "aggregated":
        return config.of("aggregated", AggregatedParams).subpixel
    return config.of("disparity", DisparityParams).subpixel
