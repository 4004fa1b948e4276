"""All stages, in order: every product comes after those it is made from.

The declarations stand beside what can be set for them; the functions that they name are imported
when something is computed.
"""

from semidense.stages.baselines.declaration import BASELINES
from semidense.stages.disparity.declaration import DISPARITY, FILLED, REFINED, RIGHT_DISPARITY
from semidense.stages.disparity.survey import SURVEY
from semidense.stages.evaluation.calibration.declaration import CALIBRATED_CONFIDENCE, CALIBRATION
from semidense.stages.evaluation.declaration import CONFIDENCE, EVALUATION_NET, EVALUATION_SAMPLES
from semidense.stages.evaluation.filtering import SEMIDENSE
from semidense.stages.matching.declaration import COST_VOLUME, DESCRIPTOR_NET, MATCHING_NET, MATCHING_SAMPLES
from semidense.stages.metrics import METRICS
from semidense.stages.stage import Stage
from semidense.stages.transforms.declaration import CHANNELS

CATALOG: tuple[Stage, ...] = (
    SURVEY,
    CHANNELS,
    MATCHING_SAMPLES,
    MATCHING_NET,
    DESCRIPTOR_NET,
    COST_VOLUME,
    DISPARITY,
    RIGHT_DISPARITY,
    EVALUATION_SAMPLES,
    EVALUATION_NET,
    CONFIDENCE,
    CALIBRATION,
    CALIBRATED_CONFIDENCE,
    SEMIDENSE,
    REFINED,
    FILLED,
    METRICS,
)
"""The stages, in the order of the dataflow."""

STAGES = {stage.product: stage for stage in (*CATALOG, *BASELINES)}
"""The stages by the name of their product; after those of the dataflow what they are compared with."""
