"""Archives that are what they should be, and one of every trick."""

import io
import os
import stat
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.datasets.errors import ArchiveError
from semidense.datasets.formats.archives import plain
from semidense.datasets.formats.archives.plain import FREE_BYTES, LARGEST_RATIO, Member, check_members
from semidense.datasets.formats.archives.unpack import unpack

FILES = {"Teddy/im0.png": b"left", "Teddy/im1.png": b"right", "notes.txt": b""}


def zip_of(path: Path, files: dict[str, bytes], mode: int = 0) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name)
            info.external_attr, info.compress_type = mode << 16, zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return path


def tar_of(path: Path, files: dict[str, bytes], change: Callable[[tarfile.TarInfo], None] = lambda info: None) -> Path:
    with tarfile.open(path, "w:gz" if path.suffix == ".gz" else "w") as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            change(info)
            archive.addfile(info, io.BytesIO(content))
    return path


def sevenzip_of(path: Path, files: dict[str, bytes]) -> Path:
    py7zr = pytest.importorskip("py7zr", reason="py7zr is not installed")
    with py7zr.SevenZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(content, name)
    return path


def tree(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "name, make",
    [("a.zip", zip_of), ("a.tar", tar_of), ("a.tar.gz", tar_of), ("A.ZIP", zip_of), ("a.7z", sevenzip_of)],
)
def test_every_kind_gives_its_files(tmp_path: Path, name: str, make: Callable[..., Path]) -> None:
    target = tmp_path / "data"
    files = unpack(make(tmp_path / name, FILES), target)
    assert tree(target) == FILES
    assert files == sorted(target / each for each in FILES)


def test_folders_of_two_archives_are_merged_and_a_file_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "data"
    unpack(zip_of(tmp_path / "images.zip", FILES), target)
    unpack(zip_of(tmp_path / "truth.zip", {"Teddy/disp0GT.pfm": b"truth", "Teddy/im0.png": b"new"}), target)
    assert tree(target) == FILES | {"Teddy/disp0GT.pfm": b"truth", "Teddy/im0.png": b"new"}


def link(info: tarfile.TarInfo) -> None:
    info.type, info.linkname = tarfile.SYMTYPE, "/etc/passwd"


def hard_link(info: tarfile.TarInfo) -> None:
    info.type, info.linkname = tarfile.LNKTYPE, "../../outside"


def device(info: tarfile.TarInfo) -> None:
    info.type = tarfile.CHRTYPE


def pipe(info: tarfile.TarInfo) -> None:
    info.type = tarfile.FIFOTYPE


TRICKS = [
    pytest.param({"/etc/cron.d/x": b"x"}, None, "leads out of the folder", id="an absolute path"),
    pytest.param({"../../x": b"x"}, None, "leads out of the folder", id="up and out"),
    pytest.param({"a/../../x": b"x"}, None, "leads out of the folder", id="up and out from a folder"),
    pytest.param({"..\\x": b"x"}, None, "leads out of the folder", id="up and out of Windows"),
    pytest.param({"C:/x": b"x"}, None, "leads out of the folder", id="a drive"),
    pytest.param({"a/x": b"1", "A/y": b"2"}, None, "upper and lower case only", id="folders that differ in case"),
    pytest.param({"a/x": b"1", "a/X": b"2"}, None, "upper and lower case only", id="files that differ in case"),
    pytest.param({"é": b"1", "e\u0301": b"2"}, None, "upper and lower case only", id="an accent in two ways"),
    pytest.param({"a": b"1", "a/x": b"2"}, None, "both a file and a folder", id="a file as a folder"),
    pytest.param({"a/x": b"1", "a": b"2"}, None, "both a file and a folder", id="a folder as a file"),
    pytest.param({"a\nb": b"1"}, None, "no name of a file", id="a line break in the name"),
    pytest.param({"a" * 2000: b"1"}, None, "no name of a file", id="an endless name"),
    pytest.param({"x": bytes(FREE_BYTES * 40)}, None, "times as large", id="a bomb"),
]


@pytest.mark.parametrize("files, change, message", TRICKS)
@pytest.mark.parametrize("ending", ["zip", "tar.gz"])
def test_a_trick_is_refused_and_nothing_is_unpacked(
    tmp_path: Path, ending: str, files: dict[str, bytes], change: None, message: str
) -> None:
    make: Callable[..., Path] = zip_of if ending == "zip" else tar_of
    refused(make(tmp_path / f"a.{ending}", {"good/first": b"1"} | files), tmp_path / "deep/data", message)


@pytest.mark.parametrize(
    "change, message",
    [
        (link, "is a link"),
        (hard_link, "is a link"),
        (device, "is a device"),
        (pipe, "is a device"),
    ],
)
def test_links_and_devices_of_a_tar_are_refused(
    tmp_path: Path, change: Callable[[tarfile.TarInfo], None], message: str
) -> None:
    refused(tar_of(tmp_path / "a.tar", {"x": b""}, change), tmp_path / "data", message)


@pytest.mark.parametrize("kind, message", [(stat.S_IFLNK, "is a link"), (stat.S_IFCHR, "is a device")])
def test_links_and_devices_of_a_zip_are_refused(tmp_path: Path, kind: int, message: str) -> None:
    refused(zip_of(tmp_path / "a.zip", {"x": b"/etc/passwd"}, kind | 0o777), tmp_path / "data", message)


def refused(archive: Path, target: Path, message: str) -> None:
    with pytest.raises(ArchiveError, match=message):
        unpack(archive, target)
    assert list(target.rglob("*")) == []
    assert {path.name for path in target.parents[0].iterdir()} <= {archive.name, target.name}


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_name_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("x", b"1")
        archive.writestr("x", b"2")
    refused(tmp_path / "a.zip", tmp_path / "data", "is there twice")


def test_a_name_cut_by_a_nul_is_refused(tmp_path: Path) -> None:
    path = zip_of(tmp_path / "a.zip", {"fine_name": b"1"})
    path.write_bytes(path.read_bytes().replace(b"fine_name", b"fine\0name"))
    refused(path, tmp_path / "data", "no name of a file")


def test_an_encrypted_zip_is_refused(tmp_path: Path) -> None:
    path = zip_of(tmp_path / "a.zip", {"x": b"1"})
    content = bytearray(path.read_bytes())
    content[6] |= 1
    content[content.index(b"PK\1\2") + 8] |= 1
    path.write_bytes(content)
    refused(path, tmp_path / "data", "is encrypted")


@pytest.mark.parametrize("name, make", [("a.zip", zip_of), ("a.tar.gz", tar_of), ("a.7z", sevenzip_of)])
@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "text"])
def test_a_damaged_archive_leaves_nothing(tmp_path: Path, name: str, make: Callable[..., Path], damage: str) -> None:
    path = make(tmp_path / name, {"x": os.urandom(5000)})
    whole = path.read_bytes()
    flipped = whole[:1000] + bytes([whole[1000] ^ 255]) + whole[1001:]
    path.write_bytes({"cut": whole[:2000], "flipped": flipped, "empty": b"", "text": b"<html>404</html>"}[damage])
    refused(path, tmp_path / "data", "a\\..*(damaged|known)")


def test_a_file_of_no_known_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.rar").touch()
    with pytest.raises(ArchiveError, match="no zip, tar or 7z"):
        unpack(tmp_path / "a.rar", tmp_path / "data")


def test_a_link_in_the_folder_that_leads_out_of_it_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "outside").mkdir()
    (tmp_path / "data/Teddy").symlink_to(tmp_path / "outside")
    with pytest.raises(ArchiveError, match="leads out of"):
        unpack(zip_of(tmp_path / "a.zip", FILES), tmp_path / "data")
    assert list((tmp_path / "outside").iterdir()) == []


def test_the_ratio_is_met_exactly() -> None:
    budget = FREE_BYTES + LARGEST_RATIO * 7
    check_members(Path("a"), [Member("x", "file", budget)], 7)
    with pytest.raises(ArchiveError, match="100 times"):
        check_members(Path("a"), [Member("x", "file", budget), Member("y", "file", 1)], 7)


def test_too_many_members_are_refused_without_listing_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain, "MOST_MEMBERS", 10)
    endless = (Member(f"{number}", "file", 0) for number in range(10**9))
    with pytest.raises(ArchiveError, match="more than 10 members"):
        check_members(Path("a"), endless, 1)
    assert next(endless).name == "11"
