"""Find scenes below a folder that a user named."""

from collections.abc import Callable, Iterable
from pathlib import Path

from semidense.datasets.errors import DatasetError, LayoutError, MissingFileError
from semidense.datasets.formats.files import user_path

_DEEPEST = 4


def open_folder(argument: str, pattern: str) -> Path:
    """Turn what stands after a specification's colon into a folder that exists.

    Args:
        argument: The text after the colon; ``~`` is the home folder.
        pattern: The specification's pattern, for the message.

    Raises:
        DatasetError: If the text is empty.
        MissingFileError: If there is no such folder.
    """
    if not argument:
        raise DatasetError(f"no folder given; write {pattern}")
    folder = user_path(argument)
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: no such folder; {pattern} needs one")
    return folder


def find_scenes(root: Path, is_scene: Callable[[Path], bool]) -> list[tuple[str, Path]]:
    """Find the scene folders at or below a folder, down to four levels, in the order of their names.

    Returns:
        Names and folders. A scene is named by its path below ``root``, with ``/`` between folders, so that names are
        unique; ``root`` itself, if it is a scene, by its own name. Hidden folders, and folders inside a scene, are
        not looked at.
    """
    if is_scene(root):
        return [(root.resolve().name, root)]
    return [(folder.relative_to(root).as_posix(), folder) for folder in _below(root, is_scene, _DEEPEST)]


def existing(folder: Path, roles: Iterable[tuple[str, str]]) -> dict[str, Path]:
    """Keep the (role, file name) pairs whose file is in the folder, as role to path."""
    return {role: folder / name for role, name in roles if (folder / name).is_file()}


def require(folder: Path, names: Iterable[str], expected: str) -> None:
    """Refuse a scene folder that lacks some of its files.

    Raises:
        LayoutError: With the files missing, the layout expected and what is there.
    """
    missing = [name for name in names if not (folder / name).is_file()]
    if missing:
        raise LayoutError(f"{folder}: no {' and no '.join(missing)}; expected {expected}, found {contents(folder)}")


def contents(folder: Path, most: int = 8) -> str:
    """List the first few entries of a folder, for a message."""
    names = [entry.name for entry in _entries(folder)]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "nothing") + more


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise MissingFileError(f"{folder}: cannot be listed ({error.strerror})") from error


def _below(folder: Path, is_scene: Callable[[Path], bool], levels: int) -> list[Path]:
    found: list[Path] = []
    for entry in _entries(folder):
        if entry.name.startswith(".") or not entry.is_dir():
            continue
        if is_scene(entry):
            found.append(entry)
        elif levels > 1:
            found += _below(entry, is_scene, levels - 1)
    return found
