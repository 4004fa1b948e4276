"""The command `submit`: a run, an archive, and what is told of it."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import read_pfm

Invoke = Callable[..., Any]
CALIB = "cam0=[99 0 40; 0 99 30; 0 0 1]\ndoffs=1\nbaseline=50\nwidth=64\nheight=48\nndisp=9\n"


@pytest.fixture
def evaluation(tmp_path: Path) -> Path:
    """A test scene in the layout of MiddEval3, shifted by 4 px."""
    folder = tmp_path / "MiddEval3/testQ/Plants"
    folder.mkdir(parents=True)
    texture = np.random.default_rng(7).integers(0, 255, (48, 80, 3), np.uint8)
    Image.fromarray(texture[:, :64]).save(folder / "im0.png")
    Image.fromarray(texture[:, 4:68]).save(folder / "im1.png")
    (folder / "calib.txt").write_text(CALIB)
    return tmp_path


def test_an_incomplete_set_is_refused_before_anything_is_computed(invoke: Invoke, evaluation: Path) -> None:
    ran = invoke("submit", "middlebury", f"middlebury:{evaluation}", "-o", evaluation / "a.zip")
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert "the server takes no archive without trainingQ: Adirondack" in ran.err
    assert not (evaluation / "a.zip").exists()


@pytest.mark.parametrize(
    ("option", "message"),
    [
        pytest.param(("--method", "a b/c"), "method 'a b/c': up to 20 letters", id="a name with a slash"),
        pytest.param(("-o", "."), ".: this is a folder; name the archive, such as submission.zip", id="a folder"),
    ],
)
def test_a_name_or_a_place_that_will_not_do_is_refused_before_anything_is_computed(
    invoke: Invoke, evaluation: Path, option: tuple[str, str], message: str
) -> None:
    cache = evaluation / "cache"
    ran = invoke("submit", "middlebury", f"middlebury:{evaluation}", "--partial", *option, "--cache", cache)
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert message in ran.err
    assert not cache.exists()


def test_a_partial_archive_holds_maps_and_times(invoke: Invoke, evaluation: Path) -> None:
    archive = evaluation / "new" / "a.zip"
    words = (
        *("submit", "middlebury", f"middlebury:{evaluation}", "-o", archive, "--partial", "--method", "Mine"),
        *("--mode", "fast", "--cache", evaluation / "cache"),
    )
    ran = invoke(*words, "--json")
    assert ran.code == 0
    row = json.loads(ran.out)
    assert "1 scene, 3 files" in invoke(*words).out
    assert (row["scenes"], row["files"], row["mean_seconds"] > 0) == (1, 3, True)
    with zipfile.ZipFile(archive) as found:
        found.extractall(evaluation / "out")
    folder = evaluation / "out/testQ/Plants"
    dense, sparse = (read_pfm(folder / f"disp0Mine{ending}.pfm") for ending in ("", "_s"))
    kept = ~np.isnan(sparse)
    np.testing.assert_array_equal(dense[kept], sparse[kept])
    assert not np.isnan(dense).any()
    assert np.median(dense) == pytest.approx(4, abs=0.5)
    assert float((folder / "timeMine.txt").read_text()) == pytest.approx(row["mean_seconds"], abs=1e-3)
