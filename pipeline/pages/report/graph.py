"""Draw the dataflow: what each product is made from, how much of it is cached, and how long it took."""

from collections.abc import Mapping
from typing import NamedTuple

from semidense.pipeline.pages.html import Html, table, tag, text
from semidense.pipeline.pages.report.gathered import Gathered
from semidense.pipeline.plan.steps import NETS, products
from semidense.pipeline.results.text import bytes_text
from semidense.stages.catalog import STAGES

_PLACES = {
    "images": (0, 0),
    "channels": (1, 0),
    "costvolume": (2, 0),
    "disparity": (3, 0),
    "confidence": (4, 0),
    "semidense": (5, 0),
    "metrics": (6, 0),
    "matching_samples": (0, 1),
    "matching_net": (1, 1),
    "descriptor_net": (1, 1),
    "evaluation_samples": (3, 1),
    "evaluation_net": (4, 1),
    "truth": (5, 1),
    "ranking": (6, 1),
}
"""Column and row of each product; a volume is made by one of the two networks that share a place."""
_WIDTH, _HEIGHT, _GAP_X, _GAP_Y = 124, 56, 34, 54


class Done(NamedTuple):
    """How much of a product is cached, over all scenes."""

    cached: int
    wanted: int
    seconds: float
    size: int

    @property
    def state(self) -> str:
        """``hit``, ``part`` or ``missing``."""
        return "hit" if self.cached == self.wanted else "part" if self.cached else "missing"


def done(found: Gathered) -> dict[str, Done]:
    """Return how much of each product of the plan is cached, in the order of the dataflow."""
    counts: dict[str, Done] = {}
    for planned in found.plan.steps:
        cached, wanted, seconds, size = counts.get(planned.step.product, Done(0, 0, 0.0, 0))
        entry = found.entries.get(planned.key or "") if planned.state == "hit" else None
        made = (entry.seconds, entry.size) if entry else (0.0, 0)
        counts[planned.step.product] = Done(cached + bool(entry), wanted + 1, seconds + made[0], size + made[1])
    return {product: counts[product] for product in products() if product in counts}


def done_beside(found: Gathered) -> dict[str, Done]:
    """Return how much of each baseline is cached, if it is cached for any scene."""
    counts: dict[str, Done] = {}
    for scene in found.scenes:
        for product, key in scene.baselines.items():
            entry = found.entries[key]
            before = counts.get(product, Done(0, len(found.scenes), 0.0, 0))
            counts[product] = Done(
                before.cached + 1, before.wanted, before.seconds + entry.seconds, before.size + entry.size
            )
    return {product: counts[product] for product in products() if product in counts}


def steps_table(found: Gathered) -> Html:
    """Return a table with a row a product: how many are cached, how long they took, how large they are."""
    rows = [
        [
            product,
            f"{each.cached} of {each.wanted}",
            _duration(each.seconds),
            bytes_text(each.size) if each.size else "-",
        ]
        for product, each in (done(found) | done_beside(found)).items()
    ]
    return table(["product", "cached", "made in", "size"], rows, caption="What is cached, and what making it took")


def graph(found: Gathered) -> Html:
    """Return the drawing; the table has the same figures for those who cannot see it."""
    counts = done(found)
    shown = [product for product in _PLACES if product in counts]
    rows = 2 if any(_PLACES[product][1] for product in shown) else 1
    width, height = 7 * _WIDTH + 6 * _GAP_X + 4, rows * _HEIGHT + (rows - 1) * _GAP_Y + 4
    arrows = [_arrow(source, product) for product in shown for source in _drawn_inputs(product, counts)]
    boxes = [_box(product, counts[product]) for product in shown]
    head = '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    tip = f'{head}<path d="M0,0 L8,4 L0,8 z" class="tip"/></marker></defs>'
    label = "Dataflow: each product, how many of it are cached, and the time it took to make"
    drawing = tag("svg", tip, *arrows, *boxes, viewBox=f"-2 -2 {width} {height}", role="img", aria_label=label)
    return tag("div", drawing, class_="graph scroll", tabindex=0, role="region", aria_label="Dataflow")


def _drawn_inputs(product: str, counts: Mapping[str, Done]) -> list[str]:
    """Return the inputs that get an arrow: only neighbours, since long arrows would cross boxes."""
    x, y = _PLACES[product]
    inputs = [name for name in STAGES[product].inputs if name in _PLACES] if product in STAGES else []
    if product in NETS and not any(name in counts for name in inputs if name.endswith("_samples")):
        return []
    return [
        name
        for name in inputs
        if name in counts
        and (abs(_PLACES[name][0] - x) + abs(_PLACES[name][1] - y) == 1 or (name in NETS and product == "costvolume"))
    ]


def _corner(product: str) -> tuple[int, int]:
    column, row = _PLACES[product]
    return column * (_WIDTH + _GAP_X), row * (_HEIGHT + _GAP_Y)


def _arrow(source: str, product: str) -> Html:
    (x0, y0), (x1, y1) = _corner(source), _corner(product)
    if y0 == y1:
        start, end = (x0 + _WIDTH, y0 + _HEIGHT // 2), (x1 - 2, y1 + _HEIGHT // 2)
    elif x0 == x1:
        down = y1 > y0
        start, end = (x0 + _WIDTH // 2, y0 + _HEIGHT * down), (x1 + _WIDTH // 2, y1 + (-2 if down else _HEIGHT + 2))
    else:
        start, end = (x0 + _WIDTH, y0), (x1 + 12, y1 + _HEIGHT + 2)
    return f'<path class="arrow" d="M{start[0]},{start[1]} L{end[0]},{end[1]}" marker-end="url(#tip)"/>'


def _box(product: str, each: Done) -> Html:
    x, y = _corner(product)
    words = "not cached" if each.state == "missing" else f"{each.cached} of {each.wanted} · {_duration(each.seconds)}"
    middle = x + _WIDTH // 2
    return tag(
        "g",
        tag("rect", x=x, y=y, width=_WIDTH, height=_HEIGHT, rx=8),
        tag("text", text(product), x=middle, y=y + 24, class_="name"),
        tag("text", text(words), x=middle, y=y + 43, class_="state"),
        class_=each.state,
    )


def _duration(seconds: float) -> str:
    """Return a duration as text with its unit.

    >>> _duration(0.01), _duration(61.24), _duration(7000)
    ('0.01 s', '61 s', '1 h 57 min')
    """
    if seconds < 10:
        return f"{seconds:.2f} s"
    if seconds < 600:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
