"""What the channels are made from, and what can be set. Light: it does not load numba."""

from operator import attrgetter
from typing import Literal, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from semidense.stages.stage import Images, Output, Params, Stage
from semidense.stages.transforms.rays import require_rays
from semidense.stages.transforms.shift import TAPS
from semidense.stages.transforms.window import require_window

Channel = Literal["gray", "rank", "companion"]
ORDER: tuple[Channel, ...] = ("gray", "rank", "companion")
"""The order of the channel axis."""
LARGEST_OFFSET = 8.0
"""Largest vertical offset of the right view that is corrected, px."""


class ChannelsParams(Params):
    """How the channels are made."""

    rank_window: int = Field(default=31, ge=3, description="side of the rank window, px, odd")
    companion_window: int = Field(default=61, ge=3, description="side of the companion window, px, odd")
    companion_rays: int = Field(default=8, description="number of rays of the companion transform: 4, 8 or 16")
    gray: Literal["standardized", "raw"] = Field(
        default="standardized",
        description="gray channel; standardized: (gray - mean) / max(std, 1) of the whole view; raw: gray / 255",
    )
    use: tuple[Channel, ...] = Field(
        default=ORDER, min_length=1, description="channels that the networks see, in the order gray, rank, companion"
    )

    align: bool = Field(
        default=False,
        description="shift the rows of the right view to those of the left one, by what the pair itself tells; "
        "off in the paper",
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

    @property
    def halo(self) -> int:
        """Rows of context that a tile needs above and below, px."""
        return self.reach + (int(LARGEST_OFFSET) + TAPS if self.align else 0)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        return ("images", "alignment") if self.align else ("images",)


class Alignment(TypedDict):
    """The product ``alignment``: (y,) and (x,) px; the right view's pixel of row y lies at y + rows[y] + columns[x].

    ``offsets`` (match, 3) are what it was measured by: row and column in the right view, and offset, px.
    """

    rows: NDArray[np.float32]
    columns: NDArray[np.float32]
    offsets: NDArray[np.float32]


class OfViews(TypedDict):
    """What channels are made from; the alignment only where the settings need it."""

    images: Images
    alignment: NotRequired[Alignment]


class Channels(TypedDict):
    """The product ``channels``: (view, channel, y, x)."""

    channels: NDArray[np.float32]


def _sizes(params: ChannelsParams) -> dict[str, int]:
    return {"view": 2, "channel": len(params.use)}


CHANNELS = Stage(
    product="channels",
    inputs=("images", "alignment"),
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
    halo=attrgetter("halo"),
    sizes=_sizes,
)
"""Channels of a scene. ``images`` has ``left`` and ``right`` (y, x, band) uint8 or uint16 and ``moments``
(view, moment) float64: the gray moments of each whole view, so that a tile standardises as the whole image does.
Only those inputs are made that the settings need."""
