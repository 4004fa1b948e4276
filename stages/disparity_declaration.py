"""What the raw disparity is made from, and what can be set. Light: it does not load numba."""

from pydantic import Field

from stages.stage import Output, Params, Stage


class DisparityParams(Params):
    """How a disparity is read off the cost volume."""

    subpixel: bool = Field(default=False, description="refine by a parabola through three costs; off in the paper")


DISPARITY = Stage(
    product="disparity",
    inputs=("costvolume",),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "raw disparity of the left view; NaN: no valid cost"),),
    compute="stages.disparity:compute_disparity",
    params=DisparityParams,
    tile_rows=32,
)
"""The raw disparity. ``costvolume`` has ``cost`` (y, x, d) float16 and its coordinate ``d`` (d,) int16, px. A tile has
the rows of one chunk of the volume, so that each chunk is read once."""
