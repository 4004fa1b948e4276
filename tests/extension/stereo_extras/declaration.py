"""What the package adds."""

from pydantic import Field

from semidense.datasets import Kind
from semidense.stages.stage import Output, Params, Stage


class RoughnessParams(Params):
    """How the roughness of a map is measured."""

    reach: int = Field(1, ge=1, le=8, description="distance of the neighbours that are compared, px")


ROUGHNESS = Stage(
    product="roughness",
    inputs=("semidense",),
    outputs=(Output("roughness", ("y", "x"), "float32", "px", "largest step to a neighbour of the same row"),),
    compute="stereo_extras.roughness:compute_roughness",
    params=RoughnessParams,
)
RIG = Kind("rig:SEED", "a camera rig that sees noise", "stereo_extras.rig")
