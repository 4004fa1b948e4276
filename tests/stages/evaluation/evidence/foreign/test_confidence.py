import numpy as np
import pytest

from semidense.stages.evaluation.evidence.foreign.declaration import FOREIGN_CONFIDENCE, ForeignConfidenceParams
from tests.stages.evaluation.evidence.foreign.products import DIMS, products
from tests.stages.tiling import tiled, whole

ALONE = ForeignConfidenceParams(right=False, precision="float32")
BOTH = ForeignConfidenceParams(right=True, precision="float32")


@pytest.mark.parametrize("params", [pytest.param(ALONE, id="left view"), pytest.param(BOTH, id="both views")])
def test_tiles_equal_the_whole(params: ForeignConfidenceParams) -> None:
    given = products()
    one, other = tiled(FOREIGN_CONFIDENCE, params, given, DIMS, 4), whole(FOREIGN_CONFIDENCE, params, given, DIMS)
    for name in ("confidence", "network", "agreement"):
        assert one[name].dtype == other[name].dtype == np.float32
        assert np.abs(one[name] - other[name]).max() <= 2e-4
    assert np.ptp(other["confidence"]) > 0.01


def test_there_is_no_confidence_without_a_disparity() -> None:
    given = products()
    made = whole(FOREIGN_CONFIDENCE, ALONE, given, DIMS)["confidence"]
    np.testing.assert_array_equal(made == 0, np.isnan(given["disparity"]["disparity"]))


def test_the_right_view_counts_only_where_it_was_asked_for() -> None:
    given, other = products(), products()
    other["channels"]["channels"] = -other["channels"]["channels"]
    for params, equal in ((ALONE, True), (BOTH, False)):
        one, two = (whole(FOREIGN_CONFIDENCE, params, each, DIMS)["confidence"] for each in (given, other))
        assert np.array_equal(one, two) == equal
    assert "channels" not in ALONE.inputs and "channels" in BOTH.inputs
