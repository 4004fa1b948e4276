"""The channels of both views: what the matching network is given."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from stages.stage import Array, Arrays, Inputs, Output, Params, Stage, StageError
from stages.transforms.companion import companion, require_rays
from stages.transforms.gray import gray_moments, to_gray
from stages.transforms.rank import rank
from stages.transforms.window import require_window

Channel = Literal["gray", "rank", "companion"]
ORDER: tuple[Channel, ...] = ("gray", "rank", "companion")
"""The order of the channel axis."""


class ChannelsParams(Params):
    """How the channels are made."""

    rank_window: int = Field(default=31, ge=3, description="side of the rank window, px, odd")
    companion_window: int = Field(default=61, ge=3, description="side of the companion window, px, odd")
    companion_rays: int = Field(default=8, description="rays of the companion: 4, 8 or 16")
    gray: Literal["standardized", "raw"] = Field(
        default="standardized",
        description="gray channel: (gray - mean) / max(std, 1) over the whole view, or gray / 255",
    )
    use: tuple[Channel, ...] = Field(default=ORDER, min_length=1, description="channels to make; always in this order")

    @field_validator("rank_window", "companion_window")
    @classmethod
    def _odd(cls, window: int) -> int:
        return require_window(window)

    @field_validator("companion_rays")
    @classmethod
    def _defined(cls, rays: int) -> int:
        return require_rays(rays)

    @field_validator("use")
    @classmethod
    def _in_order(cls, use: tuple[Channel, ...]) -> tuple[Channel, ...]:
        return tuple(channel for channel in ORDER if channel in use)

    @property
    def reach(self) -> int:
        """Pixels that a channel in use looks away from its own."""
        windows = {"gray": 1, "rank": self.rank_window, "companion": self.companion_window}
        return max(windows[channel] for channel in self.use) // 2


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


def compute_channels(params: ChannelsParams, inputs: Inputs) -> Arrays:
    """Compute the product ``channels`` of an image or of a block of it; see ``channels``."""
    images: dict[str, Array] = inputs["images"]
    return {"channels": channels(images["left"], images["right"], params, images["moments"])}


CHANNELS = Stage(
    product="channels",
    inputs=("images",),
    outputs=(
        Output(
            "channels",
            ("view", "channel", "y", "x"),
            "float32",
            "1",
            "views left, right; channels gray, rank, companion or those of them in use",
        ),
    ),
    compute="stages.transforms.channels:compute_channels",
    params=ChannelsParams,
    tile_rows=128,
    halo=lambda params: params.reach,
    sizes=lambda params: {"view": 2, "channel": len(params.use)},
)
"""Channels of a scene. ``images`` has ``left`` and ``right`` (y, x, band) uint8 or uint16 and ``moments``
(view, moment) float64: the gray moments of each whole view, so that a tile standardises as the whole image does."""
