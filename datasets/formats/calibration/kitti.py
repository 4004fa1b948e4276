"""Read the calibration files of KITTI and of the Karlsruhe sequences: lines ``name: numbers``, in metres.

| lines | file | cameras |
|---|---|---|
| ``P1_roi`` and ``P2_roi``, ``roi`` | Karlsruhe's ``calib.txt`` | left, right, of the cropped images |
| ``P_rect_00`` to ``P_rect_03``, ``S_rect_00`` ... | the raw data's ``calib_cam_to_cam.txt`` | gray 0, 1; colour 2, 3 |
| ``P0`` to ``P3`` | the stereo, object and odometry benchmarks | gray 0, 1; colour 2, 3 |
| ``P1`` and ``P2`` | Karlsruhe's without ``roi`` | left, right |

Every ``P`` is a 3 x 4 projection matrix, row by row; comments follow a ``#``. The left camera's last column counts:
that of KITTI's colour camera is not 0. Source: https://www.cvlibs.net/datasets/kitti/setup.php
"""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import Cameras
from semidense.datasets.formats.calibration.text import Matrix, matrix, sides, without_comments

_LINE = re.compile(r"^[ \t]*(\w+)[ \t]*:(.*)$", re.MULTILINE)
_SYSTEMS = (("P1_roi", "P2_roi"), ("P_rect_02", "P_rect_03"), ("P_rect_00", "P_rect_01"), ("P2", "P3"), ("P0", "P1"))
_FOLDERS = {"image_0": "0", "image_00": "0", "image_2": "2", "image_02": "2", "colored_0": "2"}
"""Number of the camera that a left view's folder tells."""
_NUMBERED = {"P0": "0", "P2": "2", "P_rect_00": "0", "P_rect_02": "2"}
"""Number of the left camera of each pair that has one; Karlsruhe's have none."""
_WANTED = "expected P2 and P3, P0 and P1, P_rect_02 and P_rect_03, or P1_roi and P2_roi"


def is_kitti(text: str) -> bool:
    """Tell whether a text has a projection matrix as KITTI writes it."""
    return re.search(r"^[ \t]*P(_rect_0)?\d(_roi)?[ \t]*:[ \t]+[-+.\d]", text, re.MULTILINE) is not None


def kitti_cameras(path: Path, text: str, folder: str | None = None) -> Cameras:
    """Return what a file says of a pair.

    Args:
        path: The file, for messages.
        text: Its content.
        folder: Path of the left view's folder: ``image_0`` and ``image_00`` mean the gray cameras, ``image_2``,
            ``image_02`` and ``colored_0`` the colour ones, as do folders in them (``image_00/data``). Elsewhere the
            colour cameras are taken, and a warning gives both baselines.

    Raises:
        CalibrationError: If there are no two cameras that belong together, or none of the images' folder; if a line
            that is needed does not hold its numbers, or a name is given twice.
    """
    lines = _lines(path, text)
    pairs = [pair for pair in (*_SYSTEMS, ("P1", "P2")) if set(pair) <= lines.keys()]
    if not pairs:
        raise CalibrationError(f"{path}: no two cameras; {_WANTED}")
    camera = _number(folder)
    chosen = _chosen(path, pairs, camera)
    left, right = (matrix(path, name, lines[name], (3, 4)) for name in chosen)
    warnings = () if camera else _unsure(path, lines, pairs)
    return Cameras(path, left, right, "m", _size(path, lines, chosen[0]), warnings=warnings)


def _lines(path: Path, text: str) -> dict[str, list[str]]:
    """Return the words of each line under its name, also where they are no numbers: `matrix` judges what is needed."""
    lines: dict[str, list[str]] = {}
    for name, words in _LINE.findall(without_comments(text)):
        if name in lines:
            raise CalibrationError(f"{path}: {name} is given twice; keep the line that is right")
        lines[name] = words.replace(",", " ").split()
    return lines


def _number(folder: str | None) -> str | None:
    """Return the number of the left camera that the innermost telling name of a folder's path means."""
    names = reversed(Path(folder or "").parts)
    return next((_FOLDERS[name] for name in names if name in _FOLDERS), None)


def _chosen(path: Path, pairs: list[tuple[str, str]], number: str | None) -> tuple[str, str]:
    """Return the pair whose left camera has the number; the first one without a number, or if no pair has any."""
    numbers = {pair: _NUMBERED[pair[0]] for pair in pairs if pair[0] in _NUMBERED}
    if number is None or not numbers:
        return pairs[0]
    same = next((pair for pair, each in numbers.items() if each == number), None)
    if same is None:
        there = next(iter(numbers))
        raise CalibrationError(
            f"{path}: it has {there[0]} and {there[1]}, but the images' folder is that of camera {number}; give the "
            f"file with P{number} and P{int(number) + 1}, or P_rect_0{number} and P_rect_0{int(number) + 1}"
        )
    return same


def _unsure(path: Path, lines: Mapping[str, list[str]], pairs: list[tuple[str, str]]) -> tuple[str, ...]:
    rivals = [pair for pair in pairs if pair[0][-1] in "02"]
    if len(rivals) < 2 or "P1_roi" in lines:
        return ()
    one, other = (_baseline(path, lines, pair) for pair in rivals[:2])
    return (
        f"{path}: the file has gray and colour cameras; the colour ones are taken, with a baseline of {one:.5g} m "
        f"(gray: {other:.5g} m); images in a folder image_0 are of the gray ones",
    )


def _baseline(path: Path, lines: Mapping[str, list[str]], pair: tuple[str, str]) -> float:
    left, right = (matrix(path, name, lines[name], (3, 4)) for name in pair)
    return float((left[0, 3] - right[0, 3]) / left[0, 0])


def _size(path: Path, lines: Mapping[str, list[str]], left: str) -> tuple[int, int] | None:
    """Return rows and columns: ``S_rect`` holds columns and rows, ``roi`` the first and last column and row."""
    if left == "P1_roi" and "roi" in lines:
        first_x, last_x, first_y, last_y = _whole(matrix(path, "roi", lines["roi"], (1, 4)))
        return sides(path, "roi", np.array([last_y - first_y + 1, last_x - first_x + 1], np.float64))
    name = left.replace("P_rect", "S_rect")
    if name == left or name not in lines:
        return None
    columns, rows = sides(path, name, matrix(path, name, lines[name], (1, 2)))
    return rows, columns


def _whole(values: Matrix) -> list[int]:
    return [int(value) for value in np.rint(values.ravel())]
