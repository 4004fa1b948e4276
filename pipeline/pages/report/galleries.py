"""The pictures of a scene side by side, which zoom and move together."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import disparity_span
from semidense.pipeline.pages.html import Html, tag, text
from semidense.pipeline.pages.report.pictures import (
    Picture,
    confidence_picture,
    disparity_picture,
    error_picture,
    percent,
    photo,
)
from semidense.pipeline.pages.scene_maps import SceneMaps
from semidense.pipeline.results.metric_rows import MASK, THRESHOLD, Row
from semidense.pipeline.results.settings import filter_text
from semidense.stages.evaluation.filtering import SemidenseParams, keep_confident

_USUAL = (0.5, 0.7)
"""The thresholds R that every scene is shown at, beside the filter of the configuration."""


def gallery(name: str, maps: SceneMaps, filtering: SemidenseParams, rows: Sequence[Row]) -> Html:
    """Return the pictures of a scene: view, truth, raw map, its error, confidence, and filtered maps.

    Args:
        name: of the scene.
        maps: its maps.
        filtering: what the configuration keeps of a map; its result is the last picture.
        rows: the metrics rows of that result; empty if they are not cached.
    """
    height, width = maps.size
    shown = f", every {maps.step}. row and column shown" if maps.step > 1 else ""
    mask = f"; mask nonocc: {maps.mask_kind}" if maps.mask_kind else ""
    about = tag("p", text(f"{width} x {height} px{shown}{mask}"), class_="quiet about")
    ratio = f"--ratio: {width} / {height}"
    figures = [_figure(picture, ratio) for picture in _pictures(maps, filtering, rows)]
    grid = tag("div", *figures, class_="gallery")
    return tag("section", tag("h3", text(name)), about, _zoom(name), grid, class_="scene", data_scene=name)


def _zoom(name: str) -> Html:
    label = tag(
        "label", text("zoom "), '<input type="range" min="1" max="8" step="0.5" value="1">', "<output>1x</output>"
    )
    hint = tag("span", text("move with the arrow keys, by dragging or scrolling; all pictures follow"), class_="quiet")
    return tag("div", label, hint, class_="zoom", hidden="hidden", aria_label=f"zoom of {name}", role="group")


def _figure(picture: Picture, ratio: str) -> Html:
    image = tag("img", src=picture.source, alt="", decoding="sync").removesuffix("</img>")
    frame = tag("div", image, class_="frame", style=ratio, tabindex=0, role="img", aria_label=picture.title)
    return tag("figure", tag("figcaption", text(picture.title)), frame, tag("div", picture.legend, class_="legend"))


def _pictures(maps: SceneMaps, filtering: SemidenseParams, rows: Sequence[Row]) -> Iterator[Picture]:
    if maps.left is not None:
        yield photo("left image", maps.left)
    span = _span(maps)
    if maps.truth is not None:
        yield disparity_picture("ground truth (disparity)", maps.truth, span, "unknown")
    if maps.disparity is None:
        return
    yield disparity_picture("raw disparity, before filtering", maps.disparity, span, "none")
    error = maps.error()
    if error is not None and maps.truth is not None and maps.nonocc is not None:
        yield error_picture("error of the raw disparity", error, maps.truth, maps.nonocc)
    if maps.confidence is None:
        return
    yield confidence_picture("confidence", maps.confidence)
    by_tally = filtering.by_R and not filtering.calibrated
    judged = [row for row in rows if (row["mask"], row["threshold_px"]) == (MASK, THRESHOLD)]
    for R in sorted({*_USUAL, filtering.R} if by_tally else _USUAL):
        kept = keep_confident(maps.disparity, maps.confidence, R)
        row = _at(R, maps.tally.rows("", MASK, THRESHOLD) if maps.tally else ()) or _at(R, judged)
        yield _filtered(f"R = {R:g}", kept, span, row)
    if not by_tally and maps.kept is not None:
        yield _filtered(filter_text(filtering), maps.kept, span, judged[0] if judged else None)


def _at(R: float, rows: Sequence[Row]) -> Row | None:
    return next((row for row in rows if row.get("R") == R), None)


def _span(maps: SceneMaps) -> tuple[float, float]:
    """Return the disparities of the first and last colour, px: the same for truth, raw and filtered maps."""
    known = [each.ravel() for each in (maps.disparity, maps.truth) if each is not None]
    return disparity_span(np.concatenate(known)) if known else (0, 1)


def _filtered(how: str, kept: NDArray[np.float32], span: tuple[float, float], row: Row | None) -> Picture:
    """Return a filtered map, with the share that is kept and, where ``row`` tells it, its error."""
    picture = disparity_picture(f"kept at {how}", kept, span, "not kept")
    return replace(picture, legend=picture.legend + tag("span", text(_told(kept, row))))


def _told(kept: NDArray[np.float32], row: Row | None) -> str:
    if row is None:
        return f"kept: {percent(np.isfinite(kept))} of all pixels"
    wrong = f"; {row['bad']:.1f} % of these are off by more than {THRESHOLD:g} px" if "bad" in row else ""
    return f"kept: {100 - row['invalid']:.1f} % of the {MASK} pixels{wrong}"
