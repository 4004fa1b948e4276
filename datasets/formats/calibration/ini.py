"""Read the ``.ini`` files of ROS's camera calibration, and the ``ost.txt`` with both cameras that it writes.

::

    # oST version 5.0 parameters
    [image]
    width
    640
    height
    480
    [narrow_stereo/left]
    camera matrix
    ...
    projection
    500.0 0.0 311.0 0.0
    0.0 500.0 250.0 0.0
    0.0 0.0 1.0 0.0

A name stands in a line of its own, its numbers in the lines below. Each ``[image]`` begins another camera.
Source: ROS package ``camera_calibration_parsers``.
"""

import re
from typing import Any

from semidense.datasets.formats.calibration.text import without_comments

_NUMBERS = re.compile(r"[-+.\deE \t]+")

_DIGITS = 9
"""Of a size in pixels; a longer word is no size."""


def is_ini(text: str) -> bool:
    """Tell whether a text has a camera as ROS writes it into an ``.ini`` file."""
    return re.search(r"^\s*\[image\]\s*$", text, re.MULTILINE) is not None


def ini_values(text: str) -> list[dict[str, Any]]:
    """Return the values of each camera of a text under the names of a ``CameraInfo``: the size and ``P``, as words."""
    return [_camera(part) for part in without_comments(text).split("[image]")[1:]]


def _camera(text: str) -> dict[str, Any]:
    found: dict[str, list[str]] = {}
    name = ""
    for line in filter(None, map(str.strip, text.splitlines())):
        if _NUMBERS.fullmatch(line):
            found.setdefault(name, []).extend(line.split())
        else:
            name = line
    sizes = {f"image_{side}": _whole(words[0]) for side in ("width", "height") if (words := found.get(side))}
    return {**sizes, "P": found.get("projection")}


def _whole(word: str) -> int | str:
    return int(word) if word.isdecimal() and len(word) <= _DIGITS else word
