import matplotlib
import numpy as np
import pytest
from matplotlib.colors import Colormap
from skimage.color import rgb2lab

from semidense.pipeline.figures.colours import (
    confidence_at,
    confidence_colours,
    confidence_rgb,
    confidence_share,
    cost_colours,
    disparity_colours,
    disparity_rgb,
    disparity_span,
    view_rgb,
)
from semidense.pipeline.plan.errors import UsageError

SEEN_BY = {
    "everyone": np.eye(3),
    "protanopes": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopes": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopes": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""How linear RGB is seen: Machado, Oliveira & Fernandes (2009), severity 1."""


def lab(colours: np.ndarray, seen: np.ndarray) -> np.ndarray:
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ seen.T, 0, 1)
    return rgb2lab(np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)[np.newaxis])[0]


@pytest.mark.parametrize("colours", [disparity_colours(), confidence_colours(), cost_colours()], ids=lambda c: c.name)
@pytest.mark.parametrize("who", SEEN_BY)
def test_none_is_told_from_every_value(colours: Colormap, who: str) -> None:
    values = lab(colours(np.linspace(0, 1, 256))[:, :3], SEEN_BY[who])
    none = lab(np.array([colours.get_bad()[:3]]), SEEN_BY[who])
    assert np.linalg.norm(values - none, axis=1).min() > 20  # a difference of 2.3 is just noticeable


def test_lightness_alone_orders_disparities() -> None:
    lightness = lab(disparity_colours()(np.linspace(0, 1, 256))[:, :3], np.eye(3))[:, 0]
    assert (np.diff(lightness) >= 0).all()
    assert lightness[-1] - lightness[0] > 50


def test_disparities_get_the_colours_of_the_span_and_none_gets_black() -> None:
    first, last = (np.round(np.array(disparity_colours()(end)[:3]) * 255).tolist() for end in (0.0, 1.0))
    rgb = disparity_rgb(np.array([[np.nan, np.inf, -5, 10], [20, 30, 10, 99]], np.float32), 10, 30)
    assert rgb.dtype == np.uint8
    assert rgb.shape == (2, 4, 3)
    assert rgb[0, :2].tolist() == [[0, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(rgb[0, 2:], [first, first], atol=1)
    np.testing.assert_allclose(rgb[1, [1, 3]], [last, last], atol=1)


def test_the_middle_of_a_confidence_has_half_of_the_colours() -> None:
    """By hand: ln 9 / ln 99 = 0.478, so 0.1 and 0.9 lie 0.239 beside the middle."""
    places = confidence_share(np.array([0, 0.01, 0.1, 0.5, 0.9, 0.99, 1, np.nan]))
    np.testing.assert_allclose(places, [0, 0, 0.261, 0.5, 0.739, 1, 1, np.nan], atol=5e-4)
    np.testing.assert_allclose(confidence_at(places[1:6]), [0.01, 0.1, 0.5, 0.9, 0.99])


def test_a_confidence_is_coloured_on_the_scale_from_0_to_1() -> None:
    rgb = confidence_rgb(np.array([[0.0, 1.0, np.nan]], np.float32))
    assert rgb[0, 1].tolist() == (np.array(matplotlib.colormaps["cividis"](1.0, bytes=True))[:3]).tolist()
    assert rgb[0, 2].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        pytest.param(np.zeros((2, 2)), 3, 3, id="empty-span"),
        pytest.param(np.zeros((2, 2)), 0, np.nan, id="span-of-nan"),
        pytest.param(np.zeros(4), 0, 1, id="no-map"),
    ],
)
def test_what_has_no_colours_is_refused(values: np.ndarray, low: float, high: float) -> None:
    with pytest.raises(UsageError, match="give"):
        disparity_rgb(values, low, high)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        pytest.param(np.full((2, 2), np.nan), (0, 1), id="nothing"),
        pytest.param(np.full((2, 2), 7.0), (7, 8), id="constant"),
        pytest.param(np.array([[-3.5, 2.5]]), (-4, 3), id="negative"),
        pytest.param(np.r_[np.arange(1000.0) % 10, 900.0], (0, 9), id="one-wild-value-does-not-count"),
    ],
)
def test_the_span_holds_nearly_all(values: np.ndarray, expected: tuple[float, float]) -> None:
    assert disparity_span(values) == expected


@pytest.mark.parametrize("bands", [1, 3])
def test_a_view_of_16_bits_looks_like_the_same_view_of_8(bands: int) -> None:
    eight = np.random.default_rng(0).integers(0, 256, (4, 5, bands), np.uint8)
    shown = view_rgb(eight)
    assert (shown.shape, shown.dtype) == ((4, 5, 3), np.uint8)
    np.testing.assert_array_equal(shown, np.broadcast_to(eight, (4, 5, 3)))
    np.testing.assert_array_equal(view_rgb(eight.astype(np.uint16) * 257), shown)
