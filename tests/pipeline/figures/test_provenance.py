"""The picture of a product's provenance."""

import numpy as np
from matplotlib.patches import FancyArrowPatch

from semidense.pipeline.figures.provenance import PIXELS, draw_graph
from semidense.pipeline.results.provenance import ancestry
from semidense.pipeline.results.result import Result


def test_no_arrow_passes_behind_a_box(trained: Result) -> None:
    figure = draw_graph(ancestry(trained.store, trained.find("metrics").key), PIXELS)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    boxes = [text.get_bbox_patch().get_window_extent().padded(-2) for text in axes.texts]
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    assert len(boxes) > 15 and len(arrows) > len(boxes)
    for arrow in arrows:
        line = arrow.get_transform().transform_path(arrow._path_original).to_polygons(closed_only=False)
        points = np.concatenate([np.linspace(a, b, 50) for a, b in zip(line[0], line[0][1:], strict=False)])
        assert not any(box.count_contains(points) for box in boxes)


def test_boxes_do_not_overlap(trained: Result) -> None:
    figure = draw_graph(ancestry(trained.store, trained.find("metrics").key), PIXELS)
    figure.draw_without_rendering()
    boxes = [text.get_bbox_patch().get_window_extent() for text in figure.axes[0].texts]
    assert not any(one.overlaps(other) for n, one in enumerate(boxes) for other in boxes[:n])
    assert all(figure.bbox.fully_containsx(x) for box in boxes for x in (box.x0, box.x1))
    assert all(figure.bbox.fully_containsy(y) for box in boxes for y in (box.y0, box.y1))


def test_a_setting_that_is_not_given_is_left_out(trained: Result) -> None:
    figure = draw_graph(ancestry(trained.store, trained.find("metrics").key), PIXELS)
    told = [text.get_text() for text in figure.axes[0].texts]
    assert any("R 0." in each and "calibrated false" in each for each in told)
    assert not any("null" in each for each in told)
