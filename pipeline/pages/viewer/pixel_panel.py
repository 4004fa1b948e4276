"""Show a pixel: its cost curve, and the patches that the two networks see."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.pages.html import tag, text
from semidense.pipeline.pages.viewer.models import NO_PIXEL, Panels, Sources
from semidense.pipeline.pages.viewer.panels import MARKS
from semidense.pipeline.pages.viewer.pixel import CostCurve, evaluation_patch, matching_patches
from semidense.stages.evaluation.declaration import PATCH as EVALUATION_PATCH
from semidense.stages.matching.declaration import PATCH as MATCHING_PATCH

_GAP, _HEAD = 2, 8.0
"""Space between patches and above them, px of the patches."""


def clear_pixel(panels: Panels) -> None:
    """Show no pixel."""
    for chart in (panels.costs_box, panels.patches, panels.seen):
        chart.visible = False
    panels.pixel.text = text(NO_PIXEL)


def show_costs(sources: Sources, panels: Panels, curve: CostCurve, truth: float) -> None:
    """Show the costs of a pixel with the winner, the runner-up and the truth marked."""
    found = [
        (place, name) for place, name in ((curve.winner, "winner"), (curve.runner_up, "runner-up")) if place is not None
    ]
    places = [place for place, _ in found]
    sources.curve.data = {"d": curve.disparities, "cost": curve.costs}
    sources.marks.data = {
        "d": curve.disparities[places],
        "cost": curve.costs[places],
        "marker": [MARKS[name][0] for _, name in found],
        "colour": [MARKS[name][1] for _, name in found],
    }
    panels.costs_box.visible = True
    panels.true.update(visible=bool(np.isfinite(truth)), location=truth if np.isfinite(truth) else 0)


def show_patches(
    sources: Sources,
    panels: Panels,
    channels: Any,  # noqa: ANN401
    use: list[str],
    pixel: tuple[int, int],
    values: Mapping[str, float],
) -> None:
    """Show the patches of a pixel in all channels: left, right at the raw disparity, right at the truth."""
    y, x = pixel
    rows: list[tuple[str, NDArray[np.float32]]] = []
    for name, what in (("disparity", "right at the winner"), ("truth", "right at the truth")):
        disparity = values.get(name, np.nan)
        if np.isfinite(disparity):
            left, right = matching_patches(channels, y, x, disparity)
            rows = rows or [("left", left)]
            rows.append((f"{what}, {disparity:.2f} px", right))
    panels.patches.visible = bool(rows)
    placed = [(row, column) for row in range(len(rows)) for column in range(len(use))]
    low, high = _spans([patch for _, patch in rows])
    sources.patches.data = {
        "patch": [_unit(rows[row][1][column], low[column], high[column]) for row, column in placed],
        **_places(placed, MATCHING_PATCH),
        "label": [f"{rows[row][0] if column == 0 else ''}\n{use[column]}" for row, column in placed],
    }


def _spans(patches: list[NDArray[np.float32]]) -> tuple[list[float], list[float]]:
    """Return the least and the largest value of each channel over all patches."""
    if not patches:
        return [], []
    every = np.stack(patches)
    return every.min(axis=(0, 2, 3)).tolist(), every.max(axis=(0, 2, 3)).tolist()


def _unit(patch: NDArray[Any], low: float, high: float) -> NDArray[np.float32]:
    return ((patch - low) / max(high - low, 1e-6)).astype(np.float32)


def _places(placed: list[tuple[int, int]], side: int) -> dict[str, list[float]]:
    """Return where patches lie in their chart, and the frame around the pixel in their middle."""
    rows, columns = [[pair[axis] for pair in placed] for axis in (0, 1)]
    x = [float(column * (side + _GAP)) for column in columns]
    y = [row * (side + _HEAD) + _HEAD for row in rows]
    count = len(placed)
    middle = {"mx": [each + side / 2 for each in x], "my": [each + side / 2 for each in y]}
    return {"x": x, "y": y, "dw": [float(side)] * count, "dh": [float(side)] * count, **middle, "side": [1.0] * count}


def show_evaluation(
    sources: Sources,
    panels: Panels,
    left: Any,  # noqa: ANN401
    disparity: Any,  # noqa: ANN401
    pixel: tuple[int, int],
) -> None:
    """Show the gray levels and the raw disparities around a pixel that its confidence was made from."""
    gray, seen = evaluation_patch(left, disparity, *pixel)
    side = float(EVALUATION_PATCH)
    panels.seen.visible = True
    for source, column, patch, x, label in (
        (
            sources.gray,
            "gray",
            (gray / 255).astype(np.float32),
            0.0,
            f"left view, gray, {EVALUATION_PATCH} x {EVALUATION_PATCH} px",
        ),
        (sources.seen, "disparity", seen, side + 6, "raw disparity, same place"),
    ):
        place = {"x": [x], "y": [10.0], "dw": [side], "dh": [side], "mx": [x + side / 2], "my": [10 + side / 2]}
        source.data = {column: [patch], **place, "side": [5.0], "label": [label]}


def told_pixel(pixel: tuple[int, int], values: Mapping[str, float], curve: CostCurve | None) -> str:
    """Return disparity, confidence and truth of a pixel as a sentence."""
    y, x = pixel
    parts = [f"y = {y}, x = {x}"]
    raw, truth = values.get("disparity", np.nan), values.get("truth", np.nan)
    parts.append(f"raw disparity {raw:.2f} px" if np.isfinite(raw) else "no raw disparity")
    if "truth" in values:
        parts.append(f"truth {truth:.2f} px" if np.isfinite(truth) else "truth unknown")
    if np.isfinite(raw) and np.isfinite(truth):
        parts.append(f"error {abs(raw - truth):.2f} px")
    if "confidence" in values:
        parts.append(f"confidence {values['confidence']:.3f}")
    if curve and curve.winner is not None and curve.runner_up is not None:
        margin = curve.costs[curve.runner_up] - curve.costs[curve.winner]
        parts.append(f"runner-up at {curve.disparities[curve.runner_up]} px, {margin:.2f} above the winner")
    return tag("p", text("; ".join(parts)))
