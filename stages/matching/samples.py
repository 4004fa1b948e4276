"""Training samples of the matching-Net: where to look in the training scenes, and at which disparities.

A sample is a crop of the left view with the disparities at which it is compared. Both of the forms
of training are of this kind, and a cell's label follows from the truth in either:
within 0.5 px of it a match, more than 1 px away a mismatch, between them nothing.

* ``patch``, the paper's: a crop of one pixel with two disparities, the nearest to the truth and a
  random other one more than 1 px away.
* ``dense``: a larger crop at some disparities of the scene's range: a third are disparities of pixels in the
  crop (so that there are matches), a sixth lie just beside such ones (the mismatches that are hardest to
  tell), the rest anywhere. More crops at few disparities teach more than few crops at all of them.

Where the right view has ground truth, half the samples are *mirrored*: both views flipped and
exchanged, which is again a rectified pair.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.truth import is_dense
from semidense.stages.matching.declaration import MatchingSamples, MatchingSamplesParams, OfTruths
from semidense.stages.stage import StageError, Truth, by_scene

NEAR = 6
"""Largest distance from the truth, in pixels, of a mismatch that is drawn beside it."""
ABSENT = np.iinfo(np.int32).min
"""Fills the slots of a sample that has fewer disparities than the others."""


def visible_truth(truth: Truth, mirrored: bool) -> NDArray[np.float32]:
    """Return the disparity of the pixels seen in both views, NaN elsewhere: float32 (y, x).

    Mirrored, it is that of the right view, flipped: the left view of the mirrored pair.
    """
    if mirrored:
        return np.where(truth["right_nonocc"], truth["right_disparity"], np.float32(np.nan))[:, ::-1]
    return np.where(truth["nonocc"], truth["disparity"], np.float32(np.nan))


def draw_samples(params: MatchingSamplesParams, inputs: OfTruths) -> MatchingSamples:
    """Draw the samples of all training scenes, in random order.

    Returns:
        ``scene`` int32, ``mirrored`` bool, ``y`` and ``x`` int32 (sample,): the crop's top left pixel;
        ``disparities`` int32 (sample, slot), px, distinct, then ``ABSENT``; ``truth`` float32 (sample, row, column),
        px, NaN where a cell teaches nothing.

    Raises:
        StageError: if a crop does not fit into a scene, or a scene has no pixel to learn from.
    """
    rng = np.random.default_rng(params.seed)
    truths = by_scene(inputs["truth"], "truth")
    sides = Scenes(
        lambda side: _Side.of(visible_truth(truths[side // 2], bool(side % 2)), params.crop), 2 * len(truths)
    )
    scenes = [_Scene(truth, params, sides, number) for number, truth in enumerate(truths)]
    order = rng.permutation(_scene_of_sample(params, truths))
    drawn = [_draw(scenes[scene], rng) for scene in order]
    return {
        "scene": order.astype(np.int32),
        "mirrored": np.array([sample.mirrored for sample in drawn]),
        "y": np.array([sample.y for sample in drawn], np.int32),
        "x": np.array([sample.x for sample in drawn], np.int32),
        "disparities": np.stack([sample.disparities for sample in drawn]),
        "truth": np.stack([sample.truth for sample in drawn]),
    }


def _scene_of_sample(params: MatchingSamplesParams, truths: Sequence[Truth]) -> NDArray[np.int64]:
    """Return the scene of each sample, in any order: int64 (sample,).

    Without ``dense_share``, or with truths of one kind only, every scene has as many samples as the others, within one.
    """
    dense = np.array([is_dense(truth["disparity"]) for truth in truths])
    if params.dense_share is None or dense.all() or not dense.any():
        return np.arange(params.samples) % len(truths)
    of_dense = round(params.samples * params.dense_share)
    counts = (of_dense, params.samples - of_dense)
    parts = (np.resize(np.flatnonzero(kind), count) for kind, count in zip((dense, ~dense), counts, strict=True))
    return np.concatenate([*parts])


@dataclass(frozen=True)
class _Side:
    """What can be learnt from one orientation of a scene: looked for once, not for each sample, while there is room."""

    visible: NDArray[np.float32]  # y x, px
    candidates: NDArray[np.int32]  # flat indices of the pixels of known truth

    @classmethod
    def of(cls, visible: NDArray[np.float32], crop: tuple[int, int]) -> "_Side":
        """Find the candidates.

        Raises:
            StageError: if there is none, or a crop does not fit.
        """
        candidates = np.flatnonzero(np.isfinite(visible)).astype(np.int32)
        if not len(candidates):
            raise StageError("a training scene has no pixel with a known disparity that both views see")
        if crop[0] > visible.shape[0] or crop[1] > visible.shape[1]:
            raise StageError(f"a crop of {crop} px does not fit into a training scene of {visible.shape} px")
        return cls(visible, candidates)

    @property
    def nbytes(self) -> int:
        """What keeping it takes."""
        return self.visible.nbytes + self.candidates.nbytes

    def corner(self, crop: tuple[int, int], rng: np.random.Generator) -> tuple[int, int]:
        """Return the corner of a crop that holds a random pixel of known truth, at a random place in the crop."""
        shape = np.array(self.visible.shape)
        pixel = np.array(np.unravel_index(rng.choice(self.candidates), self.visible.shape))
        y, x = np.clip(pixel - rng.integers(0, crop), 0, shape - crop)
        return int(y), int(x)


@dataclass(frozen=True)
class _Scene:
    """A training scene, upright and, where samples may be mirrored, mirrored.

    Attributes:
        truth: its arrays, which may be read whenever they are asked for.
        params: of the product.
        sides: of all scenes, two each: upright, then mirrored.
        number: of the scene.
    """

    truth: Truth
    params: MatchingSamplesParams
    sides: Scenes[_Side]
    number: int

    @cached_property
    def range(self) -> tuple[int, int]:
        """Smallest and largest disparity, px."""
        low, high = self.truth["range"]
        return int(low), int(high)

    @cached_property
    def may_be_mirrored(self) -> bool:
        """False where the right view has no truth, or samples are not to be mirrored."""
        return self.params.mirror and bool(np.any(self.truth["right_nonocc"]))

    def draw_side(self, rng: np.random.Generator) -> tuple[bool, _Side]:
        """Return one of the sides there are, each as likely as the other, and whether it is the mirrored one."""
        mirrored = self.may_be_mirrored and bool(rng.random() < 0.5)
        return mirrored, self.sides[2 * self.number + mirrored]


class _Drawn(NamedTuple):
    """One sample; see ``MatchingSamples``."""

    mirrored: bool
    y: int
    x: int
    disparities: NDArray[np.int32]
    truth: NDArray[np.float32]


def _draw(scene: _Scene, rng: np.random.Generator) -> _Drawn:
    """Draw one sample of one scene, around a pixel whose truth is known."""
    params = scene.params
    mirrored, side = scene.draw_side(rng)
    y, x = side.corner(params.crop, rng)
    crop = side.visible[y : y + params.crop[0], x : x + params.crop[1]]
    known = crop[np.isfinite(crop)]
    pick = _patch_slots if params.form == "patch" else _dense_slots
    slots = pick(known, *scene.range, params.disparities, rng)
    truth = np.ascontiguousarray(crop, np.float32)
    return _Drawn(mirrored, y, x, slots.astype(np.int32), truth)


def _patch_slots(
    known: NDArray[np.float32], low: int, high: int, _: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return the disparity nearest to the truth, and a random one more than 1 px from it."""
    others = np.arange(low, high + 1)
    others = others[np.abs(others - known[0]) > 1]
    if not len(others):
        raise StageError(f"the range {low}..{high} px has no mismatch for a truth of {known[0]:.2f} px")
    slots: NDArray[np.int64] = np.array([np.rint(known[0]), rng.choice(others)], np.int64)
    return slots


def _dense_slots(
    known: NDArray[np.float32], low: int, high: int, count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return the whole range, then ``ABSENT``; of a larger one first disparities of the crop and beside such ones."""
    slots = np.arange(low, high + 1)
    if len(slots) > count:
        found = np.rint(rng.choice(known, count // 3))
        beside = np.rint(rng.choice(known, count // 6)) + rng.choice((-1, 1), count // 6) * rng.integers(
            2, NEAR + 1, count // 6
        )
        wanted = np.clip(np.concatenate([found, beside, rng.permutation(slots)]), low, high).astype(np.int64)
        _, first = np.unique(wanted, return_index=True)
        slots = wanted[np.sort(first)[:count]]
    return np.pad(slots, (0, count - len(slots)), constant_values=ABSENT)
