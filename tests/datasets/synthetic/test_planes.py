import math

import numpy as np

from semidense.datasets.synthetic.planes import Plane, Waves, World

STILL = Waves(np.zeros((1, 2)), np.zeros(1), np.zeros((1, 1)))


def plane(
    disparity: float,
    slope: tuple[float, float] = (0.0, 0.0),
    half: tuple[float, float] = (math.inf, math.inf),
    centre: tuple[float, float] = (4.0, 0.0),
    round: bool = False,
    level: float = 0.0,
) -> Plane:
    return Plane(slope, disparity, centre, half, round, np.array([level]), STILL, STILL, -math.inf)


def test_a_nearer_plane_covers_and_is_seen_shifted() -> None:
    world = World([plane(0, level=10), plane(2, half=(1, 1), level=90)], height=1, width=8)
    assert world.left_truth().tolist() == [[0, 0, 0, 2, 2, 2, 0, 0]]
    assert world.right_truth().tolist() == [[0, 2, 2, 2, 0, 0, 0, 0]]
    assert world.visible().tolist() == [[True, False, False, True, True, True, True, True]]
    assert world.left_view()[..., 0].tolist() == [[10, 10, 10, 90, 90, 90, 10, 10]]
    assert world.right_view()[..., 0].tolist() == [[10, 90, 90, 90, 10, 10, 10, 10]]


def test_what_leaves_the_image_is_not_visible() -> None:
    assert World([plane(1.5)], height=1, width=4).visible().tolist() == [[False, False, True, True]]


def test_a_slanted_plane_keeps_its_equation_in_both_views() -> None:
    world = World([plane(1, slope=(0.25, 0.5))], height=3, width=8)
    rows, columns = np.mgrid[:3, :8]
    left, right = world.left_truth(), world.right_truth()
    np.testing.assert_allclose(left, 0.25 * columns + 0.5 * rows + 1)
    np.testing.assert_allclose(right, 0.25 * (columns + right) + 0.5 * rows + 1, rtol=1e-6)


def test_an_ellipse_is_round() -> None:
    world = World([plane(0), plane(1, half=(2, 1), round=True, centre=(3, 1))], height=3, width=7)
    assert world.left_truth().tolist() == [[0, 0, 0, 1, 0, 0, 0], [0, 1, 1, 1, 1, 1, 0], [0, 0, 0, 1, 0, 0, 0]]


def test_waves_sum_cosines_of_position() -> None:
    waves = Waves(np.array([[0.25, 0], [0, 0.5]]), np.array([0, np.pi]), np.array([[2.0, 0.0], [1.0, 3.0]]))
    columns, rows = np.meshgrid(np.arange(3.0), np.arange(2.0))
    expected = [[[1, -3], [-1, -3], [-3, -3]], [[3, 3], [1, 3], [-1, 3]]]
    np.testing.assert_allclose(waves(columns, rows), expected, atol=1e-12)


def test_below_the_threshold_a_plane_is_flat() -> None:
    texture = Waves(np.zeros((1, 2)), np.zeros(1), np.full((1, 1), 5.0))
    slow = Waves(np.array([[0.125, 0.0]]), np.zeros(1), np.ones((1, 1)))
    flat = Plane((0, 0), 0, (0, 0), (math.inf,) * 2, False, np.array([100.0]), texture, slow, 0.5)
    view = World([flat], height=1, width=8).left_view()[0, :, 0]
    assert view.tolist() == [105, 105, 100, 100, 100, 100, 100, 105]
