"""The `data` commands through the entry point."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.datasets.benchmarks.copies.catalogue import publication

Invoke = Callable[..., Any]
SHIFT = 3


def textured(folder: Path, shift: int = SHIFT) -> Path:
    """Write a scene of 2003 whose truth is 3 px, and whose right view is shifted by as much or by another amount."""
    folder.mkdir(parents=True)
    texture = np.random.default_rng(3).integers(0, 255, (40, 80, 3), np.uint8)
    Image.fromarray(texture[:, :60]).save(folder / "im2.png")
    Image.fromarray(texture[:, shift : 60 + shift]).save(folder / "im6.png")
    for name in ("disp2.png", "disp6.png"):
        Image.fromarray(np.full((40, 60), 4 * SHIFT, np.uint8)).save(folder / name)
    return folder


def test_a_benchmark_is_fetched_from_a_folder_and_checked(invoke: Invoke, tmp_path: Path) -> None:
    for name in ("cones", "teddy"):
        scene = textured(tmp_path / "source" / name)
        with zipfile.ZipFile(tmp_path / f"{name}-png-2.zip", "w") as archive:
            for file in scene.iterdir():
                archive.write(file, f"{name}/{file.name}")
    data = tmp_path / "data"
    ran = invoke("data", "fetch", "middlebury2003", "--from", tmp_path, "--data", data)
    assert (ran.code, ran.out.splitlines()[0]) == (0, "middlebury2003: fetched")
    assert "cite Scharstein & Szeliski, CVPR 2003" in ran.out
    ran = invoke("data", "fetch", "middlebury2003", "--data", data, "--json")
    spec = publication("middlebury2003").spec_of(data)
    assert json.loads(ran.out) == {
        "name": "middlebury2003", "dataset": spec, "fetched": False, "lock": str(data / "fetched.lock"),
    }  # fmt: skip
    ran = invoke("data", "check", spec)
    assert (ran.code, ran.out.splitlines()[-1]) == (0, "2 scenes: 2 sound")


def test_a_wrong_copy_is_told_and_the_exit_code_is_1(invoke: Invoke, tmp_path: Path) -> None:
    textured(tmp_path / "2003/cones", shift=2 * SHIFT)
    textured(tmp_path / "2003/teddy")
    ran = invoke("data", "check", f"middlebury:{tmp_path}")
    assert ran.code == 1
    assert "2003/cones: 2 times the truth carries the right view onto the left one better" in ran.out
    assert ran.out.splitlines()[-1] == "2 scenes: 1 sound, 1 with something wrong"
    ran = invoke("data", "check", f"middlebury:{tmp_path}", "--scene", "teddy", "--json")
    (row,) = json.loads(ran.out)["scenes"]
    assert (ran.code, row["scene"], row["problems"], row["scale"]) == (0, "2003/teddy", [], 1)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["fetch", "kitty2015"], "pipeline: nothing named 'kitty2015' can be fetched; did you mean kitti2015?\n"),
        (["fetch", "kitti2015", "--from", "ftp.example.org"], "--from needs one of them\n"),
        (["check", "middlebury:/nowhere"], "no such folder"),
    ],
)
def test_a_mistake_is_one_line(invoke: Invoke, tmp_path: Path, arguments: list[str], message: str) -> None:
    ran = invoke("data", *arguments, *(["--data", tmp_path] if arguments[0] == "fetch" else []))
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert message in ran.err


def test_the_folder_of_data_is_that_of_the_environment(
    invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STEREO_DATA", str(tmp_path))
    found = json.loads(invoke("data", "list", "--json").out)["publications"]
    assert all(str(tmp_path) in row["dataset"] for row in found)
