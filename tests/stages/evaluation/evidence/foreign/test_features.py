import numpy as np

from semidense.stages.evaluation.agreement import agreement
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.foreign.declaration import FEATURES, OF_CELLS
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.of_map import opened
from semidense.stages.evaluation.evidence.overlap import overlap
from tests.stages.evaluation.evidence.foreign.products import products


def known(disparity: np.ndarray, costs: np.ndarray | None = None) -> dict[str, np.ndarray]:
    given = products(*disparity.shape)
    left = np.pad(given["images"]["left"], ((RADIUS, RADIUS), (RADIUS, RADIUS), (0, 0)), mode="edge")
    images = {"left": left, "moments": given["images"]["moments"]}
    padded = np.pad(disparity, RADIUS, mode="edge")
    found = features(images, padded, given["evaluation_net"], costs, "float32")
    assert found.dtype == np.float32 and np.isfinite(found).all()
    return dict(zip(FEATURES, opened(found), strict=True))


def test_the_map_tells_what_it_looks_like() -> None:
    disparity = np.full((8, 30), 2, np.float32)
    disparity[:, 15:] = 6
    disparity[3, 20] = np.nan
    told = known(disparity)
    np.testing.assert_allclose(told["agreement 9"], agreement(disparity, 9), atol=1e-5)
    np.testing.assert_allclose(told["overlap"], np.nan_to_num(overlap(disparity)), atol=1e-4)
    np.testing.assert_allclose(told["column"][0, [0, 15, 29]], [-2, 9, 23], atol=1e-5)
    assert np.isclose(told["step"][0, 14], 4, atol=1e-5) and told["step"][0, 3] == 0
    assert np.isclose(told["known 9"][4, 20], 80 / 81, atol=1e-5)
    np.testing.assert_allclose(told["edge"][0, :15], np.arange(14, -1, -1), atol=1e-5)
    assert (told["distinctiveness"] > 10).all()


def test_a_map_without_a_step_is_far_from_any() -> None:
    told = known(np.full((8, 30), 2, np.float32))
    np.testing.assert_allclose(told["edge"], 50, atol=1e-4)
    assert np.allclose(told["support"], 1)


def test_without_a_right_view_the_costs_are_silent() -> None:
    told = known(np.full((8, 30), 2, np.float32))
    assert all((told[name] == 0).all() for name in OF_CELLS)


def test_the_costs_tell_which_disparity_they_like() -> None:
    """Cells from 2 px below to 3 px above cost 5 4 1 3 4 5: at 2.5 px the map lies between 1 and 3."""
    disparity = np.full((8, 30), 2.5, np.float32)
    costs = np.broadcast_to(np.float32([5, 4, 1, 3, 4, 5])[:, None, None], (6, 8 + 2 * RADIUS, 30 + 2 * RADIUS)).copy()
    told = known(disparity, costs)
    middle = {name: float(told[name][4, 15]) for name in OF_CELLS}
    expected = {"cost": 2, "cost 9": 2, "excess": 1, "beside": 3, "rival": 0, "judged": 1}
    np.testing.assert_allclose([middle[name] for name in expected], list(expected.values()), atol=1e-4)


def test_a_dearer_pixel_with_the_same_right_pixel_has_a_rival() -> None:
    disparity = np.zeros((8, 30), np.float32)
    disparity[:, 21] = 1  # leads to the column of 20
    costs = np.full((6, 8 + 2 * RADIUS, 30 + 2 * RADIUS), 3, np.float32)
    costs[:, :, RADIUS + 21] = 7
    told = known(disparity, costs)
    np.testing.assert_allclose(told["rival"][4, 19:23], [0, 0, 4, 0], atol=1e-4)
