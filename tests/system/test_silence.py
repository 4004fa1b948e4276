"""Regions in which both views say nothing stay empty, whatever is asked for.

``make silence`` tries 200 draws of every preset and mode; the suite a few, the kinds in turn.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skimage.data import stereo_motorcycle

from semidense.pipeline import match
from tests.system.regions import Image, Painted, paint

DRAWS = int(os.environ.get("SILENCE_DRAWS", "5"))
SLOW_DRAWS = range(DRAWS) if "SILENCE_DRAWS" in os.environ else (0, 2, 4)
ROWS, COLUMNS = slice(120, 280), slice(250, 490)
MOST = 0.01
"""Share of a region that may be kept: waves of a JPEG file at its border are a texture."""
FAST = ("costvolume.mode=fast",)
WISHES: tuple[dict[str, Any], ...] = ({}, {"max_error": 0.02}, {"left_right": True}, {"density": 0.95})


@pytest.fixture(scope="module")
def pair() -> tuple[Image, Image]:
    left, right, _ = stereo_motorcycle()
    return left[ROWS, COLUMNS], right[ROWS, COLUMNS]


def kept(
    painted: Painted, cache: Path, settings: Sequence[str] = FAST, preset: str = "paper", **wishes: object
) -> float:
    how: dict[str, Any] = {"d_min": 0, "d_max": 64, "settings": settings, "preset": preset, "cache": cache}
    found = match(painted.left, painted.right, **how, **wishes)
    return float(np.isfinite(found.disparity)[painted.region].mean())


@pytest.mark.parametrize("seed", range(DRAWS))
def test_nothing_is_kept_where_nothing_is_seen(seed: int, pair: tuple[Image, Image], tmp_path: Path) -> None:
    painted = paint(*pair, seed)
    shares = [kept(painted, tmp_path, **wishes) for wishes in WISHES]
    assert max(shares) <= MOST, f"{painted.name}: {shares}"


@pytest.mark.parametrize("seed", range(DRAWS))
def test_the_preset_robust_is_silent_too(seed: int, pair: tuple[Image, Image], tmp_path: Path) -> None:
    """Though the costs around lead a surface across the region."""
    painted = paint(*pair, seed)
    shares = [kept(painted, tmp_path, (), "robust", **wishes) for wishes in WISHES]
    assert max(shares) <= MOST, f"{painted.name}: {shares}"


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["exact", "guided"])
@pytest.mark.parametrize("seed", SLOW_DRAWS)
def test_volumes_of_every_mode_are_silent(seed: int, mode: str, pair: tuple[Image, Image], tmp_path: Path) -> None:
    painted = paint(*pair, seed)
    assert kept(painted, tmp_path, [f"costvolume.mode={mode}"]) <= MOST, painted.name


def test_a_pair_without_anything_in_it_is_told(tmp_path: Path) -> None:
    blank = np.full((60, 90, 3), 255, np.uint8)
    found = match(blank, blank // 2, d_min=0, d_max=20, settings=FAST, cache=tmp_path)
    assert not np.isfinite(found.disparity).any()
    assert any("100 % of the left view" in line for line in found.warnings)


def test_a_pair_with_texture_is_not_warned_of(pair: tuple[Image, Image], tmp_path: Path) -> None:
    found = match(*pair, d_min=0, d_max=64, settings=FAST, cache=tmp_path)
    assert np.isfinite(found.disparity).mean() > 0.3, "a quarter lies outside the right view"
    assert not any("of the left view" in line for line in found.warnings)
