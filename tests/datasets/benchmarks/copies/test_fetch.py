"""The whole of a fetch, against a publisher on loopback: archives in the published layouts, and what may go wrong."""

import hashlib
import io
import json
import os
import zipfile
from contextlib import nullcontext
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import requests
from PIL import Image

from semidense.datasets.benchmarks.copies.catalogue import publication, publications, state
from semidense.datasets.benchmarks.copies.download import Resumable
from semidense.datasets.benchmarks.copies.fetch import Fetch
from semidense.datasets.benchmarks.copies.lock import Lock
from semidense.datasets.benchmarks.copies.publication import Publication, Source
from semidense.datasets.errors import ArchiveError, FetchError, MissingFileError, UnknownDatasetError
from semidense.datasets.formats.pfm import write_pfm
from semidense.datasets.registry import open_dataset
from tests.datasets.benchmarks.copies.conftest import Publisher

CALIB = "cam0=[9 0 4; 0 9 3; 0 0 1]\ndoffs=1\nbaseline=50\nwidth=8\nheight=6\nndisp=4\n"


def png(array: object = None, kind: str = "PNG") -> bytes:
    pixels = np.full((6, 8, 3), 100, np.uint8) if array is None else np.asarray(array)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind)
    return file.getvalue()


def gray(level: int, dtype: type = np.uint8, kind: str = "PNG") -> bytes:
    return png(np.full((6, 8), level, dtype), kind)


@pytest.fixture
def pfm(tmp_path: Path) -> bytes:
    write_pfm(tmp_path / "two.pfm", np.full((6, 8), 2, np.float32))
    return (tmp_path / "two.pfm").read_bytes()


def zipped(files: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return file.getvalue()


def fetcher(data: Path, origin: str | None, largest: int = 1 << 20) -> Fetch:
    return Fetch(data, Lock(data / "fetched.lock"), origin, lambda _: nullcontext(lambda here, total: None), largest)


def published(name: str, pfm: bytes) -> dict[str, bytes]:
    """Return the files of a publication in their publisher's layout, by the end of their path."""
    views = {"im0.png": png(), "im1.png": png(), "calib.txt": CALIB.encode()}
    pair = {"view1.png": png(), "view5.png": png(), "disp1.png": gray(6), "disp5.png": gray(6)}
    kitti = {f"training/{each}/000000_10.png": png() for each in ("image_2", "image_3", "image_0", "image_1")}
    truth = {f"training/{each}/000000_10.png": gray(512, np.uint16) for each in ("disp_occ_0", "disp_noc_0")}
    truth |= {f"training/{each}/000000_10.png": gray(512, np.uint16) for each in ("disp_occ", "disp_noc")}
    scene = "MiddEval3/trainingQ/Teddy"
    return {
        "middlebury2001": {
            **{each: png(kind="PPM") for each in ("im2.ppm", "im6.ppm")},
            **{each: gray(16, kind="PPM") for each in ("disp2.pgm", "disp6.pgm")},
            **{f"scene1.row3.col{column}.ppm": png(kind="PPM") for column in (3, 4)},
            "truedisp.row3.col3.pgm": gray(32, kind="PPM"),
        },
        "middlebury2003": {
            f"{each}-png-2.zip": zipped(
                {f"{each}/{file}.png": png() for file in ("im2", "im6")}
                | {f"{each}/{file}.png": gray(8) for file in ("disp2", "disp6")}
            )
            for each in ("cones", "teddy")
        },
        "middlebury2006": {"ALL-2views.zip": zipped({f"Aloe/{each}": content for each, content in pair.items()})},
        "middlebury2021": {
            "all.zip": zipped({f"data/chess1/{each}": content for each, content in views.items()}
                              | {"data/chess1/disp0.pfm": pfm, "data/chess1/disp1.pfm": pfm})
        },
        "middeval3-q": {
            "MiddEval3-data-Q.zip": zipped({f"{scene}/{each}": content for each, content in views.items()}),
            "MiddEval3-GT0-Q.zip": zipped({f"{scene}/disp0GT.pfm": pfm, f"{scene}/mask0nocc.png": gray(255)}),
            "MiddEval3-GT1-Q.zip": zipped({f"{scene}/disp1GT.pfm": pfm}),
        },
        "kitti2012": {"data_stereo_flow.zip": zipped(kitti | truth), "data_stereo_flow_calib.zip": zipped({})},
        "kitti2015": {"data_scene_flow.zip": zipped(kitti | truth), "data_scene_flow_calib.zip": zipped({})},
    }[name]  # fmt: skip


def put(publisher: Publisher, wanted: Publication, files: dict[str, bytes]) -> None:
    for source in wanted.sources:
        path = urlsplit(source.address).path.lstrip("/")
        publisher.files[path] = files[path.rpartition("/")[2]]


@pytest.mark.parametrize(
    "name, scenes",
    [
        ("middlebury2001", ["barn1", "barn2", "bull", "poster", "sawtooth", "tsukuba", "venus"]),
        ("middlebury2003", ["cones", "teddy"]),
        ("middlebury2006", ["Aloe"]),
        ("middlebury2021", ["data/chess1"]),
        ("middeval3-q", ["Teddy"]),
        ("kitti2012", ["000000_10"]),
        ("kitti2015", ["000000_10"]),
    ],
)
def test_a_published_layout_is_fetched_and_read(
    tmp_path: Path, publisher: Publisher, pfm: bytes, name: str, scenes: list[str]
) -> None:
    wanted, data = publication(name), tmp_path / "data"
    put(publisher, wanted, published(name, pfm))
    assert state(wanted, data) == "no"
    fetcher(data, publisher.address)(wanted)
    assert state(wanted, data) == "yes"
    found = open_dataset(wanted.spec_of(data)).scenes
    assert [each.name for each in found] == scenes
    for each in found:
        truth = each.load_truth()
        assert truth is not None
        np.testing.assert_array_equal(truth.disparity, 2)
    entries = json.loads((data / "fetched.lock").read_text())
    assert entries.keys() == {source.address for source in wanted.sources}
    for source in wanted.sources:
        content = publisher.files[urlsplit(source.address).path.lstrip("/")]
        assert entries[source.address] == {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    assert not (data / ".archives").exists()


def test_the_7z_archives_of_eth3d_are_fetched_and_read(tmp_path: Path, publisher: Publisher, pfm: bytes) -> None:
    py7zr = pytest.importorskip("py7zr", reason="py7zr is not installed")
    views = {"im0.png": gray(9), "im1.png": gray(9), "calib.txt": CALIB.encode()}
    contents = {
        "two_view_training": {f"playground_1l/{each}": content for each, content in views.items()},
        "two_view_training_gt": {"playground_1l/disp0GT.pfm": pfm, "playground_1l/mask0nocc.png": gray(255)},
        "two_view_test": {f"lakeside_1l/{each}": content for each, content in views.items()},
    }
    for name, files in contents.items():
        with py7zr.SevenZipFile(tmp_path / "a.7z", "w") as archive:
            for each, content in files.items():
                archive.writestr(content, each)
        publisher.files[f"data/{name}.7z"] = (tmp_path / "a.7z").read_bytes()
    fetcher(tmp_path / "data", publisher.address)(publication("eth3d"))
    found = {each.name: each for each in open_dataset(f"eth3d:{tmp_path / 'data/eth3d'}").scenes}
    assert {name: each.has_truth for name, each in found.items()} == {
        "two_view_training/playground_1l": True,
        "two_view_test/lakeside_1l": False,
    }
    truth = found["two_view_training/playground_1l"].load_truth()
    assert truth is not None and truth.mask == "published" and (truth.disparity == 2).all()


def test_every_address_is_https_and_every_name_is_there_once() -> None:
    offered = publications()
    assert {f"middeval3-{size}" for size in "qhf"} | {"kitti2012", "kitti2015", "eth3d"} < offered.keys()
    assert {f"middlebury{year}" for year in (2001, 2003, 2005, 2006, 2014, 2021)} < offered.keys()
    for each in offered.values():
        assert all(source.address.startswith("https://") for source in each.sources)
        assert len({(source.address, source.folder) for source in each.sources}) == len(each.sources)
        assert each.spec.partition(":")[0] in ("middlebury", "kitti2012", "kitti2015", "eth3d")


def test_a_wrong_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownDatasetError, match="did you mean kitti2015"):
        publication("Kitti-2015")


SET = Publication("set", "middlebury:set", (Source("https://example.org/a/set.zip", "set"),), "", "", "")
CONTENT = zipped({"x.bin": os.urandom(600_000)})


def test_cut_connections_are_resumed(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["a/set.zip"], publisher.cuts = CONTENT, [200_000, 0, 300_000]
    fetch = fetcher(tmp_path, publisher.address)
    with pytest.raises(FetchError, match="the connection broke"):
        fetch(SET)
    assert state(SET, tmp_path) == "in part"
    fetch(SET)
    assert state(SET, tmp_path) == "yes"
    starts = [int(wanted.removeprefix("bytes=").rstrip("-") or 0) for _, wanted in publisher.asked]
    assert starts == sorted(starts) and starts[0] == 0 and len(starts) == 4
    assert starts[-1] >= 500_000 - 2 * 2**16


def test_without_ranges_a_cut_download_begins_anew(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["a/set.zip"], publisher.cuts, publisher.ranges = CONTENT, [300_000], False
    fetcher(tmp_path, publisher.address)(SET)
    assert state(SET, tmp_path) == "yes"
    assert [wanted for _, wanted in publisher.asked] == ["", ""]


def test_a_file_that_changed_meanwhile_begins_anew(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["a/set.zip"], publisher.cuts = os.urandom(len(CONTENT)), [300_000, 0]
    publisher.tags["a/set.zip"] = '"old"'
    with pytest.raises(FetchError):
        fetcher(tmp_path, publisher.address)(SET)
    publisher.files["a/set.zip"], publisher.tags["a/set.zip"] = CONTENT, '"new"'
    fetcher(tmp_path, publisher.address)(SET)
    assert (tmp_path / "set/x.bin").stat().st_size == 600_000


def test_other_bytes_than_the_recorded_ones_are_refused(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["a/set.zip"] = CONTENT
    fetcher(tmp_path, publisher.address)(SET)
    publisher.files["a/set.zip"] = zipped({"x.bin": b"other"})
    for origin in (publisher.address, str(tmp_path / "mirror")):
        (tmp_path / "mirror").mkdir(exist_ok=True)
        (tmp_path / "mirror/set.zip").write_bytes(publisher.files["a/set.zip"])
        with pytest.raises(
            FetchError, match=r"not the bytes whose sha256 is recorded for https://example.org/a/set.zip"
        ):
            fetcher(tmp_path, origin)(SET)
    assert (tmp_path / "set/x.bin").stat().st_size == 600_000


def test_redirects_are_followed_but_not_from_https_to_http(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["b/set.zip"] = CONTENT
    publisher.moved = {"a/set.zip": "/b/set.zip", "c": "/c"}
    fetcher(tmp_path, publisher.address)(SET)
    assert state(SET, tmp_path) == "yes"
    answer, earlier = requests.Response(), requests.Response()
    earlier.url, answer.url, answer.history = "https://example.org/x", "http://example.org/x", [earlier]
    with pytest.raises(FetchError, match="leads from https to http"):
        Resumable(tmp_path / "part")._check("https://example.org/x", answer)
    with pytest.raises(FetchError, match="leads in a circle"):
        Resumable(tmp_path / "part")(f"{publisher.address}/c", str(tmp_path / "out"), None)


@pytest.mark.parametrize("largest", [len(CONTENT) - 1, 1000])
def test_more_bytes_than_the_cap_are_not_fetched(tmp_path: Path, publisher: Publisher, largest: int) -> None:
    publisher.files["a/set.zip"] = CONTENT
    with pytest.raises(FetchError, match="more than"):
        fetcher(tmp_path, publisher.address, largest)(SET)
    fetcher(tmp_path, publisher.address, len(CONTENT))(SET)


def test_what_the_server_refuses_is_told_in_one_line(tmp_path: Path, publisher: Publisher) -> None:
    with pytest.raises(FetchError, match=r"a/set.zip: the server answers 404 Not Found$"):
        fetcher(tmp_path, publisher.address)(SET)
    assert state(SET, tmp_path) == "no"


def test_a_server_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(FetchError, match=r"cannot be reached.*--from takes a mirror or a folder$"):
        fetcher(tmp_path, "http://127.0.0.1:9")(SET)


def test_a_hostile_archive_leaves_nothing_in_the_data(tmp_path: Path, publisher: Publisher) -> None:
    publisher.files["a/set.zip"] = zipped({"fine.txt": b"x", "../../evil.txt": b"x"})
    with pytest.raises(ArchiveError, match="leads out of the folder"):
        fetcher(tmp_path / "data", publisher.address)(SET)
    assert not list(tmp_path.rglob("*.txt"))


def test_a_folder_of_files_is_taken_by_path_or_by_a_name_that_is_the_only_one(tmp_path: Path, pfm: bytes) -> None:
    wanted, mirror = publication("middeval3-q"), tmp_path / "mirror"
    mirror.mkdir()
    for name, content in published("middeval3-q", pfm).items():
        (mirror / name).write_bytes(content)
    fetcher(tmp_path / "data", str(mirror))(wanted)
    assert state(wanted, tmp_path / "data") == "yes"
    assert sorted(each.name for each in mirror.iterdir()) == sorted(published("middeval3-q", pfm))
    (mirror / "im2.ppm").write_bytes(png(kind="PPM"))
    with pytest.raises(MissingFileError, match=r"no .*scenes2001/data/barn1/im2.ppm; --from needs"):
        fetcher(tmp_path / "data", str(mirror))(publication("middlebury2001"))


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1}', '{"a": {"sha256": "x"}}'])
def test_a_damaged_lock_file_is_refused(tmp_path: Path, publisher: Publisher, text: str) -> None:
    publisher.files["a/set.zip"] = CONTENT
    (tmp_path / "fetched.lock").write_text(text)
    with pytest.raises(FetchError, match="no valid lock file"):
        fetcher(tmp_path, publisher.address)(SET)
    assert not (tmp_path / "set").exists()
