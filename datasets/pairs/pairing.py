"""Find which left view belongs to which right one: by what their names say, never by their order.

Two folders are paired by equal names, or by names that differ in the word for the side (``left_007.png`` and
``right_007.png``); two patterns by the text that their ``*`` stands for. Hidden files, such as macOS' ``._007.png``,
are passed over.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

from semidense.datasets.errors import LayoutError, MissingFileError
from semidense.datasets.formats.files import user_path
from semidense.datasets.pairs.names import Side, composed, label, look_alike, without_side

_IMAGES = (".png", ".jpg", ".jpeg", ".mpo", ".tif", ".tiff", ".bmp", ".ppm", ".pgm")
_WAYS_OUT = "give two patterns with one * each, or a list left,right (pairs.csv)"
_Keyed: TypeAlias = dict[str, Path]


@dataclass(frozen=True)
class Pair:
    """Name two files that belong together.

    Attributes:
        name: What both have in common.
        left: The left view.
        right: The right view.
        calib: Calibration files of this pair, if its list names some.
        warnings: What a person should know of how it was found, a line each.
    """

    name: str
    left: Path
    right: Path
    calib: tuple[Path, ...] = field(default=())
    warnings: tuple[str, ...] = ()


def find_pairs(left: str, right: str) -> list[Pair]:
    """Pair two files, two folders, or two patterns with one ``*`` each, in the order of their names.

    Files of a folder or pattern that have no counterpart are left out, and a warning of the first pair names them.

    Raises:
        MissingFileError: If one does not exist.
        LayoutError: If no pair is found, two files of one side have the same name, or names look alike but are not
            certain to belong together.
    """
    sides = [user_path(text) for text in (left, right)]
    if any("*" in text for text in (left, right)) and not any(side.exists() for side in sides):
        return _labelled(_paired(_matches(left), _matches(right), (left, right)))
    for side in sides:
        if not side.exists():
            raise MissingFileError(f"{side}: no such file or folder")
    if all(side.is_dir() for side in sides):
        return _labelled(_folders(*sides))
    if any(side.is_dir() for side in sides):
        raise LayoutError(f"{left} and {right}: one is a folder; give two files, two folders or two patterns")
    return [Pair(pair_name(sides[0]), sides[0], sides[1])]


def image_files(place: str) -> list[Path]:
    """List a file alone, the images of a folder, or the files that a pattern with one ``*`` fits, ordered by name.

    Raises:
        MissingFileError: If there is none.
    """
    path = user_path(place)
    if "*" in place and not path.exists():
        return list(_matches(place).values())
    if path.is_dir():
        return _images(path)
    if not path.exists():
        raise MissingFileError(f"{path}: no such file or folder")
    return [path]


def pair_name(left: Path) -> str:
    """Name a pair by its left file, or by its folder where the file says no more than its side."""
    return label(left.stem) or left.resolve().parent.name or "pair"


def _folders(left: Path, right: Path) -> list[Pair]:
    """Pair by equal names; where no name is in both folders, by names that differ in the side."""
    where = (str(left), str(right))
    if left.samefile(right):
        return _paired(_of_side(left, "left"), _of_side(right, "right"), where)
    lefts, rights = _images(left), _images(right)
    equal = _by_name(lefts), _by_name(rights)
    if equal[0].keys() & equal[1].keys():
        return _paired(*equal, where)
    return _paired(_sided(lefts, "left"), _sided(rights, "right"), where)


def _by_name(paths: list[Path]) -> _Keyed:
    return _keyed(paths, lambda path: composed(path.stem))


def _of_side(folder: Path, side: Side) -> _Keyed:
    """Key those files of a folder that tell this side."""
    paths = [path for path in _images(folder) if without_side(path.stem, side)]
    if not paths:
        raise LayoutError(f"{folder}: no name tells the {side} view, as {side}_1.png does; {_WAYS_OUT}")
    return _sided(paths, side)


def _sided(paths: list[Path], side: Side) -> _Keyed:
    """Key files by what they share with the other side; those that do not tell their side stand alone."""
    return _keyed(paths, lambda path: without_side(path.stem, side) or f"{side}: {composed(path.stem)}")


def _keyed(paths: Iterable[Path], key: Callable[[Path], str]) -> _Keyed:
    found: _Keyed = {}
    for path in paths:
        other = found.setdefault(key(path), path)
        if other is not path:
            raise LayoutError(f"{other} and {path}: several images of one side have the same name; keep one of them")
    return found


def _paired(lefts: _Keyed, rights: _Keyed, where: tuple[str, str]) -> list[Pair]:
    """Pair what has the same key."""
    pairs = [Pair(path.stem, path, rights[key]) for key, path in lefts.items() if key in rights]
    alone = [path for key, path in lefts.items() if key not in rights]
    others = [path for key, path in rights.items() if key not in lefts]
    _refuse_look_alikes(alone, others)
    if not pairs:
        raise LayoutError(
            f"{where[0]} and {where[1]}: no two names belong together, such as {next(iter(lefts.values())).name} and "
            f"{next(iter(rights.values())).name}; {_WAYS_OUT}"
        )
    warnings = (*_left_out(where[0], alone, where[1]), *_left_out(where[1], others, where[0]))
    return [replace(pairs[0], warnings=warnings), *pairs[1:]]


def _refuse_look_alikes(lefts: list[Path], rights: list[Path]) -> None:
    known = {look_alike(path.stem): path for path in lefts}
    for path in rights:
        if look_alike(path.stem) in known:
            raise LayoutError(
                f"{known[look_alike(path.stem)]} and {path}: it is not certain that they belong together; {_WAYS_OUT}"
            )


def _left_out(here: str, alone: list[Path], there: str) -> list[str]:
    if not alone:
        return []
    names = ", ".join(path.name for path in alone[:3]) + (", ..." if len(alone) > 3 else "")
    return [f"{here}: {len(alone)} without a counterpart in {there}, left out: {names}"]


def _labelled(pairs: list[Pair]) -> list[Pair]:
    """Name pairs by the shortest names that are all different."""
    short, stems = [label(pair.left.stem) for pair in pairs], [pair.left.stem for pair in pairs]
    different = (names for names in (short, stems) if all(names) and len(set(names)) == len(names))
    names = next(different, [pair.left.name for pair in pairs])
    return [replace(pair, name=name) for pair, name in zip(pairs, names, strict=True)]


def _matches(pattern: str) -> _Keyed:
    """Return the files that a pattern fits, by what its one ``*`` stands for."""
    if pattern.count("*") != 1:
        raise LayoutError(f"{pattern}: give exactly one * in each of the two patterns; it pairs them")
    path = user_path(pattern)
    if "*" not in path.name:
        raise LayoutError(f"{pattern}: the * must stand in the file's name")
    before, after = (composed(part) for part in path.name.split("*"))
    fits = [(composed(file.name), file) for file in _files(path.parent)]
    found = {
        name[len(before) : len(name) - len(after)]: file
        for name, file in fits
        if name.startswith(before) and name.endswith(after) and len(name) >= len(before) + len(after)
    }
    if not found:
        raise LayoutError(f"{pattern}: no image there")
    return found


def _images(folder: Path) -> list[Path]:
    found = [path for path in _files(folder) if path.suffix.lower() in _IMAGES]
    if not found:
        raise LayoutError(f"{folder}: no image there; images end in {', '.join(_IMAGES)}")
    return found


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    except OSError as error:
        raise MissingFileError(f"{folder}: cannot be listed ({error.strerror})") from error
