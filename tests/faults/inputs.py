"""Rows 11 and 12: bad images, maps, calibrations, configurations, weights and archives."""

import io
import json
import random
import struct
import tarfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from semidense.cache import Store
from semidense.cache.upkeep.archive import export_entries, import_entries
from semidense.datasets.formats.calibration.middlebury import read_calib
from semidense.datasets.formats.images import read_image
from semidense.datasets.formats.pfm import read_pfm, write_pfm
from semidense.datasets.formats.png16 import read_png16
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import USER_ERRORS
from semidense.stages.transforms.channels import compute_channels
from semidense.stages.transforms.declaration import ChannelsParams
from tests.faults import world
from tests.faults.tally import Tally

CALIB = (
    b"cam0=[100 0 24; 0 100 20; 0 0 1]\ncam1=[100 0 24; 0 100 20; 0 0 1]\n"
    b"doffs=0\nbaseline=50\nwidth=48\nheight=40\nndisp=4\n"
)
Read = Callable[[Path], object]


def expect_one_line(tally: Tally, what: str, work: Callable[[], object], *, refused: bool | None = True) -> None:
    """Count a bad input: it is refused in one line; with ``refused=None`` it may also be read."""
    tally.injected += 1
    try:
        work()
    except USER_ERRORS as error:
        if "\n" in str(error) or not str(error) or refused is False:
            tally.fail("tracebacks", f"{what}: {str(error)!r}")
    except Exception as error:  # noqa: BLE001 - that is what is looked for
        tally.fail("tracebacks", f"{what}: {error!r}")
    else:
        if refused:
            tally.fail("wrong", f"{what} was taken")


def _saved(image: Image.Image, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, **{"format": "PNG", **options})
    return file.getvalue()


def _png_of(columns: int, rows: int) -> bytes:
    """Return a PNG whose header claims a size that its data do not have."""

    def part(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", header) + part(b"IDAT", zlib.compress(bytes(99))) + part(b"IEND", b"")


def _images() -> Iterator[tuple[str, bytes, bool | None]]:
    """Yield images by name, and whether they must be refused; False: read, and right."""
    gray = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(6, 8))
    good = _saved(gray)
    yield from (("empty", b"", True), ("zeros", bytes(500), True), ("text", b"P5 hello\n" * 9, True))
    yield from ((f"first {n} bytes", good[:n], True) for n in (1, 8, 20, 33, 40))
    yield "wrong magic", b"\x88" + good[1:], True
    yield "GIF", _saved(gray, format="GIF"), True
    yield "WebP", _saved(gray, format="WEBP"), True
    yield "1 x 1", _saved(Image.new("L", (1, 1))), False
    yield "constant", _saved(Image.new("L", (9, 9), 77)), False
    yield "16 bits", _saved(Image.fromarray(np.full((4, 4), 60000, np.uint16))), False
    yield "palette", _saved(gray.convert("P")), False
    yield "1 bit", _saved(gray.convert("1")), False
    yield "gray with alpha", _saved(gray.convert("LA")), False
    yield "colour with alpha", _saved(gray.convert("RGBA")), False
    yield "float TIFF", _saved(gray.convert("F"), format="TIFF"), True
    yield "CMYK JPEG", _saved(gray.convert("CMYK"), format="JPEG"), True
    yield "two pages", _saved(gray, format="TIFF", save_all=True, append_images=[gray]), True
    for columns, rows in ((65535, 65535), (2**31 - 1, 2**31 - 1), (0, 5), (5, 0), (100000, 1000)):
        yield f"claims {columns} x {rows}", _png_of(columns, rows), True
    chance = random.Random(11)
    for number in range(40):
        data = bytearray(good)
        for _ in range(1 + number % 4):
            data[chance.randrange(8, len(data))] ^= 1 << chance.randrange(8)
        yield f"flips {number}", bytes(data), None


def bad_images(scale: float) -> Tally:
    """Read images that are damaged, hostile or unusual; transform constant images and single pixels."""
    tally = Tally()
    with world.folder() as root:
        for name, data, refused in _images():
            _from_file(tally, root.parent / "image", f"image: {name}", data, read_image, refused)
            if refused:
                _from_file(tally, root.parent / "image", f"16-bit map: {name}", data, read_png16, refused)
    for size in ((1, 1), (1, 40), (40, 1), (9, 9)):
        for value in (0, 255):
            views = {side: np.full((*size, 1), value, np.uint8) for side in ("left", "right")}
            images = {"images": {**views, "moments": np.array([[value, 0.0]] * 2)}}
            expect_one_line(tally, f"constant {size}", lambda images=images: _finite(images), refused=False)
    return tally


def _finite(images: dict[str, dict[str, np.ndarray]]) -> None:
    made = compute_channels(ChannelsParams(), images)["channels"]
    if not np.isfinite(made).all():
        raise ArithmeticError("a channel is not finite")


def _from_file(tally: Tally, path: Path, what: str, data: bytes, read: Read, refused: bool | None) -> None:
    path.write_bytes(data)
    expect_one_line(tally, what, lambda: read(path), refused=refused)


def _bad_pfms() -> Iterator[tuple[str, bytes, bool | None]]:
    pixels = np.arange(12, dtype="<f4").tobytes()
    good = b"Pf\n4 3\n-1.0\n" + pixels
    yield from ((f"first {n} bytes", good[:n], True) for n in range(0, len(good), 3))
    headers = (
        b"PF\n4 3\n-1\n",
        b"P5\n4 3\n-1\n",
        b"Pf\n4\n-1\n",
        b"Pf\n4 3 1\n-1\n",
        b"Pf\n-4 3\n-1\n",
        b"Pf\n0 3\n-1\n",
        b"Pf\n4 3\n0\n",
        b"Pf\n4 3\nnan\n",
        b"Pf\n4 3\ninf\n",
        b"Pf\n4 3\nx\n",
        b"Pf\n99999 99999\n-1\n",
        b"Pf 4 3 -1\n",
        b"Pf\n" + b"4" * 70 + b" 3\n-1\n",
        b"Pf\n" + b"9" * 5000 + b"\n",
        b"Pf\n4.0 3\n-1\n",
        b"\xff\xfe\n4 3\n-1\n",
    )
    yield from ((repr(header[:20]), header + pixels, True) for header in headers)
    yield "one byte more", good + b"\0", True


def _bad_calibs() -> Iterator[tuple[str, bytes, bool | None]]:
    yield from (("empty", b"", True), ("binary", bytes(range(256)), True), ("huge", b"a=1\n" * 20000, True))
    lines = CALIB.splitlines(keepends=True)
    for number, line in enumerate(lines):
        name = line.partition(b"=")[0].decode()
        rest = b"".join(lines[:number] + lines[number + 1 :])
        if name != "cam1":
            yield f"no {name}", rest, True
            for value in (b"", b"x", b"nan", b"inf", b"1e999", b"[1 2; 3]"):
                yield f"{name}={value!r}", rest + name.encode() + b"=" + value + b"\n", True
        yield f"{name} twice", CALIB + line, True
    for name in ("width", "height", "ndisp", "baseline"):
        yield f"{name}=-1", CALIB.replace(f"{name}=".encode(), f"{name}=-".encode()), True


def _bad_configs() -> Iterator[tuple[str, bytes, bool | None]]:
    texts = (
        "x",
        "[semidense]\nR=2",
        "[semidense]\nR='a'",
        "[semidense]\nR=nan",
        "[semidens]\nR=1",
        "semidense=3",
        "[[semidense]]",
        "[semidense]\nr=1",
        "[channels]\nrank_window=2",
        "[channels]\nuse=[]",
        "[channels]\nuse=['x']",
        "[costvolume]\nd_min=1.5",
        "[matching_net]\nsteps=0",
        "[matching_net]\nsteps=1e99",
        "a=" + "[" * 2000,
        "[a.b.c]\nd=1",
        "[semidense]\nR=1\nR=1",
        "\x00",
    )
    yield from ((repr(text[:30]), text.encode(), True) for text in texts)
    yield "no UTF-8", b"\xff\xfe=1", True


def bad_files(scale: float) -> Tally:
    """Read bad maps, calibrations, configurations, weights and archives."""
    tally = Tally()
    with world.folder() as root:
        path = root.parent / "file"
        tables: tuple[tuple[str, Iterator[tuple[str, bytes, bool | None]], Read], ...] = (
            ("PFM", _bad_pfms(), read_pfm),
            ("calib.txt", _bad_calibs(), read_calib),
            ("configuration", _bad_configs(), Config.load),
            ("weights", _bad_weights(), _read_weights),
        )
        for kind, table, read in tables:
            for name, data, refused in table:
                _from_file(tally, path, f"{kind}: {name}", data, read, refused)
        _archives(tally, root, scale)
        expect_one_line(tally, "no finite map", lambda: write_pfm(path, np.full((2, 2), 1e300)))
    return tally


def _read_weights(path: Path) -> object:
    from semidense.stages.weights import read_weights

    return read_weights("matching_net", path.read_bytes())


class Boom:
    """A pickle of it would leave a file behind, if anything ever loaded it."""

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, ("/tmp/pickle-was-loaded", "w")


def _bad_weights() -> Iterator[tuple[str, bytes, bool | None]]:
    import pickle

    import torch

    good = Path("stages/weights/matching_net.safetensors")
    data = (Path(__file__).parents[2] / good).read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + length])
    yield from (("empty", b"", True), ("zeros", bytes(64), True), ("pickle", pickle.dumps(Boom()), True))
    file = io.BytesIO()
    torch.save({"a": torch.zeros(3)}, file)
    yield "a torch file, which holds a pickle", file.getvalue(), True
    yield from ((f"first {n} bytes", data[:n], True) for n in (4, 8, 100, 8 + length, len(data) // 2, len(data) - 1))
    yield "trailing bytes", data + b"\0", True
    yield "a header that never ends", struct.pack("<Q", 2**62) + data[8:], True
    yield (
        "the other network's",
        (Path(__file__).parents[2] / good).with_name("evaluation_net.safetensors").read_bytes(),
        True,
    )
    yield "too large", bytes(64 * 2**20 + 1), True
    for what, old, new in (
        ("shape", '"shape":[', '"shape":[1,'),
        ("type", '"F32"', '"F16"'),
        ("name", "weight", "wight"),
    ):
        text = json.dumps(header, separators=(",", ":")).replace(old, new, 1).encode()
        yield f"another {what}", struct.pack("<Q", len(text)) + text + data[8 + length :], True
    for what, bits in (("NaN", b"\x00\x00\xc0\x7f"), ("infinity", b"\x00\x00\x80\x7f")):
        yield what, data[: 8 + length] + bits + data[12 + length :], True


def _archives(tally: Tally, root: Path, scale: float) -> None:
    """Import archives with hostile members, and with every kind of damage; nothing but whole entries comes in."""
    source, path = Store(root), root.parent / "archive.tar"
    made = world.run(source, world.whole())
    digests = {each.key: each.digest for each in made.values()}
    export_entries(source, digests if scale >= 1 else sorted(digests)[:1], path)
    good = path.read_bytes()
    outside = root.parent / "outside"
    outside.mkdir()
    for what, data in (*_hostile(good), *_flipped(good, 20 if scale < 1 else 400)):
        path.write_bytes(data)
        with world.folder() as place:
            store = Store(place)
            expect_one_line(tally, f"archive: {what}", lambda s=store: list(import_entries(s, path)), refused=None)
            for entry in store.entries():
                if store.check(entry.key) is not None or digests.get(entry.key) != entry.digest:
                    tally.fail("wrong", f"archive: {what}: {entry.label} came in")
            if left := world.leftovers(store):
                tally.fail("leftovers", f"archive: {what}: {left[0]}")
            strange = {file.name for file in place.parent.iterdir()} - {"cache"}
            if strange or any(outside.iterdir()):
                tally.fail("wrong", f"archive: {what}: wrote {strange} outside of the cache")


def _flipped(good: bytes, number: int) -> Iterator[tuple[str, bytes]]:
    chance = random.Random(12)
    for _ in range(number):
        offset, data = chance.randrange(len(good)), bytearray(good)
        data[offset] ^= 1 << chance.randrange(8)
        yield f"a bit flipped at {offset}", bytes(data)
    for length in [chance.randrange(len(good)) for _ in range(number // 4)]:
        yield f"first {length} bytes", good[:length]


def _hostile(good: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield archives with one thing in them that no export writes."""
    with tarfile.open(fileobj=io.BytesIO(good)) as archive:
        members = [(member, archive.extractfile(member).read()) for member in archive]  # type: ignore[union-attr]
    key = members[0][0].name.partition("/")[0]

    def rebuilt(changed: Callable[[list[tuple[tarfile.TarInfo, bytes]]], object]) -> bytes:
        copies = [(tarfile.TarInfo(member.name), data) for member, data in members]
        changed(copies)
        file = io.BytesIO()
        with tarfile.open(fileobj=file, mode="w") as archive:
            for member, data in copies:
                member.size = len(data) if member.isreg() else 0
                archive.addfile(member, io.BytesIO(data))
        return file.getvalue()

    def named(name: str, kind: bytes = tarfile.REGTYPE, link: str = "") -> tarfile.TarInfo:
        member = tarfile.TarInfo(name)
        member.type, member.linkname = kind, link
        return member

    for name in (
        "../outside/x",
        "/tmp/x",
        f"{key}/../../x",
        f"{key}/data.zarr/../../x",
        f"{key}/data.zarr/..",
        "x",
        f"{key}/x",
        f"{key}/data.zarr/.hidden",
        f"{key}/data.zarr//x",
        f"{key}/data.zarr/a\nb",
        f"{key.upper()}/record.json",
        "C:\\x",
    ):
        for place in (0, 2, len(members)):
            yield f"a member {name!r} at {place}", rebuilt(lambda m, n=name, p=place: m.insert(p, (named(n), b"x")))
    kinds = (
        (tarfile.SYMTYPE, "link"),
        (tarfile.LNKTYPE, "hard link"),
        (tarfile.DIRTYPE, "folder"),
        (tarfile.FIFOTYPE, "pipe"),
        (tarfile.CHRTYPE, "device"),
    )
    for kind, what in kinds:
        for index in (0, 1, 2):
            name = members[index][0].name
            yield (
                f"{what} in place of {name[65:]}",
                rebuilt(lambda m, i=index, k=kind, n=name: m.__setitem__(i, (named(n, k, "../outside"), b""))),
            )
    for index in range(min(8, len(members))):
        name = members[index][0].name[65:]
        yield f"without {name}", rebuilt(lambda m, i=index: m.pop(i))
        yield f"{name} twice", rebuilt(lambda m, i=index: m.insert(i, m[i]))
        yield f"{name} longer", rebuilt(lambda m, i=index: m.__setitem__(i, (m[i][0], m[i][1] + b"\0")))
        yield f"{name} empty", rebuilt(lambda m, i=index: m.__setitem__(i, (m[i][0], b"")))
    yield "an entry twice", rebuilt(lambda m: m.extend(m[:]))
    yield "nothing", b""
    yield "compressed, which may be a bomb", _gzipped(good)
    yield from _bombs(members, rebuilt)


def _gzipped(data: bytes) -> bytes:
    import gzip

    return gzip.compress(data)


def _bombs(members: list[tuple[tarfile.TarInfo, bytes]], rebuilt: Callable[..., bytes]) -> Iterator[tuple[str, bytes]]:
    """Yield archives whose record, manifest and digests all agree, and whose arrays are not as written here."""
    from semidense.cache.entries.entry import Entry, File, Manifest

    key = members[0][0].name.partition("/")[0]
    own = [(member.name[65:], data) for member, data in members if member.name.startswith(key)]
    entry, files = Entry.from_bytes(key, own[0][1]), dict(own[2:])
    array = next(name for name in files if name.count("/") == 2 and name.endswith("zarr.json"))

    def sealed(changed: dict[str, bytes]) -> bytes:
        from dataclasses import replace
        from hashlib import sha256

        rows = [File(name, len(data), sha256(data).hexdigest()) for name, data in sorted(changed.items())]
        manifest = Manifest(tuple(rows))
        record = replace(entry, digest=manifest.digest, size=manifest.size)
        documents = [
            ("record.json", record.to_bytes()),
            ("manifest.json", manifest.to_bytes()),
            *sorted(changed.items()),
        ]
        return rebuilt(
            lambda m: m.__setitem__(slice(None), [(tarfile.TarInfo(f"{key}/{name}"), data) for name, data in documents])
        )

    about = json.loads(files[array])
    grid = about["chunk_grid"]
    sides = len(about["shape"])
    edits: dict[str, dict[str, object]] = {
        "an array of a petabyte": {
            "shape": [2**25] * sides,
            "chunk_grid": {**grid, "configuration": {"chunk_shape": [2**25] * sides}},
        },
        "endless many chunks": {"shape": [2**60] * sides},
        "a codec that runs code": {"codecs": [{"name": "numcodecs.pickle", "configuration": {}}]},
        "no checksums": {
            "codecs": [{"name": "bytes"}, {"name": "zstd", "configuration": {"level": 1, "checksum": False}}]
        },
        "objects": {"data_type": "object"},
        "negative lengths": {"shape": [-1] * sides},
        "something unknown": {"extra": 1},
        "other chunks": {"chunk_grid": {**grid, "configuration": {"chunk_shape": [7] * sides}}},
    }
    for what, edit in edits.items():
        yield what, sealed({**files, array: json.dumps({**about, **edit}).encode()})
    chunk = next(name for name in files if "/c/" in name)
    for what, data in (
        ("a frame that decodes to 2^40 bytes", b"\x28\xb5\x2f\xfd\xe0" + (2**40).to_bytes(8, "little") + bytes(9)),
        ("a frame of unknown size", b"\x28\xb5\x2f\xfd\x00\x58" + bytes(9)),
        ("no frame", bytes(20)),
    ):
        yield what, sealed({**files, chunk: data})
    yield "a chunk too few", sealed({name: data for name, data in files.items() if name != chunk})
    yield "a file too many", sealed({**files, f"{chunk}7": b"x"})
