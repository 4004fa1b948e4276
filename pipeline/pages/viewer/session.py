"""One page in one browser: what is chosen, and the panels that show it."""

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import Select
from numpy.typing import NDArray

from semidense.cache import CacheError, Store
from semidense.pipeline.figures.colours import disparity_span, error_classes
from semidense.pipeline.pages.html import confidence_legend, disparity_legend, error_legend, missing, tag, text
from semidense.pipeline.pages.scene_maps import SceneMaps
from semidense.pipeline.pages.viewer.catalogue import CatalogueScene, Configuration, catalogue
from semidense.pipeline.pages.viewer.models import ERROR, FIGURES, SWIPED, Controls, Panels, Sources, connect
from semidense.pipeline.pages.viewer.pixel import CostCurve
from semidense.pipeline.pages.viewer.pixel_panel import (
    clear_pixel,
    show_costs,
    show_evaluation,
    show_patches,
    told_pixel,
)
from semidense.pipeline.pages.viewer.provenance import provenance_table
from semidense.pipeline.results.metric_rows import without_chance

NOTHING = "nothing"
"""The choice of no second configuration."""
_UNKNOWN = -2.0
"""The class of a pixel whose truth is not known: below all classes."""


class Session:
    """The choices and panels of one browser.

    Attributes:
        document: Bokeh's.
        store: the cache; what is read of it is checked chunk by chunk.
    """

    def __init__(self, document: Document, store: Store) -> None:
        self.document, self.store = document, store
        self.scenes = catalogue(store)
        self.controls, self.sources = Controls(), Sources()
        self.panels = Panels(self.sources)
        self.first = connect(self.controls, self.sources, self.panels)
        self.chosen: Configuration | None = None
        self.maps: SceneMaps | None = None
        self.compared: SceneMaps | None = None
        self._opened: dict[str, dict[str, Any]] = {}
        self._filling = False
        self._listen()
        self._offer(self.controls.dataset, list(dict.fromkeys(scene.dataset for scene in self.scenes)))
        self.choose_dataset()

    def _listen(self) -> None:
        """Join the controls that need the cache."""
        controls = self.controls
        for control, then in (
            (controls.dataset, self.choose_dataset),
            (controls.scene, self.choose_scene),
            (controls.configuration, self.choose_configuration),
            (controls.compare, self.choose_compared),
            (controls.mask, self.show_figures),
            (controls.threshold, self.show_figures),
            (controls.y, self.show_pixel),
            (controls.x, self.show_pixel),
        ):
            control.on_change("value", self._unless_filling(then))
        controls.close.on_click(self._forget_pixel)
        for panel in (*self.panels.maps.values(), self.panels.swiped):
            panel.plot.on_event("tap", self._tap)

    def _unless_filling(self, then: Callable[[], None]) -> Callable[[str, Any, Any], None]:
        """Return a callback that does nothing while controls are filled."""

        def changed(attr: str, old: Any, new: Any) -> None:  # noqa: ANN401
            if not self._filling:
                then()

        return changed

    def _offer(self, control: Select, options: list[str], value: str | None = None) -> None:
        """Fill a choice without choosing anything further."""
        self._filling = True
        control.update(options=options, value=value or next(iter(options), ""))
        self._filling = False

    def choose_dataset(self) -> None:
        """Offer the scenes of the dataset, and show the first."""
        dataset = self.controls.dataset.value
        self._offer(self.controls.scene, [each.name for each in self.scenes if each.dataset == dataset])
        self.choose_scene()

    def _scene(self) -> CatalogueScene | None:
        wanted = (self.controls.dataset.value, self.controls.scene.value)
        return next((each for each in self.scenes if (each.dataset, each.name) == wanted), None)

    def _configuration(self, name: str) -> Configuration | None:
        scene = self._scene()
        return next((each for each in scene.configurations if each.name == name), None) if scene else None

    def choose_scene(self) -> None:
        """Offer the configurations of the scene, and show the latest."""
        scene = self._scene()
        self._offer(self.controls.configuration, [each.name for each in scene.configurations] if scene else [])
        self.choose_configuration()

    def choose_configuration(self) -> None:
        """Read the maps of the configuration, show them, and offer the others to compare it with."""
        compare, chosen = self.controls.compare, self.controls.configuration
        others = [NOTHING, *(each for each in chosen.options if each != chosen.value)]
        self._offer(compare, others, compare.value if compare.value in others else NOTHING)
        compare.visible = len(others) > 1
        self.chosen = self._configuration(chosen.value)
        self._opened = {}
        self.maps = self._read(self.chosen)
        if self.maps is None or self.chosen is None:
            if not self.panels.problem.text:
                self._explain(f"no map is in {self.store.root}: make something with `pipeline match` or `pipeline run`")
            return
        self._show_maps(self.maps)
        self.panels.products.text = provenance_table(self.chosen, self.store)
        self.choose_compared()
        self._forget_pixel()

    def _read(self, chosen: Configuration | None) -> SceneMaps | None:
        self._explain("")
        try:
            return SceneMaps.read(self.store, chosen.keys) if chosen else None
        except CacheError as error:
            self._explain(str(error))
            return None

    def _explain(self, problem: str) -> None:
        self.panels.problem.text = tag("p", text(problem), role="alert") if problem else ""
        self.panels.problem.visible = bool(problem)

    def _show_maps(self, maps: SceneMaps) -> None:
        """Put the scene's cached maps into the panels; the other panels stay hidden."""
        height, width = maps.size
        self.panels.frame.fit(height, width)
        for panel in (*self.panels.maps.values(), self.panels.swiped):
            panel.place(height, width, maps.step)
        known = [each.ravel() for each in (maps.disparity, maps.truth) if each is not None]
        span = disparity_span(np.concatenate(known)) if known else (0.0, 1.0)
        self.panels.disparity_scales(*span)
        self._write_titles(maps, span)
        self._leave_out(maps)
        if maps.left is not None:
            self.sources.left.data = {"left": [_rgba(maps.left)]}
        if maps.truth is not None:
            self.sources.truth.data = {"truth": [maps.truth]}
        self.sources.step.data = {"step": [maps.step]}
        self.sources.base.data = _columns(maps)

    def _leave_out(self, maps: SceneMaps) -> None:
        there = {
            "left": maps.left is not None,
            "truth": maps.truth is not None,
            "raw": maps.disparity is not None,
            "confidence": maps.confidence is not None,
            "kept": maps.confidence is not None,
            "error": maps.confidence is not None and maps.truth is not None,
        }
        for name, panel in self.panels.maps.items():
            panel.box.visible = there[name]
        self.controls.R.visible = self.panels.told.visible = maps.confidence is not None
        for model in (self.panels.curve_box, self.controls.mask, self.controls.threshold):
            model.visible = maps.tally is not None
        self.controls.show.labels = [each for each in SWIPED if each != ERROR or maps.truth is not None]

    def _write_titles(self, maps: SceneMaps, span: tuple[float, float]) -> None:
        titles = {
            "left": ("left image", "the reference view"),
            "truth": ("ground truth (px)", disparity_legend(span, "unknown")),
            "raw": ("raw disparity (px)", disparity_legend(span, missing(maps.disparity))),
            "confidence": ("confidence", confidence_legend(missing(maps.confidence))),
            "kept": ("kept at R (px)", disparity_legend(span, "not kept")),
            "error": ("error of what is kept", error_legend(none="not kept")),
        }
        for name, (title, legend) in titles.items():
            self.panels.maps[name].title.text = tag("h3", text(title))
            self.panels.maps[name].legend.text = legend
        scales = (disparity_legend(span, "none"), error_legend(), confidence_legend())
        told = zip(("disparity", "error", "confidence"), scales, strict=True)
        self.panels.swiped.legend.text = "<br>".join(f"{name}: {legend}" for name, legend in told)
        height, width = maps.size
        every = f"; every {maps.step}. row and column shown" if maps.step > 1 else ""
        mask = f"; mask nonocc: {maps.mask_kind}" if maps.mask_kind else ""
        self.panels.about.text = text(f"{width} x {height} px{every}{mask}")

    def show_figures(self) -> None:
        """Put the figures at every R for the mask and threshold that are set into the table that the browser reads."""
        controls = self.controls
        self.sources.names.data = {"name": [text(controls.configuration.value), text(controls.compare.value)]}
        for source, maps in ((self.sources.second, self.compared), (self.sources.table, self.maps)):
            tally = maps.tally if maps else None
            rows = tally.rows("", controls.mask.value, float(controls.threshold.value)) if tally else []
            drawn = [row | {"drawn": kept.get("bad")} for row, kept in zip(rows, without_chance(rows), strict=True)]
            source.data = {name: np.array([row.get(name, np.nan) for row in drawn], float) for name in FIGURES}

    def choose_compared(self) -> None:
        """Read the maps of the second configuration, if there is one, and show the figures of both."""
        name = self.controls.compare.value
        other = self._read(self._configuration(name)) if name != NOTHING else None
        shown = other is not None and other.disparity is not None and other.confidence is not None
        for model in (self.panels.swiped.box, self.controls.show, self.controls.swipe):
            model.visible = shown
        if other is not None and shown:
            self.panels.swiped.title.text = tag("h3", text(f"left: {self.controls.configuration.value}; right: {name}"))
            self.sources.other.data = _columns(other)
        self.compared = other if shown else None
        self.show_figures()

    def _tap(self, event: Any) -> None:  # noqa: ANN401
        if self.maps is None:
            return
        height, width = self.maps.size
        y, x = round(event.y), round(event.x)
        if 0 <= y < height and 0 <= x < width:
            self._filling = True
            self.controls.y.value, self.controls.x.value = y, x
            self._filling = False
            self.show_pixel()

    def _forget_pixel(self) -> None:
        height, width = self.maps.size if self.maps else (1, 1)
        self._filling = True
        self.controls.y.update(value=None, high=height - 1)
        self.controls.x.update(value=None, high=width - 1)
        self._filling = False
        self.panels.frame.mark.data = {"x": [], "y": []}
        self.controls.close.visible = False
        clear_pixel(self.panels)

    def show_pixel(self) -> None:
        """Show the chosen pixel: its costs, and the patches that the networks see; only cached products are shown."""
        y, x = self.controls.y.value, self.controls.x.value
        if self.chosen is None or y is None or x is None:
            return
        y, x = int(y), int(x)
        try:
            self._show_pixel(self.chosen.keys, y, x)
        except CacheError as error:
            self._explain(str(error))

    def _open(self, keys: dict[str, str]) -> dict[str, dict[str, Any]]:
        """Return the arrays that a pixel is read from, opened when the first pixel is asked for."""
        if not self._opened:
            self._opened = {product: self.store.arrays(key) for product, key in keys.items() if product in _READ}
        return self._opened

    def _show_pixel(self, keys: dict[str, str], y: int, x: int) -> None:
        self.panels.frame.mark.data = {"x": [x], "y": [y]}
        self.controls.close.visible = True
        arrays = self._open(keys)
        values = {
            name: float(arrays[name][column][y, x])
            for name, column in (("disparity", "disparity"), ("confidence", "confidence"), ("truth", "disparity"))
            if name in arrays
        }
        curve = None
        if "costvolume" in arrays:
            volume = arrays["costvolume"]
            curve = CostCurve.read(volume["cost"], np.asarray(volume["d"][...]), y, x)
            show_costs(self.sources, self.panels, curve, values.get("truth", np.nan))
        if "channels" in arrays and self.chosen:
            use = list(self.chosen.entries["channels"].recipe.params.get("use", ()))
            show_patches(self.sources, self.panels, arrays["channels"]["channels"], use, (y, x), values)
        if {"images", "disparity"} <= set(arrays):
            maps = arrays["images"]["left"], arrays["disparity"]["disparity"]
            show_evaluation(self.sources, self.panels, *maps, (y, x))
        self.panels.pixel.text = told_pixel((y, x), values, curve)


_READ = ("costvolume", "channels", "images", "disparity", "confidence", "truth")


def _rgba(view: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return a view (y, x, 3) as the numbers that Bokeh takes for colours."""
    opaque = np.full((*view.shape[:2], 4), 255, np.uint8)
    opaque[..., :3] = view
    return opaque.view(np.uint32)[..., 0]


def _columns(maps: SceneMaps) -> dict[str, list[NDArray[np.float32]]]:
    """Return the maps that are filtered and compared; a map that is not cached is NaN everywhere."""
    shape = next(each.shape[:2] for each in (maps.disparity, maps.left) if each is not None)
    none = np.full(shape, np.nan, np.float32)
    error, classes = maps.error(), none
    if error is not None and maps.truth is not None:
        classes = np.where(np.isfinite(maps.truth), error_classes(error), np.float32(_UNKNOWN)).astype(np.float32)
    return {
        "disparity": [none if maps.disparity is None else maps.disparity],
        "confidence": [none if maps.confidence is None else maps.confidence],
        "error": [classes],
    }
