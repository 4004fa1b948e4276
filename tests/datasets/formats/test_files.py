"""Pipes hang a program that opens them, and are empty the second time: they are refused before they are opened."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import MissingFileError, image_size, open_dataset, read_calib, read_image, read_pfm
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.formats.files import open_file, read_bytes, user_path
from semidense.datasets.pairs.lists import read_list


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "read",
    [open_file, read_image, image_size, read_pfm, read_calib, read_list, lambda path: read_cameras([path])],
    ids=["file", "image", "header", "pfm", "calib", "list", "cameras"],
)
def test_a_pipe_is_refused_in_one_line(tmp_path: Path, read: Callable[[Path], object]) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(MissingFileError, match=r"cannot be read \(a pipe or a device: save .* as a file") as refused:
        read(tmp_path / "pipe.csv")
    assert "\n" not in str(refused.value)


@pytest.mark.timeout(20)
def test_a_pipe_as_a_view_or_its_calibration(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    Image.fromarray(np.zeros((4, 5), np.uint8)).save(tmp_path / "a.png")
    for spec in ("{0}/pipe,{0}/a.png", "{0}/a.png,{0}/pipe", "{0}/a.png,{0}/a.png,calib={0}/pipe"):
        with pytest.raises(MissingFileError, match="pipe"):
            open_dataset("pair:" + spec.format(tmp_path))


def test_a_file_above_the_limit_is_of_the_kind_that_the_caller_names(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert read_bytes(tmp_path / "a", 5, ValueError, "note") == b"12345"  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="more than 4 bytes; the file is no note"):
        read_bytes(tmp_path / "a", 4, ValueError, "note")  # type: ignore[arg-type]


def test_a_tilde_is_a_home_folder_unless_a_file_is_called_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "/home/me")
    assert user_path("~/left.png") == Path("/home/me/left.png")
    assert user_path("~nobody-of-this-name/left.png") == Path("~nobody-of-this-name/left.png")
    Path("~left.png").touch()
    assert user_path("./~left.png") == Path("~left.png")
