import pytest

pytest.importorskip("bokeh", reason="Bokeh is not installed: pip install -e .[dev]")

LETTER = 12
"""Height of the headings, px of the screen; a letter is at most two thirds as wide."""


def test_headings_of_patches_are_neither_cut_nor_drawn_over() -> None:
    from semidense.pipeline.pages.viewer.models import Panels, Sources
    from semidense.pipeline.pages.viewer.pixel_panel import _places

    sources = Sources()
    plot = Panels(sources).patches
    places = _places([(row, column) for row in range(3) for column in range(3)], 11)
    screen = plot.max_width / plot.x_range.end  # px of the screen to one of a patch, at the largest
    assert (plot.x_range.end - max(places["x"])) * screen >= 2 / 3 * LETTER * len("companion")
    assert min(places["y"]) * screen >= 2 * 1.3 * LETTER + 4, "two lines and the gap below them"
    assert max(places["y"]) + 11 <= plot.y_range.start, "the last row of patches is whole"
