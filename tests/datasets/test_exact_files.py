import hashlib
import os
from pathlib import Path

import pytest

from semidense.datasets.errors import DatasetError, ImageError, MissingFileError
from semidense.datasets.exact_files import exact_files, file_digest
from semidense.datasets.formats.images import read_image


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "left.png"
    path.write_bytes(b"pixels")
    return path


def test_what_is_read_is_what_was_hashed(file: Path) -> None:
    digest = file_digest(file)
    assert digest == hashlib.sha256(b"pixels").hexdigest()
    with exact_files({"left": file, "other": file}, {"left": digest}) as files:
        file.write_bytes(b"others")
        assert files["left"].read_bytes() == b"pixels", "a change while it is read does not matter"
        assert files["left"].name == "left.png"
        assert files["other"] == file, "what no digest is known of is read as it is"
    assert not files["left"].exists()


def test_a_file_that_changed_is_refused_in_one_line(file: Path) -> None:
    digest = file_digest(file)
    file.write_bytes(b"others")
    with pytest.raises(DatasetError, match=rf"^{file}: it was changed since the run was planned[^\n]+$"):
        exact_files({"left": file}, {"left": digest}).__enter__()


def test_what_is_wrong_with_a_copy_is_told_of_the_file(file: Path) -> None:
    with (
        pytest.raises(ImageError, match=rf"^{file}: no image"),
        exact_files({"left": file}, {"left": file_digest(file)}) as files,
    ):
        read_image(files["left"])


def test_only_plain_files_are_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "none", Path("/dev/zero")):
        with pytest.raises(MissingFileError, match=rf"^{path}: cannot be read"):
            file_digest(path)


def test_a_zarr_folder_is_one_content(tmp_path: Path) -> None:
    """A name, a byte or a file more makes another digest; what is read is a copy of all that was hashed."""
    store = tmp_path / "v.zarr"
    (store / "c").mkdir(parents=True)
    (store / "zarr.json").write_text("{}")
    (store / "c" / "0").write_bytes(b"cost")
    digest = file_digest(store)
    with exact_files({"costs": store}, {"costs": digest}) as files:
        (store / "c" / "0").rename(store / "c" / "1")
        assert (files["costs"] / "c" / "0").read_bytes() == b"cost"
    assert file_digest(store) != digest
    with pytest.raises(DatasetError, match="it was changed"):
        exact_files({"costs": store}, {"costs": digest}).__enter__()
