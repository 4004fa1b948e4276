import numpy as np
import pytest
from matplotlib.text import Text

from semidense.pipeline.pages.reliability import reliability, reliability_figure
from semidense.stages.metrics.tally import Block, Tally


def tally(confidence: list[float], right: list[bool]) -> Tally:
    truth = np.zeros((1, len(right)), np.float32)
    disparity = np.where(right, 0, 9).astype(np.float32)[np.newaxis]
    return Tally.of([Block(disparity, np.array([confidence], np.float32), truth, np.ones(truth.shape, bool))])


def test_shares_and_confidences_by_hand() -> None:
    found = reliability([tally([0.05, 0.95, 0.97, 1.0], [False, True, True, False])])
    assert found.pixels.tolist() == [1, 0, 0, 0, 0, 0, 0, 0, 0, 3]
    assert found.right[[0, 9]] == pytest.approx([0, 2 / 3])
    assert found.confidence[[0, 9]] == pytest.approx([0.05, 2.92 / 3])
    assert np.isnan(found.right[1:9]).all()
    assert found.error == pytest.approx((0.05 + 3 * (2.92 / 3 - 2 / 3)) / 4)


def test_scenes_are_pooled() -> None:
    found = reliability([tally([0.55], [True]), tally([0.55], [False])])
    assert found.right[5] == 0.5


def test_without_a_pixel_there_is_no_error() -> None:
    assert np.isnan(reliability([tally([], [])]).error)


def test_the_diagram_says_what_it_shows() -> None:
    drawn = reliability_figure(reliability([tally([0.8] * 60, [True] * 60)]), title="T")
    drawn.draw_without_rendering()
    written = {text.get_text() for text in drawn.findobj(Text)}
    assert {
        "confidence (0 to 1)",
        "share of pixels (mask all)\noff by at most 1 px (0 to 1)",
        "share of\npixels (0 to 1)",
    } <= written
    assert any("calibration error 0.200" in text for text in written)
