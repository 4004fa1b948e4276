"""All stages, in order: every product comes after those it is made from.

The declarations stand beside what can be set for them; the functions that they name are imported
when something is computed. Stages of other packages join by an entry point of the group ``semidense.stages``, which
names a ``Stage`` or several, or by ``register``.
"""

from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points

from semidense.stages.baselines.declaration import BASELINES, MATCHED
from semidense.stages.disparity.declaration import (
    AGGREGATED,
    ALIGNMENT,
    DISPARITY,
    FILLED,
    REFINED,
    RIGHT_AGGREGATED,
    RIGHT_DISPARITY,
)
from semidense.stages.disparity.survey import SURVEY
from semidense.stages.evaluation.calibration.declaration import CALIBRATED_CONFIDENCE, CALIBRATION
from semidense.stages.evaluation.declaration import CONFIDENCE, EVALUATION_NET, EVALUATION_SAMPLES
from semidense.stages.evaluation.evidence.declaration import EVIDENCE_CONFIDENCE, EVIDENCE_NET, EVIDENCE_SAMPLES
from semidense.stages.evaluation.evidence.foreign.declaration import FOREIGN_CONFIDENCE, FOREIGN_NET, FOREIGN_SAMPLES
from semidense.stages.evaluation.filtering import SEMIDENSE
from semidense.stages.evaluation.silence.declaration import COST_MARGIN, DISTINCTIVENESS
from semidense.stages.matching.declaration import COST_VOLUME, MATCHING_NET, MATCHING_SAMPLES
from semidense.stages.matching.descriptors.declaration import DESCRIPTOR_NET
from semidense.stages.metrics.ranking import RANKING
from semidense.stages.metrics.stage import METRICS
from semidense.stages.stage import Stage, StageError
from semidense.stages.transforms.declaration import CHANNELS

CATALOG: tuple[Stage, ...] = (
    SURVEY,
    ALIGNMENT,
    CHANNELS,
    MATCHING_SAMPLES,
    MATCHING_NET,
    DESCRIPTOR_NET,
    COST_VOLUME,
    DISPARITY,
    RIGHT_DISPARITY,
    DISTINCTIVENESS,
    COST_MARGIN,
    AGGREGATED,
    RIGHT_AGGREGATED,
    EVALUATION_SAMPLES,
    EVALUATION_NET,
    EVIDENCE_SAMPLES,
    EVIDENCE_NET,
    FOREIGN_SAMPLES,
    FOREIGN_NET,
    CONFIDENCE,
    EVIDENCE_CONFIDENCE,
    FOREIGN_CONFIDENCE,
    CALIBRATION,
    CALIBRATED_CONFIDENCE,
    SEMIDENSE,
    REFINED,
    FILLED,
    RANKING,
    METRICS,
)
"""The stages, in the order of the dataflow."""

STAGES = {stage.product: stage for stage in (*MATCHED, *CATALOG, *BASELINES)}
"""The stages by the name of their product: other matchers, the dataflow, other measures, and stages of others."""
READ = ("images", "truth")
"""Products that are read from a scene, not computed: inputs of a stage like all others."""
GROUP = "semidense.stages"


def register(*stages: Stage) -> None:
    """Add stages from outside this package to the dataflow; each comes after those it is made from.

    Raises:
        StageError: if a product has that name already, an input is no product, or the stage makes nothing.
    """
    for stage in stages:
        known = (*READ, *STAGES)
        unknown = [name for name in stage.inputs if name not in known]
        if STAGES.get(stage.product, stage) != stage or stage.product in READ or not stage.product.isidentifier():
            raise StageError(f"stage {stage.product!r} ({stage.compute}): choose another name for its product")
        if unknown or not stage.outputs:
            told = f"no product {unknown[0]!r} is known for its input" if unknown else "it has no output"
            raise StageError(f"stage {stage.product!r} ({stage.compute}): {told}")
        STAGES[stage.product] = stage


def _load(points: Iterable[EntryPoint]) -> None:
    """Register the stages that installed packages offer.

    Raises:
        StageError: naming the entry point that cannot be loaded.
    """
    for point in points:
        try:
            found = point.load()
        except Exception as error:
            raise StageError(f"the plug-in {point.name} = {point.value} cannot be loaded: {error}") from error
        register(*([found] if isinstance(found, Stage) else found))


_load(entry_points(group=GROUP))
