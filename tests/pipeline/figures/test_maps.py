"""Pictures of maps side by side."""

import numpy as np
import xarray as xr

from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.figures.maps import draw_any


def test_each_of_several_maps_tells_its_own_share_without_a_value() -> None:
    half = np.array([[1, np.nan], [2, np.nan]], np.float32)
    maps = {"full": (("y", "x"), np.ones((2, 2), np.float32)), "half": (("y", "x"), half)}
    figure = new_figure("Maps")
    draw_any(figure, xr.Dataset(maps))
    assert [axes.get_title() for axes in figure.axes if axes.get_title()] == ["full", "half; none: 50.0 %"]
