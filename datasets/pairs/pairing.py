"""Find which left view belongs to which right one: by what their names say, never by their order.

Two folders are paired by the names of their files without the words that tell the views apart (``left_007.png`` and
``right_007.png`` are both ``007``); two patterns by the text that their ``*`` stands for; a list by its lines.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from semidense.datasets.errors import LayoutError, MissingFileError

LISTS = (".csv", ".txt")
"""Endings of a list of pairs."""
_IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm")
_SIDES = {"left", "right", "l", "r", "im0", "im1", "cam0", "cam1", "view0", "view1"}
_WORDS = re.compile(r"[^A-Za-z0-9]+")
_LARGEST_LIST = 1 << 22


@dataclass(frozen=True)
class Pair:
    """Name two files that belong together.

    Attributes:
        name: What both have in common.
        left: The left view.
        right: The right view.
        calib: Calibration files of this pair, if its list names some.
    """

    name: str
    left: Path
    right: Path
    calib: tuple[Path, ...] = field(default=())


def find_pairs(left: str, right: str) -> list[Pair]:
    """Pair two files, two folders, or two patterns with one ``*`` each, in the order of their names.

    Raises:
        MissingFileError: If one does not exist.
        LayoutError: If views are left without a counterpart, or two of one side have the same name.
    """
    sides = [Path(text).expanduser() for text in (left, right)]
    if any("*" in text for text in (left, right)) and not any(side.exists() for side in sides):
        pairs = _paired(*((text, _matches(text)) for text in (left, right)))
        names = {_common(pair.left.stem) for pair in pairs}
        return [replace(pair, name=_common(pair.left.stem)) for pair in pairs] if len(names) == len(pairs) else pairs
    for side in sides:
        if not side.exists():
            raise MissingFileError(f"{side}: no such file or folder")
    if all(side.is_dir() for side in sides):
        return _paired(*((str(side), _contents(side)) for side in sides))
    if any(side.is_dir() for side in sides):
        raise LayoutError(f"{left} and {right}: one is a folder; give two files, two folders or two patterns")
    return [Pair(_name(sides[0]), sides[0], sides[1])]


def read_list(path: Path) -> list[Pair]:
    """Read a list of pairs: a line each, ``left,right`` or ``left,right,calibration``, relative to the list's folder.

    Empty lines, lines that start with ``#`` and a first line ``left,right...`` are passed over.

    Raises:
        MissingFileError: If the list or a file in it does not exist.
        LayoutError: If a line has other fields, or there is no pair.
    """
    pairs = []
    for number, row in enumerate(csv.reader(_text(path).splitlines(), skipinitialspace=True), start=1):
        fields = [item.strip() for item in row]
        if not any(fields) or fields[0].startswith("#") or (number == 1 and fields[:2] == ["left", "right"]):
            continue
        if len(fields) not in (2, 3, 4) or not all(fields):
            raise LayoutError(f"{path}, line {number}: {','.join(row)[:60]!r}; expected left,right[,calibration]")
        files = [path.parent / Path(item).expanduser() for item in fields]
        _require_files(files, f"{path}, line {number}")
        pairs.append(Pair(_name(files[0]), files[0], files[1], tuple(files[2:])))
    if not pairs:
        raise LayoutError(f"{path}: names no pair; write left,right[,calibration], a line each")
    return _distinct(pairs)


def _require_files(files: Iterable[Path], where: str) -> None:
    for file in files:
        if not file.is_file():
            raise MissingFileError(f"{where}: {file}: no such file")


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_LIST + 1)
        if len(content) > _LARGEST_LIST:
            raise LayoutError(f"{path}: more than {_LARGEST_LIST:,} bytes; the file is no list of pairs")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LayoutError(f"{path}: no plain text; expected left,right[,calibration], a line each") from error


def _matches(pattern: str) -> list[tuple[str, Path]]:
    """Return what the one ``*`` of a pattern stands for in each file that it fits."""
    if pattern.count("*") != 1:
        raise LayoutError(f"{pattern}: give exactly one * in each of the two patterns; it pairs them")
    path = Path(pattern).expanduser()
    if "*" not in path.name:
        raise LayoutError(f"{pattern}: the * must stand in the file's name")
    before, after = path.name.split("*")
    files = [file for file in sorted(_files(path.parent)) if file.name.startswith(before) and file.name.endswith(after)]
    return [(file.name[len(before) : len(file.name) - len(after)], file) for file in files]


def _contents(folder: Path) -> list[tuple[str, Path]]:
    images = [path for path in sorted(_files(folder)) if path.suffix.lower() in _IMAGES]
    return [(_common(path.stem) or path.stem, path) for path in images]


def _files(folder: Path) -> list[Path]:
    try:
        return [path for path in folder.iterdir() if path.is_file()]
    except OSError as error:
        raise MissingFileError(f"{folder}: cannot be listed ({error.strerror})") from error


def _paired(left: tuple[str, list[tuple[str, Path]]], right: tuple[str, list[tuple[str, Path]]]) -> list[Pair]:
    for where, found in (left, right):
        twice = [name for name, count in Counter(name for name, _ in found).items() if count > 1]
        if not found or twice:
            raise LayoutError(f"{where}: several images are {twice[0]!r}" if twice else f"{where}: no image there")
    lefts, rights = dict(left[1]), dict(right[1])
    for here, there, names in ((left, right, lefts.keys() - rights), (right, left, rights.keys() - lefts)):
        if names:
            raise LayoutError(
                f"{here[0]}: {len(names)} of {len(here[1])} images have no counterpart among the {len(there[1])} "
                f"of {there[0]}, {min(names)!r} first"
            )
    return [Pair(name, path, rights[name]) for name, path in lefts.items()]


def _common(stem: str) -> str:
    """Return a name without the words that tell the two views apart.

    >>> _common("scene_left_007")
    'scene_007'
    """
    return "_".join(word for word in _WORDS.split(stem) if word and word.lower() not in _SIDES)


def _name(left: Path) -> str:
    """Name a pair by its left file, or by its folder where the file says no more than its side."""
    return _common(left.stem) or left.resolve().parent.name or "pair"


def _distinct(pairs: list[Pair]) -> list[Pair]:
    """Name pairs of one name by their folder too, and those that are still alike by their place in the list."""
    pairs = _renamed(pairs, [f"{pair.left.resolve().parent.name}/{pair.name}" for pair in pairs])
    return _renamed(pairs, [f"{pair.name}-{place}" for place, pair in enumerate(pairs, start=1)])


def _renamed(pairs: list[Pair], longer: list[str]) -> list[Pair]:
    count = Counter(pair.name for pair in pairs)
    return [
        replace(pair, name=name) if count[pair.name] > 1 else pair for pair, name in zip(pairs, longer, strict=True)
    ]
