import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin
from PIL.ImageFile import ImageFile

from semidense.datasets.errors import ImageError, MissingFileError
from semidense.datasets.formats import images, limits
from semidense.datasets.formats.images import image_size, read_image

GRAY = np.arange(6, dtype=np.uint8).reshape(2, 3) * 40
RGB = np.stack([GRAY, GRAY + 1, GRAY + 2], axis=2)
DEEP = np.arange(6, dtype=np.uint16).reshape(2, 3) * 13000


def encode(image: Image.Image, form: str = "PNG", **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, form, **options)
    return buffer.getvalue()


def png(colour_type: int, depth: int, columns: int, rows: int, data: bytes) -> bytes:
    """A PNG made by hand, as Pillow writes no 16-bit colour and no false sizes."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    header = struct.pack(">IIBBBBB", columns, rows, depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def palette() -> Image.Image:
    image = Image.new("P", (2, 1))
    image.putpalette([10, 20, 30, 200, 100, 50])
    image.putdata([0, 1])
    return image


def turned(form: str, orientation: int, image: Image.Image | None = None) -> bytes:
    exif = Image.Exif()
    exif[0x0112] = orientation
    return encode(image or Image.fromarray(GRAY), form, exif=exif)


@pytest.mark.parametrize(
    "content, expected",
    [
        pytest.param(encode(Image.fromarray(GRAY)), GRAY, id="8-bit gray"),
        pytest.param(encode(Image.fromarray(RGB)), RGB, id="8-bit RGB"),
        pytest.param(encode(Image.fromarray(DEEP)), DEEP, id="16-bit gray PNG stays 16-bit"),
        pytest.param(encode(Image.fromarray(DEEP), "TIFF"), DEEP, id="16-bit gray TIFF stays 16-bit"),
        pytest.param(encode(Image.fromarray(DEEP), "TIFF", compression="tiff_lzw"), DEEP, id="compressed TIFF"),
        pytest.param(b"P5\n3 2\n65535\n" + DEEP.astype(">u2").tobytes(), DEEP, id="16-bit PGM stays 16-bit"),
        pytest.param(b"P2\n3 2\n65535\n" + b" ".join(b"%d" % v for v in DEEP.ravel()), DEEP, id="16-bit PGM as text"),
        pytest.param(b"P6\n3 2\n255\n" + RGB.tobytes(), RGB, id="PPM"),
        pytest.param(encode(Image.fromarray(RGB), "BMP"), RGB, id="BMP"),
        pytest.param(encode(palette()), np.array([[[10, 20, 30], [200, 100, 50]]]), id="palette becomes RGB"),
        pytest.param(
            encode(Image.fromarray(np.dstack([RGB, np.zeros_like(GRAY)]))), RGB, id="alpha dropped, colour as stored"
        ),
        pytest.param(encode(Image.merge("LA", [Image.fromarray(GRAY)] * 2)), GRAY, id="gray with alpha"),
        pytest.param(encode(Image.fromarray(GRAY > 100)), np.where(GRAY > 100, 255, 0), id="1 bit becomes 0 and 255"),
        pytest.param(encode(Image.new("L", (1, 1), 7)), np.array([[7]]), id="one pixel"),
    ],
)
def test_reads_what_is_stored(tmp_path: Path, content: bytes, expected: np.ndarray) -> None:
    path = tmp_path / "image.dat"
    path.write_bytes(content)
    image = read_image(path)
    assert image.dtype == (np.uint16 if expected is DEEP else np.uint8)
    np.testing.assert_array_equal(image, expected)
    assert image_size(path) == image.shape[:2]
    image[0] = 0


@pytest.mark.parametrize("form", ["PNG", "TIFF"])
@pytest.mark.parametrize(
    "orientation, expected",
    [
        pytest.param(1, GRAY, id="upright"),
        pytest.param(2, GRAY[:, ::-1], id="mirrored"),
        pytest.param(3, GRAY[::-1, ::-1], id="upside down"),
        pytest.param(4, GRAY[::-1], id="flipped"),
        pytest.param(5, GRAY.T, id="transposed"),
        pytest.param(6, np.rot90(GRAY, -1), id="turn clockwise"),
        pytest.param(7, np.rot90(GRAY, 2).T, id="transversed"),
        pytest.param(8, np.rot90(GRAY), id="turn anticlockwise"),
        pytest.param(0, GRAY, id="0, which legacy writers use for unknown"),
        pytest.param(9, GRAY, id="9, which means nothing"),
    ],
)
def test_applies_the_exif_orientation(tmp_path: Path, form: str, orientation: int, expected: np.ndarray) -> None:
    path = tmp_path / "image.dat"
    path.write_bytes(turned(form, orientation))
    np.testing.assert_array_equal(read_image(path), expected)
    assert image_size(path) == expected.shape


@pytest.mark.parametrize(
    "image, expected",
    [
        pytest.param(palette(), [[[200, 100, 50], [10, 20, 30]]], id="palette: the sides swap, not the channels"),
        pytest.param(Image.merge("LA", [Image.fromarray(GRAY)] * 2), GRAY[:, ::-1], id="gray with alpha"),
        pytest.param(Image.fromarray(RGB), RGB[:, ::-1], id="colour"),
        pytest.param(Image.fromarray(DEEP), DEEP[:, ::-1], id="16-bit gray"),
    ],
)
def test_mirrors_what_is_left_after_the_conversion(tmp_path: Path, image: Image.Image, expected: np.ndarray) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(turned("PNG", 2, image))
    np.testing.assert_array_equal(read_image(path), expected)


def test_an_orientation_after_the_pixels_does_not_count(tmp_path: Path) -> None:
    content = turned("PNG", 6)
    start = content.index(b"eXIf") - 4
    end = start + 12 + int.from_bytes(content[start : start + 4], "big")
    path = tmp_path / "image.png"
    path.write_bytes(content[:start] + content[end:-12] + content[start:end] + content[-12:])
    np.testing.assert_array_equal(read_image(path), GRAY)
    assert image_size(path) == GRAY.shape


def test_no_other_decoder_is_chosen_by_what_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Greedy(ImageFile):
        format = "GREEDY"

        def _open(self) -> None:
            self._size, self._mode = (9, 9), "L"

    path = tmp_path / "image.png"
    path.write_bytes(encode(Image.fromarray(GRAY)))
    monkeypatch.setattr(Image, "ID", ["GREEDY", *Image.ID])
    monkeypatch.setitem(Image.OPEN, "GREEDY", (Greedy, None))
    with pytest.raises(ImageError, match="reads as PNG and as GREEDY"):
        read_image(path)


def test_jpeg_is_read_upright(tmp_path: Path) -> None:
    path = tmp_path / "image.jpg"
    path.write_bytes(turned("JPEG", 6))
    assert read_image(path).shape == image_size(path) == (3, 2)


@pytest.mark.parametrize(
    ("largest", "stored", "expected", "kind"),
    [
        pytest.param(1, [0, 1], [0, 255], np.uint8, id="1 bit"),
        pytest.param(100, [0, 20, 100], [0, 51, 255], np.uint8, id="up to 100: 20 x 2.55"),
        pytest.param(1023, [0, 341, 1023], [0, 21845, 65535], np.uint16, id="10 bits: a third stays a third"),
        pytest.param(4095, [0, 1365, 4095], [0, 21845, 65535], np.uint16, id="12 bits"),
    ],
)
@pytest.mark.parametrize("plain", [False, True])
def test_a_pgm_is_scaled_by_its_own_largest_value(
    tmp_path: Path, largest: int, stored: list[int], expected: list[int], kind: type, plain: bool
) -> None:
    path, width = tmp_path / "a.pgm", ">u1" if largest < 256 else ">u2"
    pixels = " ".join(map(str, stored)).encode() if plain else np.array(stored, width).tobytes()
    path.write_bytes(f"{'P2' if plain else 'P5'}\n{len(stored)} 1\n{largest}\n".encode() + pixels)
    found = read_image(path)
    assert (found.tolist(), found.dtype) == ([expected], kind)


def pages(path: Path, *kinds: int | None, old: bool = False) -> Path:
    """A TIFF with a page for each NewSubfileType, or old SubfileType; previews and masks are smaller."""
    with TiffImagePlugin.AppendingTiffWriter(str(path), True) as file:
        for kind in kinds:
            tags = {} if kind is None else {255 if old else 254: kind}
            full = kind in ((1, None) if old else (0, None))
            Image.fromarray(GRAY if full else GRAY[:1, :1]).save(file, "TIFF", tiffinfo=tags)
            file.newFrame()
    return path


@pytest.mark.parametrize(
    ("kinds", "old"),
    [
        pytest.param((0, 1), False, id="a preview after the picture"),
        pytest.param((1, 0), False, id="a preview before it"),
        pytest.param((None, 1, 1), False, id="overviews of a map"),
        pytest.param((0, 4), False, id="a mask"),
        pytest.param((1, 2), True, id="the old tag"),
    ],
)
def test_the_picture_of_a_tiff_with_previews_is_read(tmp_path: Path, kinds: tuple[int | None, ...], old: bool) -> None:
    path = pages(tmp_path / "a.tif", *kinds, old=old)
    assert image_size(path) == GRAY.shape
    np.testing.assert_array_equal(read_image(path), GRAY)


@pytest.mark.parametrize("kinds", [(0, 0), (None, None), (2, 2)], ids=["two pictures", "nothing said", "two pages"])
@pytest.mark.parametrize("read", [read_image, image_size])
def test_several_pictures_in_a_tiff_are_refused_from_the_header(
    tmp_path: Path, kinds: tuple[int | None, ...], read: Callable[[Path], object]
) -> None:
    with pytest.raises(ImageError, match="holds 2 images; save the one to match by itself"):
        read(pages(tmp_path / "a.tif", *kinds))


def test_a_palette_with_alpha_is_read_without_a_warning(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    Image.fromarray(np.dstack([GRAY] * 4)).quantize(8).save(tmp_path / "a.png")
    assert read_image(tmp_path / "a.png").shape == (2, 3, 3)


def animation() -> bytes:
    frames = [Image.new("L", (2, 2), value) for value in (0, 255)]
    return encode(frames[0], "TIFF", save_all=True, append_images=frames[1:])


BAD_IMAGES = [
    pytest.param(b"", "no image in PNG", id="empty file"),
    pytest.param(b"\x89PNG\r\n\x1a\n", "no image in PNG", id="PNG signature only"),
    pytest.param(encode(Image.fromarray(RGB.repeat(40, 0)))[:-30], "damaged image", id="truncated PNG"),
    pytest.param(encode(Image.fromarray(RGB.repeat(40, 0)), "JPEG")[:-60], "damaged image", id="truncated JPEG"),
    pytest.param(encode(Image.fromarray(GRAY), "TIFF")[:-140], "image", id="truncated TIFF"),
    pytest.param(b"P5\n3 2\n255\n\0\0", "damaged image", id="truncated PGM"),
    pytest.param(b"P5\nx 2\n255\n\0\0", "image", id="PGM without a size"),
    pytest.param(b"hello, I am a text", "no image in PNG", id="a text"),
    pytest.param(encode(Image.fromarray(RGB), "GIF"), "no image in PNG", id="a GIF, not among the formats"),
    pytest.param(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "no image in PNG", id="a PostScript program"),
    pytest.param(b"Pf\n1 1\n-1\n\0\0\0\0", "pixels are F", id="a PFM, whose floats are no image"),
    pytest.param(encode(Image.new("CMYK", (2, 2)), "TIFF"), "pixels are CMYK", id="CMYK"),
    pytest.param(encode(Image.new("F", (2, 2)), "TIFF"), "pixels are F", id="float"),
    pytest.param(encode(Image.new("LAB", (2, 2)), "TIFF"), "pixels are LAB", id="another colour space"),
    pytest.param(encode(Image.new("I", (2, 2), -5), "TIFF"), "do not fit 16 bits", id="negative 32-bit gray"),
    pytest.param(encode(Image.new("I", (2, 2), 70000), "TIFF"), "do not fit 16 bits", id="32-bit gray"),
    pytest.param(png(2, 16, 2, 1, b"\0" + bytes(12)), "16-bit colour", id="16-bit RGB would lose 8 bits"),
    pytest.param(png(6, 16, 2, 1, b"\0" + bytes(16)), "16-bit colour", id="16-bit RGBA"),
    pytest.param(
        png(4, 16, 2, 1, b"\0" + bytes(8)), "16-bit gray with alpha would be cut", id="16-bit gray with alpha"
    ),
    pytest.param(
        b"P5\n1 2\n1023\n\x03\xff\x04\x00", "1024, but the header says that 1023 is the largest", id="10-bit PGM"
    ),
    pytest.param(b"P5\n1 2\n100\n\x64\x65", "101, but the header says that 100 is the largest", id="7-bit PGM"),
    pytest.param(b"P6\n1 1\n100\n\x64\x65\x00", "101, but the header says that 100 is the largest", id="7-bit PPM"),
    pytest.param(b"P6\n1 1\n65535\n" + bytes(6), "16-bit colour", id="16-bit PPM would lose 8 bits"),
    pytest.param(b"P3\n1 1\n1023\n1 2 3\n", "16-bit colour", id="10-bit PPM in plain text"),
    pytest.param(b"P5\n1 1\n70000\n" + bytes(4), "damaged image", id="a largest value that PGM does not have"),
    pytest.param(encode(Image.fromarray(GRAY), "TIFF", tiffinfo={339: 2}), "with a sign", id="signed 8-bit gray"),
    pytest.param(encode(Image.fromarray(DEEP), "TIFF", tiffinfo={262: 0}), "0 means white", id="16-bit negative"),
    pytest.param(animation(), "holds 2 images", id="several images in one file"),
    pytest.param(png(0, 8, 9000, 9000, b"\0"), "9000 x 9000 = 81,000,000 pixels", id="above the limit"),
    pytest.param(png(0, 8, 60000, 60000, b"\0"), "pixels", id="decompression bomb"),
    pytest.param(png(0, 8, 3, 2, b"\0"), "damaged image", id="fewer pixels than the header says"),
]


@pytest.mark.parametrize("content, message", BAD_IMAGES)
@pytest.mark.filterwarnings("ignore::PIL.Image.DecompressionBombWarning")
def test_refuses_a_bad_image_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "image.dat"
    path.write_bytes(content)
    with pytest.raises(ImageError) as caught:
        read_image(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read", [read_image, image_size])
@pytest.mark.parametrize("name", ["absent.png", "."])
def test_names_what_cannot_be_opened(tmp_path: Path, read: Callable[[Path], object], name: str) -> None:
    with pytest.raises(MissingFileError, match="cannot be read"):
        read(tmp_path / name)


@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF", "BMP", "PPM"])
@pytest.mark.filterwarnings("ignore")
def test_garbled_bytes_give_an_image_or_an_image_error(tmp_path: Path, form: str) -> None:
    random = np.random.default_rng(0)
    path = tmp_path / "image.dat"
    content = encode(Image.fromarray(RGB), form)
    for _ in range(200):
        garbled = bytearray(content)
        for position in random.integers(min(len(content), 200), size=3):
            garbled[position] = random.integers(256)
        path.write_bytes(garbled)
        try:
            assert read_image(path).size
        except ImageError as error:
            assert "\n" not in str(error)


def test_the_limit_is_checked_before_a_pixel_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(png(0, 8, 3, 2, b"no pixels at all"))
    monkeypatch.setattr(limits, "MAX_PIXELS", 5)
    with pytest.raises(ImageError, match="2 x 3 = 6 pixels, above the limit of 5"):
        images.image_size(path)


def test_size_needs_the_header_only(tmp_path: Path) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(png(0, 8, 3, 2, b"no pixels at all"))
    assert image_size(path) == (2, 3)


def jpeg_of_two(path: Path, kind: bytes) -> Path:
    """A JPEG that holds two pictures (MPO), the second one of a kind: what a camera says of it, byte by byte."""
    first, second = (Image.new("RGB", (8, 6), colour) for colour in ((200, 0, 0), (0, 200, 0)))
    first.save(path, "MPO", save_all=True, append_images=[second])
    content = path.read_bytes()
    primary = b"\0\0\3\0"  # the first of the 16-byte entries: the primary image
    place = content.index(primary, content.index(b"MPF\0") + 20) + 16
    path.write_bytes(content[:place] + kind + content[place + 4 :])
    return path


@pytest.mark.parametrize(
    "kind",
    [pytest.param(b"\0\0\0\0", id="undefined, as gain maps are"), pytest.param(b"\1\0\1\0", id="a thumbnail")],
)
def test_a_jpeg_with_a_preview_is_the_picture_that_it_shows(tmp_path: Path, kind: bytes) -> None:
    path = jpeg_of_two(tmp_path / "a.jpg", kind)
    assert image_size(path) == (6, 8)
    assert np.abs(read_image(path).astype(int) - [200, 0, 0]).max() < 4


def test_a_3d_cameras_two_views_in_one_jpeg_are_refused(tmp_path: Path) -> None:
    path = jpeg_of_two(tmp_path / "a.mpo", b"\2\0\2\0")
    with pytest.raises(ImageError, match="holds 2 images; save the one to match by itself"):
        read_image(path)
