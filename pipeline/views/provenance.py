"""Draw what a product was made from: a box a product, images and weights at the top, the product at the bottom."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from cache import code_hash_of
from pipeline.ancestry import Ancestor
from pipeline.errors import UsageError

WIDTH, HEIGHT = 2.5, 1.25
"""Inches of a box with the space around it."""
PIXELS, POINTS = 150, 72
"""Units an inch: of a PNG, and of SVG and PDF, which are drawn in points."""
FORMATS = (".svg", ".png", ".pdf")
COLOURS = {"origin": "#dceefb", "net": "#fdeccb", "product": "#f4f4f4", "gone": "#f8d7da"}
"""What is read, trained networks and weights, what is computed, what was deleted since."""

Place = tuple[int, float]
"""Row and column."""
Box = tuple[str, str]
"""Product and scene; products of several training scenes share a box."""


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
    places = _places(parents)
    rows, columns = (1 + max(place[axis] for place in places.values()) for axis in (0, 1))
    figure = Figure(figsize=(max(4.0, columns * WIDTH), rows * HEIGHT + 0.3), dpi=dpi)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.4, -0.6))
    axes.axis("off")
    texts = {}
    for box, found in members.items():
        row, column = places[box]
        style = {"boxstyle": "round,pad=0.45", "facecolor": COLOURS[_kind(found[0])], "edgecolor": "#666666"}
        texts[box] = axes.text(
            column, row, _text(box, found), ha="center", va="center", size=7.5, bbox=style, parse_math=False
        )
    figure.draw_without_rendering()  # places the boxes, so that arrows can lie behind them and end at their edges
    for box, above in parents.items():
        for parent in above:
            _draw_arrow(axes, (texts[parent], places[parent]), (texts[box], places[box]))
    return figure


def _draw_arrow(axes: Axes, start: tuple[Text, Place], end: tuple[Text, Place]) -> None:
    """Draw an arrow from box to box; one that passes rows between them goes around what stands there."""
    (source, (top, left)), (target, (row, column)) = start, end
    bend = 0.0 if row - top < 2 or left != column else -0.5
    style = {
        "arrowstyle": "-|>",
        "color": "#888888",
        "linewidth": 0.9,
        "connectionstyle": f"arc3,rad={bend}",
        "patchA": source.get_bbox_patch(),
        "patchB": target.get_bbox_patch(),
        "shrinkA": 0,
        "shrinkB": 1,
    }
    axes.annotate("", xy=(column, row), xytext=(left, top), arrowprops=style, zorder=1)


def _group(each: Ancestor, scene: str) -> str:
    """Return whose product it is: the scene's, the training split's, or one of the training scenes'."""
    return each.scene if each.entry is None or each.scene in (scene, "training split") else "training scenes"


def _parents(found: Sequence[Ancestor], box_of: Mapping[tuple[str, str], Box]) -> list[Box]:
    return [box_of[name, digest] for each in found for name, digests in each.inputs.items() for digest in digests]


def _places(parents: Mapping[Box, Sequence[Box]]) -> dict[Box, Place]:
    """Return row and column of each box: below all it is made from, rows centred."""
    rows: dict[Box, int] = {}

    def row(box: Box) -> int:
        if box not in rows:
            rows[box] = 1 + max(map(row, parents[box]), default=-1)
        return rows[box]

    levels: dict[int, list[Box]] = {}
    for box in parents:
        levels.setdefault(row(box), []).append(box)
    widest = max(len(level) for level in levels.values())
    places: dict[Box, Place] = {}
    for number, level in sorted(levels.items()):
        in_order = sorted(level, key=lambda box: _mean([places[each][1] for each in parents[box]]))
        for index, box in enumerate(in_order):
            places[box] = (number, index + (widest - len(level)) / 2)
    return places


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0


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
        return f"{title}\ndeleted since\n{each.digest[:12]}"
    origin = "".join(f"\n{name} {value[:8]}" for name, value in each.origins.items() if name != "reader")
    code = f"\ncode {code_hash_of(each.entry.recipe.code)[:8]}"
    key = "" if len(found) > 1 else f"\n{each.entry.key[:12]}"
    return f"{title}\n{scene}{key}{origin if len(found) == 1 else ''}{code}"
