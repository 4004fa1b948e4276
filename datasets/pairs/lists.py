"""Read a list of pairs."""

import csv
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from semidense.datasets.errors import LayoutError, MissingFileError
from semidense.datasets.formats.files import read_text, user_path
from semidense.datasets.pairs.names import label
from semidense.datasets.pairs.pairing import Pair, pair_name

LISTS = (".csv", ".txt", ".tsv")
"""Endings of a list of pairs."""
_SEPARATORS = (",", ";", "\t")
_HEADER = [re.compile(rf"{side}([ _-]?(image|view|path|file|img))?", re.IGNORECASE) for side in ("left", "right")]
_EXPECTED = "expected left,right[,calibration]"
_LARGEST_LIST = 1 << 22


def read_list(path: Path) -> list[Pair]:
    """Read a list of pairs: a line each, ``left,right`` or ``left,right,calibration``, relative to the list's folder.

    A semicolon or a tab may stand for the comma. Empty lines, lines that start with ``#`` and a first line
    ``Left,Right...`` or ``left_image,right_image...`` are passed over, as are empty fields at a line's end.

    Raises:
        MissingFileError: If the list or a file in it does not exist.
        LayoutError: If a line has other fields, or there is no pair.
    """
    lines = read_text(path, _LARGEST_LIST, LayoutError, "list of pairs").splitlines()
    pairs = [_pair(path, number, fields) for number, fields in _rows(lines, _separator(path, lines))]
    if not pairs:
        raise LayoutError(f"{path}: names no pair; write left,right[,calibration], a line each")
    return _distinct(pairs)


def _rows(lines: list[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the fields of each line that is neither empty, a comment nor the header."""
    first = True
    for number, row in enumerate(csv.reader(lines, delimiter=separator, skipinitialspace=True), start=1):
        fields = [item.strip() for item in row]
        if not any(fields) or fields[0].startswith("#"):
            continue
        if not (first and _is_header(fields)):
            yield number, fields
        first = False


def _is_header(fields: list[str]) -> bool:
    return len(fields) > 1 and all(head.fullmatch(item) for head, item in zip(_HEADER, fields, strict=False))


def _separator(path: Path, lines: list[str]) -> str:
    """Return what separates two fields that are files in the first line; a comma where nothing does."""
    for separator in _SEPARATORS:
        _, fields = next(_rows(lines, separator), (0, []))
        if len(fields) > 1 and all(_place(path, item).is_file() for item in fields[:2]):
            return separator
    return next((sign for sign in _SEPARATORS if lines and sign in lines[0]), _SEPARATORS[0])


def _pair(path: Path, number: int, fields: list[str]) -> Pair:
    while fields and not fields[-1]:  # as spreadsheets write them
        fields = fields[:-1]
    if len(fields) not in (2, 3, 4) or not all(fields):
        raise LayoutError(f"{path}, line {number}: {','.join(fields)[:60]!r}; {_EXPECTED}")
    files = [_place(path, item) for item in fields]
    for file in files:
        if not file.is_file():
            raise MissingFileError(f"{path}, line {number}: {file}: no such file")
    return Pair(pair_name(files[0]), files[0], files[1], tuple(files[2:]))


def _place(path: Path, item: str) -> Path:
    return path.parent / user_path(item)


def _distinct(pairs: list[Pair]) -> list[Pair]:
    """Name pairs of one name by their folder too, and those that are still alike by their place in the list."""
    pairs = _renamed(
        pairs, [f"{pair.left.resolve().parent.name}/{label(pair.left.stem) or pair.left.stem}" for pair in pairs]
    )
    return _renamed(pairs, [f"{pair.name}-{place}" for place, pair in enumerate(pairs, start=1)])


def _renamed(pairs: list[Pair], longer: list[str]) -> list[Pair]:
    count = Counter(pair.name for pair in pairs)
    return [
        replace(pair, name=name) if count[pair.name] > 1 else pair for pair, name in zip(pairs, longer, strict=True)
    ]
