import io
import re

import numpy as np
import pytest
from rich.console import Console

from semidense.pipeline.cli.terminal import COLUMNS, ROWS, can_draw, draw_picture


def console(**how: object) -> Console:
    settings: dict[str, object] = {"force_terminal": True, "color_system": "truecolor", "width": 100, "no_color": False}
    file = io.TextIOWrapper(io.BytesIO(), encoding=str(how.pop("encoding", "utf-8")), write_through=True)
    return Console(file=file, **{**settings, **how})  # type: ignore[arg-type]


def written(on: Console) -> str:
    file = on.file
    file.seek(0)
    return file.read()


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        pytest.param({}, True, id="a terminal in colour"),
        pytest.param({"force_terminal": False}, False, id="a pipe"),
        pytest.param({"no_color": True}, False, id="NO_COLOR"),
        pytest.param({"color_system": None}, False, id="no colours"),
        pytest.param({"color_system": "standard"}, False, id="16 colours: none would be the map's"),
        pytest.param({"encoding": "ascii"}, False, id="no half blocks"),
    ],
)
def test_a_picture_is_drawn_where_it_can_be_seen(how: dict[str, object], expected: bool) -> None:
    on = console(**how)
    assert can_draw(on) is expected
    assert draw_picture(np.full((4, 4, 3), 9, np.uint8), "legend", on) is expected
    assert bool(written(on)) is expected


def test_no_color_of_the_environment_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert not can_draw(console(no_color=None))


def test_two_pixels_a_character() -> None:
    on = console()
    rgb = np.array([[[255, 0, 0], [0, 0, 0]], [[0, 255, 0], [0, 0, 255]]], np.uint8)
    draw_picture(rgb, "", on)
    assert written(on).count("▀") == 2
    assert "38;2;255;0;0;48;2;0;255;0m▀" in written(on)


@pytest.mark.parametrize(
    ("height", "width"),
    [(500, 741), (10, 5000), (5000, 10), (1, 1), (3, 200)],
    ids=["usual", "wide", "high", "one pixel", "flat"],
)
def test_it_is_never_larger_than_its_place(height: int, width: int) -> None:
    on = console()
    draw_picture(np.zeros((height, width, 3), np.uint8), "", on)
    lines = written(on).splitlines()
    assert 1 <= len(lines) <= ROWS
    assert max(line.count("▀") for line in lines) <= COLUMNS


def test_pixels_are_picked_not_mixed() -> None:
    on = console()
    stripes = np.where(np.arange(400)[:, None, None] % 2 == 0, 255, 0) * np.ones((400, 400, 3))
    draw_picture(stripes.astype(np.uint8), "", on)
    levels = set(re.findall(r"[34]8;2;(\d+);", written(on)))
    assert levels <= {"0", "255"}
