"""Read YAML, JSON, TOML and OpenCV's XML as names and values."""

import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from semidense.datasets.errors import CalibrationError

_MOST_VALUES = 1 << 18
"""Values that a file can hold without aliases: it has no more bytes."""


def markup_values(path: Path, text: str) -> dict[str, Any]:
    """Read XML or JSON, told by its first sign, else YAML; raises `CalibrationError` if it is not valid.

    No name may be given twice: nothing tells which of its values is right.
    """
    readers = {"<": xml_values, "{": json_values}
    return readers.get(text.lstrip()[:1], yaml_values)(path, text)


def yaml_values(path: Path, text: str) -> dict[str, Any]:
    """Read the first document of a YAML text: ``ros2 topic echo`` ends each with ``---``; OpenCV tags its matrices.

    Raises:
        CalibrationError: If it is not valid, holds no names, or holds one twice.
    """
    import yaml  # Dask brings it

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML has no types
        """Refuse a name that a mapping has twice."""

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:  # noqa: ANN401
            _require_once(str(key.value) for key, _ in node.value if isinstance(key, yaml.ScalarNode))
            return super().construct_mapping(node, deep)

    try:
        documents = yaml.load_all(_plain_yaml(text), Loader)
        first = next((found for found in documents if found is not None), None)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise CalibrationError(f"{path}: no valid YAML ({_line(error)})") from error
    _require_small(path, first)
    return _named(path, first)


def json_values(path: Path, text: str) -> dict[str, Any]:
    """Read a JSON text; raises `CalibrationError` if it is not valid, holds no names, or holds one twice."""
    try:
        found = json.loads(text, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise CalibrationError(f"{path}: no valid JSON ({_line(error)})") from error
    return _named(path, found)


def toml_values(path: Path, text: str) -> dict[str, Any]:
    """Read a TOML text; raises `CalibrationError` if it is not valid."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # of a number with too many digits, a plain ValueError
        raise CalibrationError(f"{path}: no valid TOML ({_line(error)})") from error


def xml_values(path: Path, text: str) -> dict[str, Any]:
    """Read an OpenCV XML text, each value as a list of words.

    Raises:
        CalibrationError: If it is not valid, or holds a name twice.
    """
    try:
        root = ElementTree.fromstring(text)
        _require_once(element.tag for element in root)
    except (ElementTree.ParseError, ValueError) as error:
        raise CalibrationError(f"{path}: damaged XML ({_line(error)})") from error
    return {element.tag: (element.findtext("data") or element.text or "").split() for element in root}


def lower(where: str, *parts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all parts, names in lower case.

    Args:
        where: The file or files, for messages.
        parts: Names and values.

    Raises:
        CalibrationError: If two values of one name differ.
    """
    values: dict[str, Any] = {}
    for name, value in (item for part in parts for item in part.items()):
        key = str(name).lower()
        if key in values and values[key] != value:
            raise CalibrationError(f"{where}: {name} is given twice, with different values; keep the one that is right")
        values[key] = value
    return values


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    _require_once(name for name, _ in pairs)
    return dict(pairs)


def _require_once(names: Iterable[str]) -> None:
    """Raise a `ValueError` that tells a name which is there twice."""
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise ValueError(f"{twice[0]} is given twice; keep the one that is right")


def _require_small(path: Path, found: object) -> None:
    """Refuse values that hold each other many times over, as aliases let them: written out they fill all memory."""
    waiting, seen = [found], 0
    while waiting:
        each, seen = waiting.pop(), seen + 1
        if seen > _MOST_VALUES:
            raise CalibrationError(f"{path}: its aliases stand for more than {_MOST_VALUES:,} values; write them out")
        waiting += each.values() if isinstance(each, dict) else each if isinstance(each, list) else ()


def _plain_yaml(text: str) -> str:
    """Drop the directive that OpenCV writes and YAML does not know, and its tag."""
    return re.sub(r"^%YAML.*", "", text, flags=re.MULTILINE).replace("!!opencv-matrix", "")


def _named(path: Path, found: object) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise CalibrationError(
            f"{path}: no names and values, as YAML and JSON have them; of calibrations in two files, ROS's and "
            "OpenCV's are read"
        )
    return {str(name): value for name, value in found.items()}


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120]
