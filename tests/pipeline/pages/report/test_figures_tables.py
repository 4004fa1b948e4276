"""The tables of a report, from rows that can be checked by hand."""

import re
from typing import Any

from semidense.pipeline.pages.report.figures_tables import auc_table, matcher_points, matchers_table, measure_points

Row = dict[str, Any]


def row(experiment: str, scene: str, method: str, **figures: float) -> Row:
    named = {"experiment": experiment, "scene": scene, "method": method, "mask": "nonocc", "threshold_px": 1.0}
    return named | {"pixels": 100} | figures


MATCHERS = [
    row("density", "A", "SGM", invalid=20.0, bad=10.0, bad_dual_cnn=8.0),
    row("density", "B", "SGM", invalid=10.0, bad=6.0, bad_dual_cnn=4.0),
    row("density", "A", "census", invalid=50.0, bad=3.0, bad_dual_cnn=1.0),
]
MEASURES = [
    row("auc", "A", "evaluation-Net", auc=0.02, auc_optimal=0.01),
    row("auc", "A", "APKR", auc=0.04, auc_optimal=0.01),
    row("auc", "A", "O1", auc=0.03, auc_optimal=0.01),
    row("auc", "B", "evaluation-Net", auc=0.06, auc_optimal=0.02),
    row("auc", "B", "APKR", auc=0.08, auc_optimal=0.02),
]


def cells(page: str) -> list[list[str]]:
    """Return the text of each row of the first table of a page."""
    rows = re.findall(r"<tr>(.*?)</tr>", page.partition("</table>")[0])
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", each) for each in rows]


def test_a_matcher_is_a_point_where_every_scene_has_it() -> None:
    (point,) = matcher_points(MATCHERS, 2)
    assert (point["method"], point["invalid"], point["bad"]) == ("SGM, mean of 2", 15, 8)
    assert [each["method"] for each in matcher_points(MATCHERS[::2], 1)] == ["SGM", "census"]


def test_the_table_says_over_how_many_scenes_a_mean_is() -> None:
    assert cells(matchers_table(MATCHERS))[1:] == [
        ["SGM", "mean of 2", "15.00", "8.00", "6.00"],
        ["census", "mean of 1", "50.00", "3.00", "1.00"],
    ]


def test_one_scene_needs_no_mean() -> None:
    page = matchers_table(MATCHERS[:1])
    assert cells(page)[1:] == [["SGM", "A", "20.00", "10.00", "8.00"]]
    assert "<details" not in page


def test_without_matchers_the_page_says_what_makes_them() -> None:
    assert "<code>pipeline compare</code>" in matchers_table(MEASURES)


def test_a_measure_that_a_scene_lacks_has_no_mean() -> None:
    assert cells(auc_table(MEASURES)) == [
        ["scene", "optimal", "evaluation-Net", "times the optimal", "APKR", "O1"],
        ["A", "0.0100", "0.0200", "2.0", "0.0400", "0.0300"],
        ["B", "0.0200", "0.0600", "3.0", "0.0800", "-"],
        ["mean of 2", "0.0150", "0.0400", "2.7", "0.0600", "-"],
    ]


def test_measures_are_drawn_side_by_side_over_the_same_scenes() -> None:
    assert {each["method"] for each in measure_points(MEASURES)} == {"evaluation-Net", "APKR"}
    assert measure_points(MEASURES[:1]) == [], "one alone has nothing to stand beside"
    assert auc_table([]) == ""
