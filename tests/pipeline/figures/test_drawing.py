import warnings

import numpy as np
import pytest

from semidense.pipeline.figures.cost_volume import draw_costs
from semidense.pipeline.figures.drawing import disparity_scale, draw_map, image_panels, new_figure, share_patch
from semidense.pipeline.figures.maps import draw_channels, draw_confidence, draw_images
from semidense.pipeline.figures.training import (
    draw_evaluation_samples,
    draw_matching_samples,
    draw_network,
    trailing_mean,
)
from tests.pipeline import products


@pytest.mark.parametrize(
    ("wild", "extend"),
    [
        pytest.param([], "neither", id="all-inside"),
        pytest.param([900.0], "max", id="above"),
        pytest.param([-900.0], "min", id="below"),
        pytest.param([-900.0, 900.0], "both", id="both"),
    ],
)
def test_arrows_on_the_bar_say_that_values_lie_beyond(wild: list[float], extend: str) -> None:
    values = np.tile(np.arange(10.0, dtype=np.float32), 100).reshape(10, 100)
    values[0, : len(wild)] = wild
    figure = new_figure("any")
    axes = image_panels(figure, values.shape)[0, 0]
    draw_map(axes, values, disparity_scale(values))
    assert axes.images[0].colorbar.extend == extend


@pytest.mark.parametrize("size", [(4, 400), (400, 4), (375, 1242)], ids=str)
def test_extreme_images_give_figures_of_a_sane_size(size: tuple[int, int]) -> None:
    figure = new_figure("any")
    image_panels(figure, size, columns=2)
    width, height = figure.get_size_inches()
    assert 1 < width < 20
    assert 1 < height < 20


def test_share_of_nothing_is_0() -> None:
    assert share_patch(np.zeros(0, bool), "none", "black").get_label() == "none: 0.0 %"


@pytest.mark.parametrize("bands", [1, 3])
def test_images_of_16_bits_look_like_those_of_8(bands: int) -> None:
    dataset = products.images().isel(band=slice(0, bands))
    deep = dataset.assign({name: dataset[name].astype(np.uint16) * 257 for name in ("left", "right")})
    figure = new_figure("any")
    draw_images(figure, deep)
    np.testing.assert_array_equal(figure.axes[0].images[0].get_array(), np.broadcast_to(dataset["left"], (4, 6, 3)))


def test_channels_in_use_give_their_names() -> None:
    dataset = products.channels().isel(channel=[1]).assign_attrs(params='{"use": ["rank"]}')
    figure = new_figure("any")
    draw_channels(figure, dataset)
    assert [axes.get_title() for axes in figure.axes] == ["rank, left view (reference)", "rank, right view"]


def test_views_of_a_channel_share_one_scale() -> None:
    figure = new_figure("any")
    draw_channels(figure, products.channels())
    left, right = (axes.images[0].get_clim() for axes in figure.axes[:2])
    assert left == right


def test_samples_of_single_pixels_have_no_crops() -> None:
    figure = new_figure("any")
    draw_matching_samples(figure, products.matching_samples().isel(row=[0], column=[0]))
    assert len(figure.axes) == 2


def test_fewer_samples_than_panels_leave_panels_empty() -> None:
    for draw, dataset in (
        (draw_evaluation_samples, products.evaluation_samples()),
        (draw_matching_samples, products.matching_samples()),
    ):
        figure = new_figure("any")
        draw(figure, dataset.isel(sample=[0, 1]))
        assert [axes.axison for axes in figure.axes[2:]] == [True, True, False, False, False, False]


def test_the_loss_is_drawn_on_a_log_scale_with_its_trailing_mean() -> None:
    figure = new_figure("any")
    draw_network(figure, products.network())
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert axes.lines[1].get_xdata()[0] == 4  # 80 steps: a mean of 4
    np.testing.assert_allclose(axes.lines[1].get_ydata()[0], products.network()["loss"][:4].mean(), rtol=1e-6)


def test_a_short_curve_has_no_mean() -> None:
    figure = new_figure("any")
    draw_network(figure, products.network().isel(step=slice(0, 10)))
    assert [line.get_label() for line in figure.axes[0].lines] == ["each step", "ln 2: a coin's guess"]


def test_a_ranking_loss_is_told_and_has_no_coin_s_guess() -> None:
    figure = new_figure("any")
    draw_network(figure, products.network().assign_attrs(params='{"ranking": 4.0}'))
    assert "+ 4 x ranking loss" in figure.axes[0].get_ylabel()
    assert not any("coin" in str(line.get_label()) for line in figure.axes[0].lines)


def test_trailing_mean() -> None:
    assert trailing_mean(np.array([1, 3, 5, 7], np.float32), 2).tolist() == [2, 4, 6]


@pytest.mark.parametrize("product", ["costvolume", "confidence", "channels"])
def test_the_labels_of_a_very_wide_image_find_room(product: str) -> None:
    figure = new_figure("any")
    dataset = products.PRODUCTS[product]()
    wide = dataset.isel(x=np.arange(60) % 6)
    {"costvolume": draw_costs, "confidence": draw_confidence, "channels": draw_channels}[product](figure, wide)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # Matplotlib warns when a layout has no room
        figure.draw_without_rendering()
    assert all(axes.get_position().width > 0.2 for axes in figure.axes[:2])
