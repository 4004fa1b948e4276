"""The pictures and charts of the page: Bokeh's models, empty until a scene is chosen."""

from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.models import (
    BasicTicker,
    Column,
    ColumnDataSource,
    CustomJS,
    Div,
    GlyphRenderer,
    HoverTool,
    LinearColorMapper,
    Range1d,
    Span,
)
from bokeh.plotting import figure
from matplotlib.colors import Colormap, to_hex

from semidense.pipeline.figures.colours import (
    BLUE,
    ERROR_COLOURS,
    GREEN,
    NONE,
    ORANGE,
    QUIET,
    RED,
    UNKNOWN,
    confidence_colours,
    confidence_share,
    disparity_colours,
)


def _style(name: str) -> str:
    return (files("semidense.pipeline.pages.viewer") / "page" / f"{name}.css").read_text(encoding="utf-8")


LEGEND = _style("legend")
CONTROL = _style("control")
"""A style: controls in the page's colours, light or dark."""
WIDE = ":host { grid-column: var(--curve, span 2); } @media (max-width: 44rem) { :host { grid-column: auto; } }"
"""A style: the panel takes two columns of a grid of small maps, and a whole row of others."""
_FINE = 1000
"""Colours of the confidence: enough for a step of 0.001 at its ends."""
_HIGHEST = 270
"""Greatest height of a chart of patches, px of the screen: a pixel is shown beside the maps."""
_BLANK = np.full((1, 1), np.nan, np.float32)


def words(name: str, text: str = "") -> Div:
    """Return a piece of text that can be changed."""
    return Div(text=text, name=name, sizing_mode="stretch_width", stylesheets=[LEGEND], margin=0)


def mapper(colours: Colormap, low: float, high: float) -> LinearColorMapper:
    """Return a colour scale that shows missing values in black."""
    palette = [to_hex(each) for each in colours(np.linspace(0, 1, 256))]
    return LinearColorMapper(palette=palette, low=low, high=high, nan_color=NONE)


def confidence_mapper() -> LinearColorMapper:
    """Return the colours of confidences: a straight scale whose colours follow their log-odds."""
    colours = confidence_colours()(confidence_share(np.linspace(0, 1, _FINE)))
    return LinearColorMapper(palette=[to_hex(each) for each in colours], low=0, high=1, nan_color=NONE)


def error_mapper() -> LinearColorMapper:
    """Return the colours of the classes of errors; pixels of unknown truth lie below the first class."""
    return LinearColorMapper(
        palette=list(ERROR_COLOURS), low=-0.5, high=len(ERROR_COLOURS) - 0.5, nan_color=NONE, low_color=UNKNOWN
    )


@dataclass(frozen=True, eq=False)
class Frame:
    """The part of the image that all maps show, and the pixel that is marked on them."""

    x: Range1d
    y: Range1d
    mark: ColumnDataSource

    @classmethod
    def new(cls) -> "Frame":
        """Return a frame without an image."""
        mark = ColumnDataSource({"x": [], "y": []})
        return cls(Range1d(0, 1, name="across"), Range1d(1, 0, name="down"), mark)

    def fit(self, height: int, width: int) -> None:
        """Show the whole of an image; pixel (y, x) is the square around that point, rows go down."""
        for range_, start, end in ((self.x, -0.5, width - 0.5), (self.y, height - 0.5, -0.5)):
            range_.update(start=start, end=end, reset_start=start, reset_end=end)

    def whole(self) -> CustomJS:
        """Return the browser's callback that shows the whole image again."""
        return CustomJS(
            args={"x": self.x, "y": self.y},
            code="for (const r of [x, y]) r.setv({start: r.reset_start, end: r.reset_end})",
        )

    def closer(self, factor: float) -> CustomJS:
        """Return the browser's callback that zooms by a factor around the middle of the picture."""
        code = """for (const r of [x, y]) {
            const middle = (r.start + r.end) / 2, half = (r.end - r.start) / 2 / factor
            r.setv({start: middle - half, end: middle + half})
        }"""
        return CustomJS(args={"x": self.x, "y": self.y, "factor": factor}, code=code)


@dataclass(frozen=True, eq=False)
class MapPanel:
    """A map with its title and legend.

    Attributes:
        plot: the figure.
        glyphs: the pictures in it, one for each scale of colours that it can have.
        title: text above.
        legend: text below.
        box: all of it.
    """

    plot: Any
    glyphs: tuple[GlyphRenderer, ...]
    title: Div
    legend: Div
    box: Column

    def place(self, height: int, width: int, step: int) -> None:
        """Make room for an image of so many pixels, every ``step``-th of them shown."""
        across, down = -(-width // step) * step, -(-height // step) * step
        for each in self.glyphs:
            each.glyph.update(dw=across, dh=down)
        self.plot.aspect_ratio = width / height

    def scale(self, low: float, high: float) -> None:
        """Set the values of the first and the last colour of the first picture."""
        self.glyphs[0].glyph.color_mapper.update(low=low, high=high)


def map_panel(
    name: str, frame: Frame, source: ColumnDataSource, columns: dict[str, LinearColorMapper | None], unit: str
) -> MapPanel:
    """Return a panel for a map.

    Args:
        name: of the figure.
        frame: what all maps share.
        source: holds the map in a column.
        columns: the columns, each with its colours; None for a column that holds colours.
        unit: what the numbers under the pointer are.
    """
    plot = figure(
        name=name, x_range=frame.x, y_range=frame.y, sizing_mode="scale_width", aspect_ratio=1.5, toolbar_location=None,
        tools="pan,wheel_zoom", active_drag="pan", active_scroll="wheel_zoom", min_border=0,
        outline_line_color="#8a8a8a", background_fill_color="#000000", output_backend="canvas", lod_threshold=None,
    )  # fmt: skip
    plot.axis.visible = False
    plot.grid.visible = False
    where = {"x": -0.5, "y": -0.5, "dw": 1, "dh": 1, "source": source}
    glyphs = tuple(
        plot.image(image=column, color_mapper=colours, **where) if colours else plot.image_rgba(image=column, **where)
        for column, colours in columns.items()
    )
    if unit:
        value = [(unit, f"@{next(iter(columns))}{{0.00}}")]
        plot.add_tools(HoverTool(renderers=[glyphs[0]], tooltips=[("x", "$x{0} px"), ("y", "$y{0} px"), *value]))
    for colour, width in (("white", 5), ("black", 2)):
        plot.scatter("x", "y", source=frame.mark, size=15, fill_color=None, line_color=colour, line_width=width)
    title, legend = words(f"{name}-title"), words(f"{name}-legend")
    box = Column(title, plot, legend, sizing_mode="stretch_width", name=f"{name}-box", margin=0)
    return MapPanel(plot, glyphs, title, legend, box)


def blank(*columns: str) -> ColumnDataSource:
    """Return a source of maps without a pixel."""
    return ColumnDataSource({column: [_BLANK] for column in columns})


def chart(name: str, x: str, y: str, height: int = 340, **how: Any) -> Any:  # noqa: ANN401
    """Return an empty chart with named axes."""
    plot = figure(
        name=name, sizing_mode="stretch_width", height=height, x_axis_label=x, y_axis_label=y,
        tools="pan,wheel_zoom,reset", toolbar_location=None, active_scroll=None,
        background_fill_color=None, border_fill_color=None, **how,
    )  # fmt: skip
    plot.axis.axis_label_text_font_style = "normal"
    plot.outline_line_color = None
    plot.grid.grid_line_alpha = 0.4
    return plot


def curve_chart(table: ColumnDataSource, second: ColumnDataSource, point: ColumnDataSource) -> Any:  # noqa: ANN401
    """Return the curve of error against invalid pixels, that of a second configuration, and the points at the R set."""
    plot = chart("curve", "invalid: pixels that are not kept (%)", "bad: wrong of the kept (%)", 230)
    plot.line("invalid", "drawn", source=second, color=ORANGE, line_width=2, line_dash="dashed")
    plot.line("invalid", "drawn", source=table, color=BLUE, line_width=2)
    plot.scatter("invalid", "drawn", source=table, color=BLUE, size=3)
    plot.scatter("invalid", "bad", source=point, color="colour", line_color="black", size=14)
    label = {"text": "label", "text_align": "side", "y_offset": -10, "text_font_style": "bold"}
    plot.text("invalid", "bad", source=point, **label)
    plot.add_tools(
        HoverTool(
            renderers=[plot.renderers[2]],
            tooltips=[("R", "@R{0.0000}"), ("invalid", "@invalid{0.0} %"), ("bad", "@bad{0.00} %")],
        )
    )
    plot.y_range.start = 0
    plot.y_range.range_padding = 0.25  # room for the label of R
    return plot


def cost_chart(curve: ColumnDataSource, marks: ColumnDataSource) -> tuple[Any, Span]:
    """Return the chart of a pixel's costs, and the line at its true disparity."""
    plot = chart("cost-chart", "disparity (px)", "cost (log-odds)", 210)
    plot.line("d", "cost", source=curve, color=BLUE, line_width=2)
    plot.scatter("d", "cost", source=curve, color=BLUE, size=5)
    plot.scatter("d", "cost", source=marks, marker="marker", color="colour", line_color="black", size=16)
    truth = Span(dimension="height", line_color=GREEN, line_dash="dashed", line_width=2.5, visible=False)
    plot.add_layout(truth)
    plot.add_tools(HoverTool(renderers=[plot.renderers[1]], tooltips=[("disparity", "@d px"), ("cost", "@cost{0.00}")]))
    plot.xaxis.ticker = BasicTicker(min_interval=1)
    return plot, truth


COST_LEGEND = (
    f'<span class="key"><b style="color:{RED}">★</b> winner</span>'
    f'<span class="key"><b style="color:{ORANGE}">▼</b> runner-up, the next local minimum</span>'
    f'<span class="key"><b style="color:{GREEN}">┆</b> truth</span>'
    '<span class="key">cost: log-odds of a mismatch</span>'
)
MARKS = {"winner": ("star", RED), "runner-up": ("inverted_triangle", ORANGE)}
"""Marker and colour of the minima of a cost curve."""


def patch_chart(
    name: str, source: ColumnDataSource, colours: dict[str, LinearColorMapper], width: float, height: float
) -> Any:  # noqa: ANN401
    """Return a chart of patches side by side: columns ``x y dw dh`` say where, ``label`` what; row 0 is on top.

    Args:
        name: of the figure.
        source: of the patches, one column of pictures for each scale of colours.
        colours: scales, by column.
        width: of everything, px of the patches.
        height: of everything.
    """
    plot = figure(
        name=name, x_range=(0, width), y_range=(height, 0), sizing_mode="scale_width",
        aspect_ratio=width / height, max_width=round(_HIGHEST * width / height), visible=False,
        tools="", toolbar_location=None, min_border=0, outline_line_color=None,
        background_fill_color=None, border_fill_color=None,
    )  # fmt: skip
    plot.axis.visible = False
    plot.grid.visible = False
    for column, scale in colours.items():
        plot.image(image=column, x="x", y="y", dw="dw", dh="dh", color_mapper=scale, source=source)
    plot.text("x", "y", text="label", source=source, y_offset=-4, text_font_size="12px")
    plot.rect("mx", "my", "side", "side", source=source, fill_color=None, line_color=RED, line_width=2)
    return plot


def gray_mapper() -> LinearColorMapper:
    """Return the scale of patches that are brought to 0 to 1."""
    return LinearColorMapper(
        palette=[f"#{level:02x}{level:02x}{level:02x}" for level in range(256)], low=0, high=1, nan_color=QUIET
    )


def scales() -> dict[str, LinearColorMapper]:
    """Return fresh scales of a disparity, a confidence and an error."""
    return {
        "disparity": mapper(disparity_colours(), 0, 1),
        "confidence": confidence_mapper(),
        "error": error_mapper(),
    }
