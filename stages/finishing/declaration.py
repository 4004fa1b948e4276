"""What the finishing products are made from, and what can be set. Light: it does not load numba."""

from pydantic import Field

from stages.stage import Output, Params, Stage


class RefinedParams(Params):
    """What is done to the filtered map; nothing by default."""

    left_right: bool = Field(False, description="drop what the right view's own map contradicts")
    tolerance: float = Field(1.0, ge=0, description="largest difference of the two maps that is none, px (left_right)")
    subpixel: bool = Field(False, description="move each disparity to the parabola's lowest point")

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        right = ("right_disparity",) if self.left_right else ()
        return ("semidense", *right, *(("costvolume",) if self.subpixel else ()))


RIGHT_DISPARITY = Stage(
    product="right_disparity",
    inputs=("costvolume",),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "raw disparity of the right view: x_left = x_right + d"),
    ),
    compute="stages.finishing.right_view:compute_right_disparity",
    tile_rows=32,
)
"""The right view's raw disparity, from the same cost volume. A tile has the rows of one chunk of the volume."""

REFINED = Stage(
    product="refined",
    inputs=("semidense", "right_disparity", "costvolume"),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "filtered disparity, checked and refined as asked"),),
    compute="stages.finishing.refinement:compute_refined",
    params=RefinedParams,
    tile_rows=32,
)
"""The filtered map after the steps that were asked for; with none of them, the filtered map itself. Only those inputs
are made that the settings need."""

FILLED = Stage(
    product="filled",
    inputs=("refined",),
    outputs=(
        Output(
            "disparity", ("y", "x"), "float32", "px", "disparity without holes; NaN only where there is none at all"
        ),
        Output("guessed", ("y", "x"), "bool", "1", "pixels that were filled: guesses, not measurements"),
    ),
    compute="stages.finishing.filling:compute_filled",
)
"""The refined map with its holes filled. Not tiled: a hole may be as high as the image."""
