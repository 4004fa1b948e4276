"""Read images as the arrays they are: 8 or 16 bits, gray or RGB, upright, never cut down in silence.

A file's header is judged first, then imageio decodes with its Pillow plugin: PNG, JPEG, TIFF, BMP and PPM/PGM, and
nothing else gets a chance. No other decoder is ever chosen by what happens to be installed, and a file's extension does
not count.
"""

import os
import re
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TypeAlias

import numpy as np
from PIL import Image, UnidentifiedImageError
from PIL.ImageFile import ImageFile

from semidense.datasets.arrays import ImageArray
from semidense.datasets.errors import ImageError, MissingFileError
from semidense.datasets.formats.files import open_file
from semidense.datasets.formats.limits import check_pixels

# The size is judged by `check_pixels`, in one line; Pillow's warning would be a second one.
warnings.filterwarnings("ignore", category=Image.DecompressionBombWarning)
# Alpha is dropped, in palettes too.
warnings.filterwarnings("ignore", "Palette images with Transparency", UserWarning, r"PIL\.Image")

_Pixels: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.integer]]
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM")
_DECODER_ERRORS = (OSError, EOFError, SyntaxError, ValueError, TypeError, LookupError, ArithmeticError, struct.error)
"""What Pillow's decoders raise on truncated or garbled files."""
_ORIENTATION = 0x0112
_PHOTOMETRIC, _WHITE_IS_ZERO = 0x0106, 0
_SAMPLE_FORMAT, _SIGNED = 0x0153, 2
_KIND, _OLD_KIND = 0x00FE, 0x00FF
"""What a page of a TIFF says of itself: bit 0, or 2 in the old tag, is a smaller version; bit 2 is a mask."""
_EIGHT_BITS = 255
_MP_ENTRIES = 0xB002
"""What a JPEG of several images (MPO) says of each of them."""
_TRANSPOSED = 5
"""The first EXIF orientation that swaps rows and columns, as all above it do."""
_STEPS = {1: (1, 1), 2: (1, -1), 3: (-1, -1), 4: (-1, 1), 5: (1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}
"""Which way to walk down and across, once rows and columns are swapped, for each EXIF orientation."""
_CONVERSIONS = {
    **{mode: mode for mode in ("L", "RGB", "I", "I;16", "I;16B", "I;16L")},
    "1": "L",
    "P": "RGB",
    "LA": "L",
    "RGBA": "RGB",
}


def read_image(path: str | os.PathLike[str]) -> ImageArray:
    """Read an image.

    What is stored decides what comes back: gray gives (y, x), colour and palettes give (y, x, 3) RGB; 16-bit gray
    stays uint16, everything else is uint8. Alpha is dropped: colours are taken as stored, not blended with anything.
    The values of a PGM or PPM are scaled by its own largest value: to 65535 if that is above 255, else to 255. Of a
    TIFF with smaller versions and masks, the page that is neither is read. The EXIF orientation is applied.

    Returns:
        uint8 or uint16, (y, x) or (y, x, 3), writable.

    Raises:
        MissingFileError: If there is no such file.
        ImageError: If the file is damaged, no image, above `MAX_PIXELS` (known before a pixel is decoded), holds
            several images, or stores what would not survive: 16-bit colour, floats, signed 8-bit numbers, a PGM's
            values above its own largest one, CMYK and other colour spaces.
    """
    path = Path(path)
    with _opened(path) as (file, image):
        orientation, mode = _orientation(image), _target_mode(path, image)
        _check_largest(path, file, image)
        return _to_array(path, _upright(_decoded(path, file, image, mode), orientation))


def read_stored(path: str | os.PathLike[str]) -> ImageArray:
    """Read an image whose values mean something, such as disparities; as `read_image` otherwise.

    Raises:
        ImageError: Also if it is a PGM whose values would be scaled.
    """
    with open_file(Path(path)) as file:
        head = re.sub(rb"#[^\n]*", b"", file.read(512)).split()
    if head[:1] in ([b"P2"], [b"P5"]) and head[3:4] not in ([b"255"], [b"65535"]):
        raise ImageError(f"{path}: a PGM whose largest value is not 255 or 65535 would be scaled; save it as PNG")
    return read_image(path)


def image_size(path: str | os.PathLike[str]) -> tuple[int, int]:
    """Read an image's rows and columns, as `read_image` would return them, from its header alone.

    Raises:
        MissingFileError: If there is no such file.
        ImageError: If the header is damaged, no image's, or above `MAX_PIXELS`.
    """
    with _opened(Path(path)) as (_, image):
        columns, rows = image.size
        return (columns, rows) if _orientation(image) >= _TRANSPOSED else (rows, columns)


@contextmanager
def _opened(path: Path) -> Iterator[tuple[BinaryIO, ImageFile]]:
    """Open a file and turn whatever goes wrong with it, now or later, into one line."""
    try:
        with open_file(path) as file, Image.open(file, formats=_FORMATS) as image:
            _turn_to_picture(path, image)
            check_pixels(path, image.height, image.width, ImageError)
            yield file, image
    except (ImageError, MissingFileError):
        raise
    except UnidentifiedImageError as error:
        raise ImageError(
            f"{path}: no image in {', '.join(_FORMATS)}; it is empty, damaged or of another kind: save it as PNG"
        ) from error
    except Image.DecompressionBombError as error:
        raise ImageError(f"{path}: far too many pixels; scale the image down") from error
    except _DECODER_ERRORS as error:
        raise ImageError(f"{path}: damaged image ({' '.join(str(error).split())})") from error


def _orientation(image: ImageFile) -> int:
    # Pillow turns TIFF by itself. Elsewhere only what stands before the pixels counts: the header must give the size.
    if "exif" not in image.info or image.format == "TIFF":
        return 1
    exif = Image.Exif()
    exif.load(image.info["exif"])
    orientation = int(exif.get(_ORIENTATION, 1))
    return orientation if orientation in _STEPS else 1


def _turn_to_picture(path: Path, image: ImageFile) -> None:
    """Turn to the only page that is neither a preview nor a mask; raises `ImageError` if there are several."""
    count = getattr(image, "n_frames", 1)
    if count == 1 or _only_previews(image):
        return
    pages = [page for page in range(count) if image.format != "TIFF" or _is_picture(image, page)]
    if len(pages) != 1:
        raise ImageError(f"{path}: holds {count} images; save the one to match by itself")
    image.seek(pages[0])


def _is_picture(image: ImageFile, page: int) -> bool:
    image.seek(page)
    tags = image.getexif()
    return not int(tags.get(_KIND, 0)) & 0b101 and int(tags.get(_OLD_KIND, 1)) != 2


def _target_mode(path: Path, image: ImageFile) -> str:
    for tile in image.tile:
        layout, *rest = tile.args if isinstance(tile.args, tuple) else (tile.args,)
        _check_depth(path, image.mode, layout, rest if tile.codec_name.startswith("ppm") else [])
    if image.format == "TIFF" and image.mode.startswith("I") and image.getexif().get(_PHOTOMETRIC) == _WHITE_IS_ZERO:
        raise ImageError(f"{path}: 0 means white in this 16-bit TIFF; save it with 0 as black")
    if image.format == "TIFF" and image.mode not in ("F", "I") and _is_signed(image):
        raise ImageError(f"{path}: 8-bit values with a sign, which would wrap round; save it as unsigned 8 or 16 bits")
    if image.mode == "F":
        raise ImageError(
            f"{path}: pixels are F, floats whose range nothing tells; scale both views alike to 0..65535, save 16 bits"
        )
    if image.mode not in _CONVERSIONS:
        raise ImageError(f"{path}: pixels are {image.mode}; convert the image to gray or RGB")
    return _CONVERSIONS[image.mode]


def _is_signed(image: ImageFile) -> bool:
    return _SIGNED in np.atleast_1d(image.getexif().get(_SAMPLE_FORMAT, 1))


def _only_previews(image: ImageFile) -> bool:
    """Tell whether the further images of a JPEG are previews or the camera's own extras, not views of the scene."""
    entries = getattr(image, "mpinfo", {}).get(_MP_ENTRIES, [])
    kinds = [entry["Attribute"]["MPType"] for entry in entries[1:]]
    return bool(kinds) and not any(kind.startswith("Multi-Frame") for kind in kinds)


def _check_depth(path: Path, mode: str, layout: object, largest: list[object]) -> None:
    # What Pillow is about to do is in the tile: it cuts 16-bit colour to 8 bits.
    deep = (isinstance(layout, str) and ";16" in layout) or any(int(str(value)) > _EIGHT_BITS for value in largest)
    if deep and not mode.startswith("I"):
        kind = "gray with alpha" if str(layout).startswith("LA") else "colour"
        raise ImageError(
            f"{path}: 16-bit {kind} would be cut to 8 bits; save it as 8-bit colour, or as 16-bit gray without alpha"
        )


def _check_largest(path: Path, file: BinaryIO, image: ImageFile) -> None:
    """Refuse a binary PGM or PPM with values above the largest one that its header tells: Pillow clips them."""
    for tile in image.tile:
        if tile.codec_name == "ppm" and isinstance(tile.args, tuple):
            largest = int(tile.args[-1])
            file.seek(tile.offset)
            kind = np.dtype(">u2" if largest > _EIGHT_BITS else np.uint8)
            length = image.width * image.height * len(image.getbands()) * kind.itemsize
            stored = np.frombuffer(file.read(length), kind)
            if stored.max(initial=0) > largest:
                raise ImageError(
                    f"{path}: a value of {stored.max()}, but the header says that {largest} is the largest"
                )


def _decoded(path: Path, file: BinaryIO, header: ImageFile, mode: str) -> _Pixels:
    import imageio.v3 as iio  # sizes and checks need headers only

    # imageio lets every format known to Pillow bid for the file, not only those the header was judged by.
    page = header.tell()
    chosen = Image.open(file).format
    if chosen != header.format:
        raise ImageError(f"{path}: reads as {header.format} and as {chosen}; save it again as PNG")
    return iio.imread(file, plugin="pillow", index=page, mode=mode)


def _upright(array: _Pixels, orientation: int) -> _Pixels:
    # Not imageio's `rotate`: it mixes up the axes of palettes and of gray with alpha, and heeds tags after the pixels.
    down, across = _STEPS[orientation]
    turned = array.swapaxes(0, 1) if orientation >= _TRANSPOSED else array
    return np.ascontiguousarray(turned[::down, ::across])


def _to_array(path: Path, array: _Pixels) -> ImageArray:
    if array.dtype == np.uint8:
        return array.astype(np.uint8, copy=False)
    if array.min() < 0 or array.max() > np.iinfo(np.uint16).max:
        raise ImageError(
            f"{path}: gray values from {array.min()} to {array.max()} do not fit 16 bits; scale both views alike"
        )
    return array.astype(np.uint16, copy=False)
