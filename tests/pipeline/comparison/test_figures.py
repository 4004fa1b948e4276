from pathlib import Path

import numpy as np
import pytest

from semidense.pipeline.comparison.figures import (
    density_figure,
    dots_figure,
    lighting_difference,
    untextured_share,
)
from semidense.pipeline.results.metric_rows import mean_rows


@pytest.mark.parametrize(
    ("gray", "share"),
    [
        pytest.param(np.full((4, 5), 9), 1, id="flat"),
        pytest.param(np.arange(20).reshape(4, 5) * 9, 0, id="steep"),
        pytest.param(np.tile([0, 2, 4, 90, 92], (4, 1)), 0.75, id="one edge of four steps"),
    ],
)
def test_texture_is_a_step_between_neighbours(gray: np.ndarray, share: float) -> None:
    assert untextured_share({"left": gray.astype(np.uint8)}) == share


def test_lighting_is_the_difference_of_the_mean_grays() -> None:
    assert lighting_difference({"moments": np.array([[100.0, 9], [130, 4]])}) == 30


def row(experiment: str, scene: str, method: str, **figures: float) -> dict[str, object]:
    place = {"experiment": experiment, "scene": scene, "method": method, "mask": "nonocc", "threshold_px": 1.0}
    return place | {"pixels": 9} | figures


def test_a_method_that_lacks_a_scene_has_dots_and_no_bar() -> None:
    rows = [
        row("auc", "a", "ours", auc=0.2, auc_optimal=0.1),
        row("auc", "b", "ours", auc=0.4, auc_optimal=0.2),
        row("auc", "a", "other", auc=0.3, auc_optimal=0.1),
    ]
    axes = dots_figure(rows, "auc", title="Areas").axes[0]
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([0.3, 0])
    assert [list(line.get_xdata()) for line in axes.lines[:2]] == [[0.2, 0.4], [0.3]]
    assert list(axes.lines[2].get_xdata()) == pytest.approx([0.15, 0.15])
    assert axes.lines[2].get_label() == "mean area of a perfect order"
    lone = dots_figure(rows[:1], "auc", title="Areas").axes[0]
    assert lone.lines[0].get_label() == "area of a perfect order"


def test_the_perfect_order_is_drawn_though_the_first_method_lacks_a_scene() -> None:
    rows = [row("auc", scene, "ours", auc=0.2, auc_optimal=0.1) for scene in "ab"]
    axes = dots_figure([row("auc", "a", "other", auc=0.3, auc_optimal=0.1), *rows], "auc", title="Areas").axes[0]
    assert [list(line.get_xdata()) for line in axes.lines][-1] == pytest.approx([0.1, 0.1])


def test_no_curve_is_drawn_where_no_pixel_counts() -> None:
    axes = density_figure(mean_rows([row("density", "a", "other", pixels=0)])).axes[0]
    assert axes.get_xlabel() == "invalid: nonocc pixels without a disparity (%), mean of 1 scene"


def test_the_bars_name_their_mask_and_threshold() -> None:
    rows = [row("auc", scene, "ours", auc=0.2) for scene in "ab"]
    label = dots_figure(rows, "auc", title="Areas").axes[0].get_xlabel()
    assert " ".join(label.split()).endswith("; mask nonocc, wrong above 1 px")


def test_a_matcher_that_lacks_a_scene_is_no_point_beside_our_curve() -> None:
    ours = [row("curve", scene, "ours", R=R, invalid=10 * R, bad=1 - R) for scene in "ab" for R in (0.0, 0.5)]
    others = [row("density", scene, "all", invalid=5.0, bad=2.0) for scene in "ab"]
    axes = density_figure(mean_rows([*ours, *others, row("density", "a", "few", invalid=5.0, bad=2.0)])).axes[0]
    labels = [line.get_label() for line in axes.lines]
    assert "all" in labels and "few" not in labels


def test_a_name_with_dollars_is_no_mathematics(tmp_path: Path) -> None:
    rows = [row("auc", scene, "y$^{$", auc=0.2, auc_optimal=0.1) for scene in ("cost_$5_to_$^{9", "b")]
    dots_figure(rows[:1], "auc", title="Areas").savefig(tmp_path / "dots.png")
    ours = [row("curve", "a", "ours", R=R, invalid=10 * R, bad=1 - R) for R in (0.0, 0.5)]
    density_figure(mean_rows([*ours, row("density", "a", "m$^{$", invalid=5.0, bad=2.0)])).savefig(tmp_path / "d.png")
    assert (tmp_path / "dots.png").stat().st_size > 1000 and (tmp_path / "d.png").stat().st_size > 1000
