from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from semidense.pipeline.pages import scene_maps as module
from semidense.pipeline.pages.scene_maps import row_blocks, step_for, thinned


@pytest.mark.parametrize(
    ("height", "width", "step"),
    [
        pytest.param(497, 741, 1, id="quarter size is whole"),
        pytest.param(994, 1482, 1, id="half size is whole"),
        pytest.param(2000, 3000, 2, id="full size: every second"),
        pytest.param(16384, 16384, 14, id="the largest image"),
    ],
)
def test_a_screen_shows_so_many_pixels(height: int, width: int, step: int) -> None:
    assert step_for(height, width) == step
    assert -(-height // step) * -(-width // step) <= module.SHOWN


@pytest.mark.parametrize("step", [1, 2, 3, 7])
@pytest.mark.parametrize("chunk", [1, 4, 30])
def test_thinned_is_every_nth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int, chunk: int) -> None:
    monkeypatch.setattr(module, "_BLOCK", 40)  # a few rows
    values = np.arange(23 * 9).reshape(23, 9)
    array = zarr.create_array(store=str(tmp_path / "a"), shape=values.shape, chunks=(chunk, 9), dtype="int64")
    array[...] = values
    np.testing.assert_array_equal(thinned(array, step), values[::step, ::step])


def test_blocks_are_whole_chunks_and_small(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stored:
        shape, chunks = (100, 50), (8, 50)

    monkeypatch.setattr(module, "_BLOCK", 1000)
    blocks: list[Any] = list(row_blocks(Stored()))
    assert [(each.start, each.stop) for each in blocks[:2]] == [(0, 16), (16, 32)]
    assert blocks[-1].stop == 100
