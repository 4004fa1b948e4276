import json
from pathlib import Path

import matplotlib
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.text import Text

from semidense.pipeline.figures.figure import figure, product_title
from semidense.pipeline.files.writing import save_png
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.catalog import CATALOG, READ
from tests.pipeline.products import PRODUCTS

DATAFLOW = (*READ, *(stage.product for stage in CATALOG))


def texts(drawn: Figure) -> str:
    cells = [cell.get_text() for axes in drawn.axes for table in axes.tables for cell in table.get_celld().values()]
    return "\n".join(text.get_text() for text in [*drawn.findobj(Text), *cells])


def test_every_product_of_the_pipeline_has_a_figure() -> None:
    assert set(PRODUCTS) == set(DATAFLOW)


@pytest.mark.parametrize(
    ("product", "expected"),
    [
        pytest.param(
            "calibration",
            [
                "held-out training scenes",
                "none 0.1234, platt 0.1112, isotonic 0.1199",
                "map: platt",
                "mean of 3 scenes",
            ],
            id="reliability-and-what-R-keeps",
        ),
        pytest.param("images", ["x (px)", "y (px)", "left view (reference): gray 36", "right view"], id="both-views"),
        pytest.param(
            "truth",
            [
                *("true disparity (px)", "exact", "truth unknown: 8.3 %", "hidden in the right view: 25.0 %"),
                "seen in both views: 66.7 %",
            ],
            id="shares-add-up",
        ),
        pytest.param("channels", ["gray, left", "rank, right", "companion (pure number)"], id="views-times-channels"),
        pytest.param(
            "matching_samples",
            ["disparity (px)", "share (%)", "8 samples by training scene", "mirrored", "crop of scene", ": 16.7 %"],
            id="histograms-and-crops",
        ),
        pytest.param(
            "foreign_samples",
            ["40 pixels by kind of map, 40.0 % wrong", "sgm, dense", "summed costs, blurred", "right within 1 px"],
            id="kinds-of-maps",
        ),
        pytest.param(
            "matching_net",
            ["training step", "nats, log scale", "each step", "mean of the last 4 steps", "ln 2"],
            id="trained-net-has-a-curve",
        ),
        pytest.param(
            "costvolume",
            [
                *("costs at the disparity 2 px", "log-odds of a mismatch", "probability of a mismatch"),
                *("winner: 3 px, cost -1.00, probability 0.27", "runner-up minimum: 1 px, cost 1.00"),
                "right pixel outside the image: 33.3 %",
            ],
            id="slice-and-curve",
        ),
        pytest.param("disparity", ["disparity (px)", "x (px)", "y (px)", "none: 8.3 %"], id="none-is-told"),
        pytest.param(
            "evaluation_samples",
            ["unknown: 12.5 %", "wrong: 12.5 %", "right: 75.0 %", "share of the pixels (%)", "grid of scene"],
            id="label-shares",
        ),
        pytest.param("evaluation_net", ["training step", "training loss (nats, log scale)"], id="shipped-net"),
        pytest.param(
            "confidence",
            ["probability that the disparity is right", "confidence (0 to 1)"],
            id="zero-to-one",
        ),
        pytest.param("distinctiveness", ["left view", "right view", "left (1)"], id="both-views-beside-each-other"),
        pytest.param("cost_margin", ["margin", "margin (log-odds)", "none: 8.3 %"], id="own-scale"),
        pytest.param("semidense", ["disparity (px)", "none: 8.3 %"], id="as-disparity"),
        pytest.param(
            "survey",
            ["3 matches; range to search 0 to 4 px", "median +0.0 px", "vertical offset, right minus left (px)"],
            id="matches-on-the-view",
        ),
        pytest.param(
            "alignment",
            [
                "3 places of the right view; rows are shifted by +0.10 to +0.50 px",
                "vertical offset, right minus left (px)",
            ],
            id="offsets-on-their-plane",
        ),
        pytest.param(
            "metrics", ["threshold\n(px)", "raw\nbad\n%", "rms\npx", "nonocc", "1,234", "-"], id="readable-table"
        ),
    ],
)
def test_a_figure_says_what_it_shows(product: str, expected: list[str]) -> None:
    drawn = figure(product, PRODUCTS[product](), title="Teddy: a title")
    written = texts(drawn)
    assert [text for text in ["Teddy: a title", *expected] if text not in written] == []
    drawn.draw_without_rendering()


def test_a_map_with_a_value_everywhere_has_no_legend_of_none() -> None:
    assert "none" not in " ".join(texts(figure("confidence", PRODUCTS["confidence"](), title="Teddy: a title")))


def test_a_title_is_taken_literally(tmp_path: Path) -> None:
    drawn = figure("disparity", PRODUCTS["disparity"](), title=r"$\frac{$ _x^")
    save_png(drawn, tmp_path / "drawn.png")
    assert (tmp_path / "drawn.png").stat().st_size > 1000


def test_no_state_that_callers_share_is_touched() -> None:
    backend, settings = matplotlib.get_backend(), dict(matplotlib.rcParams)
    figure("disparity", PRODUCTS["disparity"](), title="any")
    from matplotlib import _pylab_helpers

    assert not _pylab_helpers.Gcf.figs
    assert (matplotlib.get_backend(), dict(matplotlib.rcParams)) == (backend, settings)


@pytest.mark.parametrize(
    ("product", "chosen", "message"),
    [
        pytest.param("other", {}, r"no map \(y, x\) to draw", id="another-package-s-product-without-a-map"),
        pytest.param("disparity", {"pixel": (1, 1)}, "a pixel is chosen in a costvolume", id="pixel-of-a-map"),
        pytest.param("costvolume", {"pixel": (4, 0)}, "rows 0 to 3", id="row-outside"),
        pytest.param("costvolume", {"pixel": (0, -1)}, "columns 0 to 5", id="no-counting-from-the-end"),
        pytest.param("costvolume", {"disparity": 5}, "the volume has 0 to 4 px", id="disparity-outside"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(product: str, chosen: dict[str, int], message: str) -> None:
    dataset = PRODUCTS.get(product, xr.Dataset)()
    with pytest.raises(UsageError, match=message) as refused:
        figure(product, dataset, title="any", **chosen)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("attrs", "expected"),
    [
        pytest.param(
            {"label": {"scene": "a/b", "product": "channels"}, "params": {"rank_window": 31, "use": ["gray"]}},
            "a/b: channels (rank window 31)",
            id="only-what-matters",
        ),
        pytest.param(
            {"label": {"scene": "training split", "product": "matching_net"}, "params": {"shipped": "0f"}},
            "training split: matching_net (shipped weights)",
            id="shipped",
        ),
        pytest.param(
            {"label": {"scene": "s", "product": "disparity"}, "params": {"subpixel": False}},
            "s: disparity (subpixel off)",
            id="switch",
        ),
        pytest.param({}, "no scene: product", id="no-provenance"),
    ],
)
def test_a_title_says_scene_product_and_settings(attrs: dict[str, object], expected: str) -> None:
    texts = {name: json.dumps(value) for name, value in attrs.items()}
    assert product_title(xr.Dataset(attrs=texts)) == expected
