"""Everything on the page that changes: the sources of data, the panels, the controls."""

from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from bokeh.models import Button, Column, ColumnDataSource, CustomJS, RadioButtonGroup, Select, Slider, Span, Spinner

from semidense.pipeline.pages.viewer.panels import (
    CONTROL,
    COST_LEGEND,
    WIDE,
    Frame,
    MapPanel,
    blank,
    cost_chart,
    curve_chart,
    gray_mapper,
    map_panel,
    patch_chart,
    scales,
    words,
)
from semidense.stages.metrics.errors import MASKS, THRESHOLDS

ERROR = "error"
SWIPED = ("kept at R", "raw disparity", ERROR, "confidence")
"""Maps by which two configurations can be compared."""
_POINT = ("invalid", "bad", "label", "side", "colour")
SIZES = {"small maps": ("17rem", "span 2"), "large maps": ("34rem", "1 / -1"), "full width": ("100%", "1 / -1")}
"""The least width of a map, and the columns of the grid that the curve takes, by what a user calls the size.

A curve that asks for two columns where only one fits makes a second one of no width, and hides every second map."""
FIGURES = ("R", "invalid", "bad", "avgerr", "rms", "drawn")
"""Columns of a table of figures; ``drawn`` is ``bad`` where the curve is drawn."""


def script(name: str) -> str:
    """Return the code of a callback that runs in the browser."""
    return (files("semidense.pipeline.pages.viewer") / "page" / f"{name}.js").read_text(encoding="utf-8")


class Sources:
    """The data behind the panels: maps as they are cached, and what the browser makes of them."""

    def __init__(self) -> None:
        self.left = blank("left")
        self.truth = blank("truth")
        self.base = blank("disparity", "confidence", "error")
        self.kept = blank("disparity", "error")
        self.other = blank("disparity", "confidence", "error")
        self.swiped = blank("disparity", "error", "confidence")
        self.table = ColumnDataSource({name: [] for name in FIGURES}, name="table")
        self.second = ColumnDataSource({name: [] for name in FIGURES}, name="second-table")
        self.names = ColumnDataSource({"name": []}, name="names")
        self.point = ColumnDataSource({name: [] for name in _POINT}, name="point")
        self.step = ColumnDataSource({"step": [1]})
        self.curve = ColumnDataSource({"d": [0, 1], "cost": [0, 1]}, name="cost-curve")
        self.marks = ColumnDataSource({"d": [], "cost": [], "marker": [], "colour": []}, name="cost-marks")
        self.patches = ColumnDataSource({name: [] for name in ("patch", *_PLACED)}, name="patches")
        self.gray = ColumnDataSource({name: [] for name in ("gray", *_PLACED)}, name="gray-patch")
        self.seen = ColumnDataSource({name: [] for name in ("disparity", *_PLACED)}, name="disparity-patch")
        self.base.name, self.kept.name, self.swiped.name = "base-data", "kept-data", "swiped-data"


_PLACED = ("x", "y", "dw", "dh", "label", "mx", "my", "side")


@dataclass(frozen=True, eq=False)
class Controls:
    """What a user sets. Labels say what they do; all can be reached by the keyboard."""

    dataset: Select = field(default_factory=lambda: _select("dataset"))
    scene: Select = field(default_factory=lambda: _select("scene"))
    configuration: Select = field(default_factory=lambda: _select("configuration"))
    compare: Select = field(default_factory=lambda: _select("compare with"))
    mask: Select = field(default_factory=lambda: _select("pixels that count", list(MASKS), "nonocc"))
    threshold: Select = field(
        default_factory=lambda: _select("wrong above (px)", [f"{each:g}" for each in THRESHOLDS], "1")
    )
    size: Select = field(default_factory=lambda: _select("size", list(SIZES), next(iter(SIZES))))
    R: Slider = field(
        default_factory=lambda: Slider(
            start=0, end=1, step=0.01, value=0.9, title="R, the least confidence that is kept", name="R",
            sizing_mode="stretch_width", format="0.00", margin=0, bar_color="#0072B2", stylesheets=[CONTROL],
        )
    )  # fmt: skip
    y: Spinner = field(default_factory=lambda: _spinner("row y (px)"))
    x: Spinner = field(default_factory=lambda: _spinner("column x (px)"))
    whole: Button = field(default_factory=lambda: _button("whole image"))
    nearer: Button = field(default_factory=lambda: _button("+", "nearer"))
    farther: Button = field(default_factory=lambda: _button("\N{MINUS SIGN}", "farther"))
    close: Button = field(default_factory=lambda: _button("close"))
    show: RadioButtonGroup = field(
        default_factory=lambda: RadioButtonGroup(
            labels=list(SWIPED), active=0, name="show", margin=0, stylesheets=[CONTROL]
        )
    )
    swipe: Slider = field(
        default_factory=lambda: Slider(
            start=0, end=100, step=1, value=50, title="swipe (% of the width)", name="swipe",
            sizing_mode="stretch_width", margin=0, stylesheets=[CONTROL],
        )
    )  # fmt: skip


def _select(title: str, options: list[str] | None = None, value: str = "") -> Select:
    name = title.partition(" ")[0]
    width = {"configuration": 330, "compare": 330, "pixels": 120, "wrong": 120, "dataset": 190}.get(name, 150)
    return Select(
        title=title, options=options or [], value=value, name=name, width=width, margin=0, stylesheets=[CONTROL]
    )


def _spinner(title: str) -> Spinner:
    return Spinner(
        title=title, low=0, step=1, name=title.split()[1], width=110, margin=0, stylesheets=[CONTROL], value=None
    )


def _button(label: str, name: str = "") -> Button:
    width = 110 if not name else 44
    return Button(label=label, name=name or label, width=width, margin=0, stylesheets=[CONTROL])


NO_PIXEL = "Click into a map, or set row and column, to see the costs and the patches of a pixel."


class Panels:
    """The pictures and charts, joined to their sources."""

    def __init__(self, sources: Sources) -> None:
        self.frame = Frame.new()
        self.maps: dict[str, MapPanel] = {
            "left": map_panel("left", self.frame, sources.left, {"left": None}, ""),
            "truth": self._map("truth", sources.truth, "disparity"),
            "raw": self._map("disparity", sources.base, "disparity"),
            "confidence": self._map("confidence", sources.base, "confidence"),
            "kept": self._map("disparity", sources.kept, "disparity", name="kept"),
            "error": self._map("error", sources.kept, "error"),
        }
        every = {"disparity": scales()["disparity"], "error": scales()["error"], "confidence": scales()["confidence"]}
        self.swiped = map_panel("swiped", self.frame, sources.swiped, dict(every), "")
        self.line = Span(location=0, dimension="height", line_color="white", line_width=3)
        self.swiped.plot.add_layout(self.line)
        self.curve = curve_chart(sources.table, sources.second, sources.point)
        title = words("curve-title", "<h3>error against invalid pixels</h3>")
        self.curve_box = Column(title, self.curve, sizing_mode="stretch_width", stylesheets=[WIDE], margin=0)
        self.costs, self.true = cost_chart(sources.curve, sources.marks)
        self.costs_box = Column(
            self.costs, words("cost-legend", COST_LEGEND), sizing_mode="stretch_width", visible=False
        )
        self.patches = patch_chart("patches", sources.patches, {"patch": gray_mapper()}, 42, 57)
        self.seen_scale = scales()["disparity"]
        self.seen = patch_chart("seen", sources.gray, {"gray": gray_mapper()}, 210, 112)
        self.seen.image(
            image="disparity", x="x", y="y", dw="dw", dh="dh", source=sources.seen, color_mapper=self.seen_scale
        )
        self.seen.text("x", "y", text="label", source=sources.seen, y_offset=-4, text_font_size="12px")
        self.seen.rect(
            "mx", "my", "side", "side", source=sources.seen, fill_color=None, line_color="#D55E00", line_width=2
        )
        self.charts = (self.curve, self.costs, self.patches, self.seen)
        self.told = words("told")
        self.about = words("about")
        self.pixel = words("pixel", NO_PIXEL)
        self.products = words("products")
        self.problem = words("problem")

    def _map(self, column: str, source: ColumnDataSource, scale: str, name: str = "") -> MapPanel:
        unit = {"disparity": "disparity (px)", "confidence": "confidence", "error": ""}[scale]
        return map_panel(
            name or {"disparity": "raw"}.get(column, column), self.frame, source, {column: scales()[scale]}, unit
        )

    def disparity_scales(self, low: float, high: float) -> None:
        """Give all disparity maps one scale of colours, so that they can be compared."""
        for panel in (self.maps["truth"], self.maps["raw"], self.maps["kept"], self.swiped):
            panel.scale(low, high)
        self.seen_scale.update(low=low, high=high)


def connect(controls: Controls, sources: Sources, panels: Panels) -> list[CustomJS]:
    """Connect the callbacks that run in the browser: filter, swipe and frame; return the one that runs at the start."""
    base = {"slider": controls.R, "base": sources.base}
    keep = CustomJS(
        args={
            **base, "kept": sources.kept, "table": sources.table, "second": sources.second, "names": sources.names,
            "point": sources.point, "told": panels.told,
        },
        code=script("filter"),
    )  # fmt: skip
    glyphs: dict[str, Any] = dict(zip(("disparity", "error", "confidence"), panels.swiped.glyphs, strict=True))
    swipe = CustomJS(
        args={
            **base, "other": sources.other, "swiped": sources.swiped, "show": controls.show, "swipe": controls.swipe,
            "glyphs": glyphs, "line": panels.line, "step": sources.step,
        },
        code=script("swipe"),
    )  # fmt: skip
    controls.R.js_on_change("value", keep, swipe)
    controls.swipe.js_on_change("value", swipe)
    controls.show.js_on_change("active", swipe)
    sources.base.js_on_change("data", keep, swipe)
    for figures in (sources.table, sources.second, sources.names):
        figures.js_on_change("data", keep)
    sources.other.js_on_change("data", swipe)
    controls.whole.js_on_click(panels.frame.whole())
    controls.nearer.js_on_click(panels.frame.closer(1.5))
    controls.farther.js_on_click(panels.frame.closer(1 / 1.5))
    controls.size.js_on_change("value", CustomJS(args={"sizes": SIZES}, code=_RESIZE))
    return [keep, swipe, CustomJS(args={"charts": [*panels.charts]}, code=script("scheme"))]


_RESIZE = """const [map, curve] = sizes[cb_obj.value]
document.documentElement.style.setProperty("--map", map)
document.documentElement.style.setProperty("--curve", curve)"""
