"""The channels of both views: what the matching network is given."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import StageError
from semidense.stages.transforms.companion import companion
from semidense.stages.transforms.declaration import Channels, ChannelsParams, OfViews
from semidense.stages.transforms.gray import gray_moments, gray_views, to_gray
from semidense.stages.transforms.rank import rank
from semidense.stages.transforms.shift import shifted_rows


def channels(
    left: NDArray[Any],
    right: NDArray[Any],
    params: ChannelsParams | None = None,
    moments: NDArray[np.float64] | None = None,
) -> NDArray[np.float32]:
    """Return the channels of both views.

    Args:
        left: (y, x), (y, x, 1) or (y, x, 3), uint8 or uint16.
        right: the other view, of the same size.
        params: what to make and how; None for the paper's three channels.
        moments: (view, moment) mean and standard deviation of each view's 8-bit gray over the whole image, which a
            block of an image cannot know; None takes them from what is given.

    Returns:
        (view, channel, y, x) float32, pure numbers: views left, right; of the channels gray, rank, companion those
        in ``params.use``. ``gray`` is ``(gray - mean) / max(std, 1)``, so a constant view is 0, or ``gray / 255`` in
        [0, 1]; ``rank`` is in [0, 1), ``companion`` in [0, 1].

    Raises:
        StageError: for views of different sizes, moments of another shape, or what ``to_gray`` refuses.
    """
    params = params or ChannelsParams()
    views = to_gray(left), to_gray(right)
    if views[0].shape != views[1].shape:
        raise StageError(f"the left view is {views[0].shape} (y, x), the right {views[1].shape}: they must be equal")
    if moments is None:
        moments = np.array([gray_moments(view) for view in views])
    if moments.shape != (2, 2):
        raise StageError(f"moments has shape {moments.shape}, expected (2, 2): mean and deviation of each view")
    return np.stack([_view(view, params, *own) for view, own in zip(views, moments.tolist(), strict=True)])


def _view(gray: NDArray[np.uint8], params: ChannelsParams, mean: float, std: float) -> NDArray[np.float32]:
    """Return the channels of one view, (channel, y, x)."""
    out = np.empty((len(params.use), *gray.shape), np.float32)
    for channel, plane in zip(params.use, out, strict=True):
        if channel == "gray":
            plane[...] = _levels(params, mean, std)[gray]
        elif channel == "rank":
            plane[...] = rank(gray, params.rank_window)
        else:
            plane[...] = companion(gray, params.companion_window, params.companion_rays)
    return out


def _levels(params: ChannelsParams, mean: float, std: float) -> NDArray[np.float32]:
    """Return the value in the gray channel of each of the 256 levels."""
    level = np.arange(256, dtype=np.float64)
    value = level / 255 if params.gray == "raw" else (level - mean) / max(std, 1.0)
    return value.astype(np.float32)


def compute_channels(params: ChannelsParams, inputs: OfViews) -> Channels:
    """Compute the product ``channels`` of an image or of a block of it; see ``channels`` and ``shifted_rows``."""
    images = inputs["images"]
    left, right = gray_views(images)
    if params.align:
        right = shifted_rows(right, inputs["alignment"]["rows"], inputs["alignment"]["columns"])
    return {"channels": channels(left, right, params, images["moments"])}
