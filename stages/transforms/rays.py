"""The rays of the companion transform. Light: it does not load numba."""

from semidense.stages.stage import StageError

LINES = {
    4: ((0, 1), (1, 0)),
    8: ((0, 1), (1, 0), (1, 1), (1, -1)),
    16: ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)),
}
"""Steps (dy, dx) of the lines by number of rays: a line is two opposite rays."""


def require_rays(rays: int) -> int:
    """Return the number of rays if there is a definition of it.

    Raises:
        StageError: if it is not 4, 8 or 16.
    """
    if rays not in LINES:
        raise StageError(f"rays is {rays}, expected one of {', '.join(map(str, LINES))}")
    return rays
