import numpy as np

from semidense.stages.disparity.aggregation.edges import penalties, smooth
from semidense.stages.disparity.declaration import AggregatedParams


def test_a_view_is_smoothed_by_hand() -> None:
    """16 / 16 at a spot of 16; at the corner the spot also stands for what lies beyond: (4 + 2 + 2 + 1) of 16."""
    spot = np.zeros((4, 5), np.uint8)
    spot[0, 0], spot[2, 3] = 16, 16
    assert smooth(spot).tolist() == [[9, 3, 0, 0, 0], [3, 1, 1, 2, 1], [0, 0, 2, 4, 2], [0, 0, 1, 2, 1]]


def test_a_view_of_one_gray_stays_as_it_is() -> None:
    assert (smooth(np.full((1, 3), 255, np.uint8)) == 255).all()


def test_both_penalties_are_halved_at_the_edge_that_is_asked_for() -> None:
    table = penalties(AggregatedParams(p1=10, oblique=0.3, p2=50, edge=4))
    assert table.shape == (2, 256, 2) and table.dtype == np.int16
    assert table[:, 0].tolist() == [[40, 200], [12, 200]]
    assert table[:, 4].tolist() == [[20, 100], [6, 100]]
    assert table[:, 16].tolist() == [[4, 22], [1, 22]], "four times the edge: 1 / (1 + 4 ** 1.5) = 1 / 9"
    assert (np.diff(table, axis=1) <= 0).all()


def test_the_smallest_edge_leaves_no_penalty_where_the_gray_differs() -> None:
    table = penalties(AggregatedParams(p1=110, p2=900, edge=0.01))
    assert table[:, 0, 1].tolist() == [3600, 3600] and (table[:, 3:] <= 1).all()
