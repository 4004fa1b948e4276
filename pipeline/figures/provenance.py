"""Draw what a product was made from: a box a product, images and weights at the top, the product at the bottom."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import TypeVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path as Curve
from matplotlib.text import Text

from semidense.cache import code_hash_of
from semidense.cache.keys.recipe import short
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.provenance import Ancestor
from semidense.pipeline.results.text import value_text

WIDTH, HEIGHT = 2.5, 1.5
"""Inches of a box with the space around it."""
PIXELS, POINTS = 150, 72
"""Units an inch: of a PNG, and of SVG and PDF, which are drawn in points."""
FORMATS = (".svg", ".png", ".pdf")
COLOURS = {"origin": "#dceefb", "net": "#fdeccb", "product": "#f4f4f4", "gone": "#f8d7da"}
"""Colours of boxes: files that are read, networks and weights, computed products, products deleted since."""

LINE_WIDTH = 0.3
"""Columns that a line needs to pass a row; a box needs 1."""
_LETTERS, _LINES = 40, 3
"""Letters in a line of a box, and lines of settings."""
_NO_SETTINGS = ("tiles", "files", "parameters", "reader", "shipped")
"""Parameters that are none, or that the box names as its origin."""
SWEEPS = 8
"""Number of times that the rows are reordered, down and up; more did not change the pictures tried."""

T = TypeVar("T")
Box = tuple[str, str]
"""Product and scene; products of several training scenes share a box."""
Stop = tuple[Box, int]
"""A box in its row, or in a lower row the line that leads from it further down."""
Point = tuple[float, float]
"""Column and row; rows count downwards."""


def save_graph(chain: Sequence[Ancestor], path: Path) -> None:
    """Draw the chain of a product into an SVG, PNG or PDF file.

    Raises:
        UsageError: if the file's name has another ending, or it cannot be written.
    """
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"--graph {path}: the name must end in {', '.join(FORMATS)}")
    from matplotlib import rc_context

    ending = path.suffix.lower()
    try:
        with rc_context({"svg.fonttype": "none", "svg.hashsalt": "provenance"}):
            metadata = {"Date": None} if ending == ".svg" else None
            draw_graph(chain, PIXELS if ending == ".png" else POINTS).savefig(path, dpi="figure", metadata=metadata)
    except OSError as error:
        raise UsageError(f"--graph {path}: {error.strerror or error}") from None


def draw_graph(chain: Sequence[Ancestor], dpi: int) -> Figure:
    """Return the picture of a chain, nearest first as ``ancestry`` gives it, to be saved at just this resolution."""
    members: dict[Box, list[Ancestor]] = {}
    box_of: dict[tuple[str, str], Box] = {}
    for each in chain:
        box = (each.product, _group(each, chain[0].scene))
        members.setdefault(box, []).append(each)
        box_of[each.product, each.digest] = box
    parents = {box: list(dict.fromkeys(_parents(found, box_of))) for box, found in members.items()}
    rows = _rows(parents)
    columns = _columns(parents, rows)
    width, height = 1 + max(columns.values()) - min(columns.values()), 1 + max(rows.values())
    figure = Figure(figsize=(max(4.0, width * WIDTH), height * HEIGHT + 0.3), dpi=dpi)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(min(columns.values()) - 0.5, max(columns.values()) + 0.5), ylim=(height - 0.4, -0.6))
    axes.axis("off")
    texts = {}
    for box, found in members.items():
        style = {"boxstyle": "round,pad=0.45", "facecolor": COLOURS[_kind(found[0])], "edgecolor": "#666666"}
        place = columns[box, rows[box]], rows[box]
        texts[box] = axes.text(
            *place, _text(box, found), ha="center", va="center", size=7.5, bbox=style, parse_math=False
        )
    figure.draw_without_rendering()  # places the boxes, so that arrows can end at their edges
    for box, above in parents.items():
        ends = {parent: columns[parent, rows[box] - 1] for parent in above}
        for index, parent in enumerate(sorted(ends, key=lambda each: ends[each])):
            passed = [(columns[parent, row], float(row)) for row in range(rows[parent] + 1, rows[box])]
            _draw_arrow(axes, texts[parent], passed, texts[box], (index + 1) / (len(ends) + 1))
    return figure


def _draw_arrow(axes: Axes, source: Text, passed: Sequence[Point], target: Text, share: float) -> None:
    """Draw an arrow from the lower edge of a box to the upper edge of another, at a share of its width.

    In the rows that it passes it runs straight down, and bends between them, so that it crosses no box.
    """
    (left, lower, right, _), (start, _, end, upper) = _edges(axes, source), _edges(axes, target)
    stops = [((left + right) / 2, lower)]
    for column, row in passed:
        stops += [(column, row - 0.3), (column, row + 0.3)]
    stops.append((start + share * (end - start), upper))
    vertices, codes = [stops[0]], [Curve.MOVETO]
    for (x, y), (to_x, to_y) in pairwise(stops):
        middle = (y + to_y) / 2
        vertices += [(x, middle), (to_x, middle), (to_x, to_y)]
        codes += [Curve.CURVE4] * 3
    axes.add_patch(
        FancyArrowPatch(
            path=Curve(vertices, codes), arrowstyle="-|>", mutation_scale=9, color="#888888", linewidth=0.9, zorder=1
        )
    )


def _edges(axes: Axes, text: Text) -> tuple[float, float, float, float]:
    """Return left, lower, right and upper edge of a text's box, in columns and rows."""
    box = text.get_bbox_patch()
    if box is None:
        raise ValueError("the text has no box")
    (left, lower), (right, upper) = axes.transData.inverted().transform(box.get_window_extent().get_points())
    return left, lower, right, upper


def _group(each: Ancestor, scene: str) -> str:
    """Return the scene of a product, `training split`, or `training scenes` for any of these."""
    return each.scene if each.entry is None or each.scene in (scene, "training split") else "training scenes"


def _parents(found: Sequence[Ancestor], box_of: Mapping[tuple[str, str], Box]) -> list[Box]:
    return [box_of[name, digest] for each in found for name, digests in each.inputs.items() for digest in digests]


def _rows(parents: Mapping[Box, Sequence[Box]]) -> dict[Box, int]:
    """Return the row of each box: below all it is made from; what is made from nothing is just above its first use."""
    rows: dict[Box, int] = {}

    def row(box: Box) -> int:
        if box not in rows:
            rows[box] = 1 + max(map(row, parents[box]), default=-1)
        return rows[box]

    children = _inverted(parents)
    for box in parents:
        row(box)
    firsts = {box: min((rows[child] for child in children[box]), default=1) for box in parents if not parents[box]}
    return rows | {box: first - 1 for box, first in firsts.items()}


def _columns(parents: Mapping[Box, Sequence[Box]], rows: Mapping[Box, int]) -> dict[Stop, float]:
    """Return the column of each box and of each line in the rows that it passes, ordered so that few lines cross."""
    children = _inverted(parents)
    below: dict[Stop, list[Stop]] = {}
    for box in parents:
        last = max((rows[child] for child in children[box]), default=rows[box] + 1)
        for row in range(rows[box], last):
            going_on = [(box, row + 1)] if row + 1 < last else []
            below[box, row] = going_on + [(child, row + 1) for child in children[box] if rows[child] == row + 1]
    above = _inverted(below)
    levels = [[stop for stop in below if stop[1] == row] for row in range(1 + max(rows.values()))]
    columns = {stop: float(index) for level in levels for index, stop in enumerate(level)}
    for _ in range(SWEEPS):
        for order, neighbours in ((levels, above), (levels[::-1], below)):
            for level in order:
                wanted = {
                    stop: _mean([columns[each] for each in neighbours[stop]] or [columns[stop]]) for stop in level
                }
                level.sort(key=lambda stop: wanted[stop])
                widths = [1.0 if rows[box] == row else LINE_WIDTH for box, row in level]
                columns |= zip(level, _apart([wanted[stop] for stop in level], widths), strict=True)
    return columns


def _apart(wanted: Sequence[float], widths: Sequence[float]) -> list[float]:
    """Return places for things of given widths, side by side, nearest to the places wanted in least squares.

    What is too close forms a group, which stands where its members want to be in the mean.

    >>> _apart([0.0, 0.0, 5.0], [1.0, 1.0, 1.0])
    [-0.5, 0.5, 5.0]
    """
    offsets = [sum(widths[:index]) + width / 2 for index, width in enumerate(widths)]
    groups: list[list[float]] = []
    for place, offset in zip(wanted, offsets, strict=True):
        groups.append([place - offset])
        while len(groups) > 1 and _mean(groups[-2]) > _mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    starts = [_mean(group) for group in groups for _ in group]
    return [start + offset for start, offset in zip(starts, offsets, strict=True)]


def _inverted(links: Mapping[T, Sequence[T]]) -> dict[T, list[T]]:
    """Return who links to each."""
    found: dict[T, list[T]] = {each: [] for each in links}
    for each, others in links.items():
        for other in others:
            found[other].append(each)
    return found


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _kind(each: Ancestor) -> str:
    if each.entry is None:
        return "gone"
    if each.product.endswith("_net"):
        return "net"
    return "product" if each.inputs else "origin"


def _text(box: Box, found: Sequence[Ancestor]) -> str:
    product, scene = box
    each = found[0]
    title = f"{product} x {len(found)}" if len(found) > 1 else product
    if each.entry is None:
        return f"{title}\ndeleted since\n{short(each.digest)}"
    origin = "".join(f"\n{name} {short(value)}" for name, value in each.origins.items() if name != "reader")
    code = f"\ncode {short(code_hash_of(each.entry.recipe.code))}"
    key = "" if len(found) > 1 else f"\n{short(each.entry.key)}"
    return f"{title}\n{scene}{_settings(each.entry.recipe.params)}{key}{origin if len(found) == 1 else ''}{code}"


def _settings(params: Mapping[str, object]) -> str:
    """Return the settings of a product as lines of a box: as many as fit; what is read has none."""
    given = {name: value for name, value in params.items() if name not in _NO_SETTINGS and value is not None}
    told = [f"{name} {value_text(value)}" for name, value in given.items()]
    lines = wrap(", ".join(told), _LETTERS, max_lines=_LINES, placeholder=" ...")
    return "".join(f"\n{line}" for line in lines)
