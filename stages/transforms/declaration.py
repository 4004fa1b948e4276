"""What the channels are made from, and what can be set. Light: it does not load numba."""

from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from semidense.stages.stage import Output, Params, Stage
from semidense.stages.transforms.rays import require_rays
from semidense.stages.transforms.window import require_window

Channel = Literal["gray", "rank", "companion"]
ORDER: tuple[Channel, ...] = ("gray", "rank", "companion")
"""The order of the channel axis."""


class ChannelsParams(Params):
    """How the channels are made."""

    rank_window: int = Field(default=31, ge=3, description="side of the rank window, px, odd")
    companion_window: int = Field(default=61, ge=3, description="side of the companion window, px, odd")
    companion_rays: int = Field(default=8, description="number of rays of the companion transform: 4, 8 or 16")
    gray: Literal["standardized", "raw"] = Field(
        default="standardized",
        description="scale the gray channel to (gray - mean) / max(std, 1) of the whole view; false: to gray / 255",
    )
    use: tuple[Channel, ...] = Field(
        default=ORDER, min_length=1, description="channels that the networks see, in the order gray, rank, companion"
    )

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


class Channels(TypedDict):
    """The product ``channels``: (view, channel, y, x)."""

    channels: NDArray[np.float32]


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
    compute="semidense.stages.transforms.channels:compute_channels",
    params=ChannelsParams,
    tile_rows=128,
    halo=lambda params: params.reach,
    sizes=lambda params: {"view": 2, "channel": len(params.use)},
)
"""Channels of a scene. ``images`` has ``left`` and ``right`` (y, x, band) uint8 or uint16 and ``moments``
(view, moment) float64: the gray moments of each whole view, so that a tile standardises as the whole image does."""
