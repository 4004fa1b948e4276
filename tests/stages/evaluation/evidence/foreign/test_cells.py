import numpy as np

from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.foreign.cells import CONTEXT, OFFSETS, described
from semidense.stages.evaluation.evidence.foreign.declaration import MEANS
from semidense.stages.matching.descriptors.net import descriptor_net_from_parameters
from semidense.stages.matching.descriptors.volume import fast_cost_volume
from tests.stages.evaluation.evidence.foreign.products import products


def test_the_cells_are_those_of_the_fast_volume() -> None:
    given = products()
    channels, disparity = given["channels"]["channels"], given["disparity"]["disparity"]
    net = descriptor_net_from_parameters(given["descriptor_net"]["parameters"], 3)
    volume = fast_cost_volume(net, channels, range(-20, 20))
    around = (RADIUS, RADIUS)
    views = described(
        np.pad(channels, ((0, 0), (0, 0), around, around), mode="edge"), given["descriptor_net"], "float32"
    )
    costs = views.costs(np.pad(disparity, RADIUS, mode="edge"))[:, RADIUS:-RADIUS, RADIUS:-RADIUS]
    for y, x in np.ndindex(disparity.shape):
        if np.isnan(disparity[y, x]):
            assert np.isnan(costs[:, y, x]).all()
        else:
            cells = [int(np.floor(disparity[y, x])) + offset + 20 for offset in OFFSETS]
            np.testing.assert_allclose(costs[:, y, x], volume[y, x, cells], atol=1e-3)
    assert np.isfinite(costs).mean() > 0.5


def test_costs_are_told_as_far_as_they_are_averaged() -> None:
    assert max(MEANS) // 2 <= CONTEXT
