"""The page as Bokeh's document: which model goes where."""

from importlib.resources import files

from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.events import DocumentReady
from bokeh.models import Column, LayoutDOM, Row

from semidense.cache import Store
from semidense.pipeline.pages.viewer.session import Session

_GRID = (
    ":host { display: grid !important; gap: .9rem;"
    " grid-template-columns: repeat(auto-fill, minmax(min(100%, var(--map, 17rem)), 1fr)); }"
)
_WRAP = ":host { display: flex !important; flex-wrap: wrap; gap: .5rem .9rem; align-items: end; }"


def build(document: Document, store: Store) -> Session:
    """Fill a document with the viewer over a cache, and return its session."""
    session = Session(document, store)
    controls, panels = session.controls, session.panels
    choices = (
        controls.dataset,
        controls.scene,
        controls.configuration,
        controls.compare,
        controls.mask,
        controls.threshold,
        controls.size,
    )
    boxes = [panel.box for panel in panels.maps.values()]
    frame = Row(controls.nearer, controls.farther, controls.whole, margin=0, spacing=6)
    roots: dict[str, LayoutDOM] = {
        "choices": _wrapping(*choices, frame),
        "about": panels.about,
        "problem": panels.problem,
        "R": controls.R,
        "told": panels.told,
        "maps": Column(*boxes, panels.curve_box, sizing_mode="stretch_width", stylesheets=[_GRID], margin=0),
        "comparison": Column(controls.show, controls.swipe, panels.swiped.box, sizing_mode="stretch_width", margin=0),
        "place": _wrapping(controls.y, controls.x, controls.close),
        "pixel": panels.pixel,
        "costs": panels.costs_box,
        "patches": panels.patches,
        "seen": panels.seen,
        "products": panels.products,
    }
    with document.models.freeze():  # else all models are gone through again for each of the roots
        for name, model in roots.items():
            model.name = name
            document.add_root(model)
    document.js_on_event(DocumentReady, *session.first)
    document.title = "Cache viewer"
    document.template = get_env().from_string(
        (files("semidense.pipeline.pages.viewer") / "page" / "page.html").read_text(encoding="utf-8")
    )
    return session


def _wrapping(*models: LayoutDOM) -> Row:
    return Row(*models, sizing_mode="stretch_width", stylesheets=[_WRAP], margin=0)
