import numpy as np
import pytest

from semidense.pipeline.cli.terminal import small_disparity, small_picture
from semidense.stages.catalog import CATALOG, READ
from tests.pipeline.products import PRODUCTS

MAPS = {"images", "truth", "disparity", "semidense", "right_disparity", "refined", "filled"}
MAPS |= {"confidence", "calibrated_confidence", "aggregated", "right_aggregated"}
MAPS |= {"evidence_confidence", "foreign_confidence"}

DATAFLOW = (*READ, *(stage.product for stage in CATALOG))


@pytest.mark.parametrize("product", DATAFLOW)
def test_maps_have_a_picture_and_nothing_else(product: str) -> None:
    picture = small_picture(product, PRODUCTS[product]())
    assert (picture is not None) == (product in MAPS)
    if picture:
        assert (picture.rgb.shape, picture.rgb.dtype) == ((4, 6, 3), np.uint8)


def test_none_is_black_and_told() -> None:
    picture = small_disparity(np.array([[np.nan, 3.0]], np.float32))
    assert picture.rgb[0, 0].tolist() == [0, 0, 0]
    assert "black none (50.0 %)" in picture.legend


def test_a_large_map_is_thinned_and_told_as_a_whole() -> None:
    disparity = np.ones((1000, 1000), np.float32)
    disparity[:250] = np.nan
    picture = small_disparity(disparity)
    assert picture.rgb.shape[0] * picture.rgb.shape[1] <= 100_000
    assert "black none (25.0 %)" in picture.legend
