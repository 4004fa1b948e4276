"""A cache written by hand: every product of one scene of any size, in the form that a run leaves, in a moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.cache import Entry, Recipe, Store
from semidense.stages.disparity.winner_takes_all import winner_take_all

SHAPES = {
    "left": ("y", "x", "band"), "right": ("y", "x", "band"), "moments": ("view", "moment"), "mask_kind": ("kind",),
    "channels": ("view", "channel", "y", "x"), "cost": ("y", "x", "d"), "d": ("d",),
}  # fmt: skip
"""Dimensions of what is no map."""
_CHUNKS = {"y": 32, "x": 256}


@dataclass
class Handmade:
    """A scene in a cache.

    Attributes:
        store: the cache.
        arrays: of each product, by name.
        entries: the record of each product.
    """

    store: Store
    arrays: dict[str, dict[str, NDArray[Any]]]
    entries: dict[str, Entry]
    scene: str = "Hand"

    def write(self, product: str, params: Mapping[str, Any], inputs: tuple[str, ...], **arrays: NDArray[Any]) -> None:
        """Publish a product that is made from others of this scene."""
        made_from = {name: self.entries[name].digest for name in inputs}
        recipe = Recipe(product, {"tests.handmade": "00"}, dict(params), made_from, {})
        with self.store.begin(recipe, {"product": product, "dataset": "handmade", "scene": self.scene}) as draft:
            for name, array in arrays.items():
                dims = SHAPES.get(name, ("y", "x"))
                chunks = [min(_CHUNKS.get(dim, n), n) for dim, n in zip(dims, array.shape, strict=True)]
                draft.create_array(name, array.shape, str(array.dtype), chunks, dims, {"units": "1"})
                draft.write(name, tuple(slice(0, n) for n in array.shape), array)
        self.arrays[product] = dict(arrays)
        self.entries[product] = self.store.require(recipe.key)


def handmade(
    folder: Path, height: int = 60, width: int = 90, disparities: int = 12, seed: int = 0, scene: str = "Hand"
) -> Handmade:
    """Write a scene whose costs have one clear valley a pixel, which is the truth in three of four cases."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    truth = ((y // 8 + x // 16) % (disparities - 2) + 1).astype(np.float32)
    right = random.random((height, width)) < 0.75
    valley = np.where(right, truth, (truth + 5) % disparities)
    d = np.arange(disparities, dtype=np.int16)
    cost = (np.abs(valley[..., np.newaxis] - d) + random.random((height, width, disparities))).astype(np.float16)
    cost[x[..., np.newaxis] < d] = np.nan
    confidence = np.clip(0.5 * right + 0.5 * random.random((height, width)), 0, 1).astype(np.float32)
    truth[random.random(truth.shape) < 0.05] = np.nan
    view = random.integers(0, 256, (height, width, 3), np.uint8)
    made = Handmade(Store(folder), {}, {}, scene)
    made.write("images", {"seed": seed}, (), left=view, right=view[:, ::-1].copy(), moments=np.zeros((2, 2)))
    made.write(
        "truth",
        {"seed": seed},
        (),
        disparity=truth,
        nonocc=np.isfinite(truth) & (x > 4),
        mask_kind=np.array([3], np.int8),
    )
    channels = random.random((2, 3, height, width)).astype(np.float32)
    made.write("channels", {"use": ["gray", "rank", "companion"]}, ("images",), channels=channels)
    made.write("costvolume", {"d_min": 0}, ("channels",), cost=cost, d=d)
    made.write("disparity", {"subpixel": False}, ("costvolume",), disparity=winner_take_all(cost, 0))
    judge(made, confidence, 0)
    return made


def judge(made: Handmade, confidence: NDArray[np.float32], variant: int) -> None:
    """Publish a confidence, and figures that tell which truth the scene has."""
    made.write("confidence", {"variant": variant}, ("images", "disparity"), confidence=confidence)
    made.write("metrics", {}, ("disparity", "confidence", "truth"), figures=np.zeros((1, 1)))
