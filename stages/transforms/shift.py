"""Shift the rows of a view by a fraction of a pixel, differently at each pixel."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import StageError
from semidense.stages.transforms.gray import require_gray

TAPS = 2
"""Rows above and below that a pixel between two rows is made from."""


def shifted_rows(view: NDArray[np.uint8], rows: NDArray[np.float32], columns: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return ``view[y + rows[y] + columns[x], x]``: cubic between rows, the nearest row beyond the image.

    Between two rows the value is the Catmull-Rom spline's through four rows, rounded; a whole offset copies rows.

    Args:
        view: (y, x) uint8.
        rows: (y,) float32, px.
        columns: (x,) float32, px.

    Returns:
        (y, x) uint8.

    Raises:
        StageError: if ``view`` is no 8-bit gray image, or the offsets have another size.

    Source: Keys, "Cubic convolution interpolation for digital image processing", IEEE ASSP 1981.

    >>> shifted_rows(np.uint8([[10], [20], [30], [40]]), np.float32([1, 1, 1, 1]), np.float32([0])).T.tolist()
    [[20, 30, 40, 40]]
    """
    require_gray(view)
    if (len(rows), len(columns)) != view.shape:
        raise StageError(f"the alignment is of {len(rows)} x {len(columns)} px, the view of {view.shape}")
    if not (rows.any() or columns.any()):
        return view
    offset = rows[:, None].astype(np.float64) + columns
    whole = np.floor(offset)
    t = (offset - whole).astype(np.float32)
    first = np.arange(len(rows))[:, None] + whole.astype(np.intp) - 1
    weights = (
        ((2 - t) * t - 1) * t / 2,
        ((3 * t - 5) * t * t + 2) / 2,
        ((4 - 3 * t) * t + 1) * t / 2,
        (t - 1) * t * t / 2,
    )
    total = np.zeros(view.shape, np.float32)
    for tap, weight in enumerate(weights):
        total += weight * np.take_along_axis(view, np.clip(first + tap, 0, len(rows) - 1), axis=0)
    return np.clip(np.rint(total), 0, 255).astype(np.uint8)
