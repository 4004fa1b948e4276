"""The square window of a transform."""

from semidense.stages.stage import StageError


def require_window(window: int) -> int:
    """Return the side of a window, in pixels, if it has a centre and neighbours.

    Raises:
        StageError: if it is even or smaller than 3.
    """
    if window < 3 or window % 2 == 0:
        raise StageError(f"window is {window} px, expected an odd number of at least 3")
    return window
