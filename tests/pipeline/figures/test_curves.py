from typing import Any

import pytest
from matplotlib.colors import to_hex

from semidense.pipeline.figures.curves import error_curve_figure
from semidense.pipeline.plan.errors import UsageError


def row(scene: str, R: float | None, invalid: float, bad: float | None, **more: object) -> dict[str, Any]:
    figures = {"R": R, "invalid": invalid, "bad": bad}
    known = {name: value for name, value in figures.items() if value is not None}
    return {"scene": scene, "mask": "nonocc", "threshold_px": 1.0, "pixels": 9} | known | more


ROWS = [
    row("a", 0.9, 40, 1),
    row("a", 0.1, 0, 8),
    row("b", 0.1, 10, 4),
    row("b", 0.9, 60, 3),
    row("a", 0.1, 99, 99, mask="all"),
    row("a", 0.1, 99, 99, threshold_px=2.0),
    row("b", None, 0, 50),
]


def curves(rows: list[dict[str, Any]]) -> dict[str, list[tuple[float, float]]]:
    lines = error_curve_figure(rows).axes[0].lines
    return {str(line.get_label()): [tuple(point) for point in line.get_xydata().tolist()] for line in lines}


def test_a_line_a_scene_in_order_and_their_mean() -> None:
    assert curves(ROWS) == {
        "a": [(0, 8), (40, 1)],
        "b": [(10, 4), (60, 3)],
        "mean of 2 scenes": [(5, 6), (50, 2)],
    }


def test_the_mean_stops_where_a_scene_reports_nothing() -> None:
    rows = [*ROWS, row("a", 0.95, 70, 0.5), row("b", 0.95, 100, None)]
    assert curves(rows)["mean of 2 scenes"] == [(5, 6), (50, 2)]


def test_a_curve_ends_where_a_handful_of_pixels_is_left() -> None:
    assert curves([*ROWS, row("a", 0.99, 99.5, 50), row("b", 0.99, 80, 1)]) == {
        "a": [(0, 8), (40, 1)],
        "b": [(10, 4), (60, 3), (80, 1)],
        "mean of 2 scenes": [(5, 6), (50, 2)],
    }
    assert curves([row("a", 0.9, 99.5, 50)]) == {"a": [(99.5, 50)]}, "a point that is alone is shown"


def test_there_is_no_mean_where_a_scene_never_reports_anything() -> None:
    assert list(curves([*ROWS, row("c", 0.1, 100, None), row("c", 0.9, 100, None)])) == ["a", "b"]


def test_variants_are_told_apart() -> None:
    rows = [
        row("a", 0.1, 0, value, variant=f"semidense.R=0.1, channels.rank_window={window}")
        for window, value in ((15, 8), (31, 7))
    ]
    assert curves(rows) == {"a, channels.rank_window=15": [(0, 8)], "a, channels.rank_window=31": [(0, 7)]}


def test_axes_say_quantity_mask_threshold_and_and_unit() -> None:
    axes = error_curve_figure(ROWS).axes[0]
    assert axes.get_xlabel() == "invalid: nonocc pixels that are not kept (%)"
    assert axes.get_ylabel() == "bad: kept nonocc pixels off by more than 1 px (%)"
    assert [text.get_text() for text in axes.texts] == ["R = 0.1", "R = 0.9"]
    assert axes.get_ylim()[0] == 0


def test_another_mask_and_threshold_can_be_drawn() -> None:
    lines = error_curve_figure(ROWS, mask="all").axes[0].lines
    assert lines[0].get_xydata().tolist() == [[99, 99]]


def test_a_scene_is_taken_literally() -> None:
    figure = error_curve_figure([row("$x_", 0.1, 0, 8)], title="$y_")
    figure.draw_without_rendering()
    assert figure.legends[0].get_texts()[0].get_text() == "$x_"


def test_chosen_thresholds_are_written_and_another_matcher_is_named_as_one() -> None:
    other = {"method": "SGM", "invalid": 20.0, "bad": 5.0}
    figure = error_curve_figure(ROWS, marked=(0.5, 0.9), others=[other])
    assert [text.get_text() for text in figure.axes[0].texts] == ["R = 0.9"]
    assert figure.legends[0].get_texts()[-1].get_text() == "SGM (other matcher)"


def of_windows(scenes: str, thresholds: tuple[float, ...]) -> list[dict[str, Any]]:
    return [
        row(scene, R, 40 * R + place, window / 10 - R, variant=f"semidense.R={R}, channels.rank_window={window}")
        for place, scene in enumerate(scenes)
        for window in (15, 31)
        for R in thresholds
    ]


@pytest.mark.parametrize("scenes", ["a", "ab"])
def test_of_one_threshold_the_title_tells_it_and_variants_differ_in_shape(scenes: str) -> None:
    figure = error_curve_figure(of_windows(scenes, (0.9,)))
    axes = figure.axes[0]
    assert figure.get_suptitle() == "Error versus invalid pixels, R = 0.9"
    assert [*axes.texts, *axes.collections] == []
    looks = {(line.get_marker(), line.get_color()) for line in axes.lines}
    assert len(looks) == len(axes.lines) == (2 if scenes == "a" else 6)
    assert len({marker for marker, _ in looks}) == 2


@pytest.mark.parametrize("scenes", ["a", "ab"])
def test_of_several_variants_one_has_its_thresholds_written(scenes: str) -> None:
    axes = error_curve_figure(of_windows(scenes, (0.1, 0.9))).axes[0]
    assert [text.get_text() for text in axes.texts] == ["R = 0.1", "R = 0.9"]
    assert len(axes.collections) == 4
    lines = axes.lines[-2:]
    for dots, line in zip(axes.collections, [lines[0]] * 2 + [lines[1]] * 2, strict=True):
        assert to_hex(dots.get_facecolor()[0]) == to_hex(line.get_color())
        assert dots.get_offsets()[0].tolist() in line.get_xydata().tolist()
        assert dots.zorder > max(text.zorder for text in axes.texts)


@pytest.mark.parametrize("rows", [pytest.param([], id="none"), pytest.param(ROWS[-1:], id="no-R")])
def test_nothing_to_draw_is_refused(rows: list[dict[str, Any]]) -> None:
    with pytest.raises(UsageError, match="mask nonocc and the threshold 1 px"):
        error_curve_figure(rows)


@pytest.mark.parametrize("matchers", [0, 5, 20])
def test_the_label_of_the_error_is_no_longer_than_its_axis(matchers: int) -> None:
    others = [row("a", None, 20, 5, method=f"matcher {number}, mean of 8") for number in range(matchers)]
    figure = error_curve_figure(ROWS, others=others)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    assert axes.yaxis.label.get_window_extent().height <= axes.get_window_extent().height
