"""Read YAML, JSON, TOML and OpenCV's XML as names and values."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from semidense.datasets.errors import CalibrationError

_MOST_VALUES = 1 << 18
"""Values that a file can hold without aliases: it has no more bytes."""


def markup_values(path: Path, text: str) -> dict[str, Any]:
    """Read XML or JSON, told by its first sign, else YAML; raises `CalibrationError` if it is not valid."""
    readers = {"<": xml_values, "{": json_values}
    return readers.get(text.lstrip()[:1], yaml_values)(path, text)


def yaml_values(path: Path, text: str) -> dict[str, Any]:
    """Read the first document of a YAML text: ``ros2 topic echo`` ends each with ``---``; OpenCV tags its matrices.

    Raises:
        CalibrationError: If it is not valid, or holds no names.
    """
    import yaml  # Dask brings it

    try:
        documents = yaml.safe_load_all(_plain_yaml(text))
        first = next((found for found in documents if found is not None), None)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise CalibrationError(f"{path}: no valid YAML ({_line(error)})") from error
    _require_small(path, first)
    return _named(path, first)


def json_values(path: Path, text: str) -> dict[str, Any]:
    """Read a JSON text; raises `CalibrationError` if it is not valid, or holds no names."""
    try:
        found = json.loads(text)
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
    """Read an OpenCV XML text, each value as a list of words; raises `CalibrationError` if it is not valid."""
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise CalibrationError(f"{path}: damaged XML ({_line(error)})") from error
    return {element.tag: (element.findtext("data") or element.text or "").split() for element in root}


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
