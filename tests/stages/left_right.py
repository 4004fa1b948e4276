"""The left-right check by hand: the right view's answer at the nearest pixel differs by at most 1 px.

Maps of ground truth are checked in ``datasets``, computed ones in ``stages``; both must say the same.
"""

import numpy as np
import pytest

N = np.nan
YES, NO = True, False

CASES = [
    pytest.param([0, 0, 0], [0, 0, 0], [YES, YES, YES], id="at infinity"),
    pytest.param([N, 1, 1], [1, 1, N], [NO, YES, YES], id="confirmed"),
    pytest.param([N, 1, 1], [3, 1, N], [NO, NO, YES], id="contradicted by 2 px"),
    pytest.param([0, 1, 0], [0, 1, 1], [YES, YES, YES], id="1 px is tolerated"),
    pytest.param([1, 1, 1], [1, 1, 1], [NO, YES, YES], id="the first pixel lands outside"),
    pytest.param([3, 4, 9], [3, 4, 9], [NO, NO, NO], id="far outside: no pixel is read from the other end"),
    pytest.param([-1, -1, -1], [-1, -1, -1], [YES, YES, NO], id="negative: the last lands outside"),
    pytest.param([N, 0, 0], [0, 0, N], [NO, YES, NO], id="unknown in either view"),
    pytest.param([0, 0, 0, 2, 2], [0, 2, 2, 0, 0], [YES, NO, NO, YES, YES], id="covered by a nearer pixel"),
    pytest.param([0.6, 0.6, 0.6], [0.6, 9, 0.6], [NO, YES, NO], id="read at the nearest column"),
    pytest.param([0.4, 0.4, -0.4], [0.4, 0.4, -0.4], [NO, YES, NO], id="0.4 px outside on either side"),
]
"""Left map, right map, and which left pixels are confirmed."""
