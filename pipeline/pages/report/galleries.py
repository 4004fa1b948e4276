"""The pictures of a scene side by side, which zoom and move together."""

from collections.abc import Iterator
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
from semidense.pipeline.results.metric_rows import MASK, THRESHOLD
from semidense.stages.evaluation.filtering import keep_confident
from semidense.stages.metrics.tally import Tally


def gallery(name: str, maps: SceneMaps, thresholds: tuple[float, ...]) -> Html:
    """Return the pictures of a scene: view, truth, raw map, its error, confidence, and the filtered map at each R."""
    height, width = maps.size
    shown = f", every {maps.step}. row and column shown" if maps.step > 1 else ""
    mask = f"; mask nonocc: {maps.mask_kind}" if maps.mask_kind else ""
    about = tag("p", text(f"{width} x {height} px{shown}{mask}"), class_="quiet about")
    ratio = f"aspect-ratio: {width} / {height}"
    figures = [_figure(picture, ratio) for picture in _pictures(maps, thresholds)]
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


def _pictures(maps: SceneMaps, thresholds: tuple[float, ...]) -> Iterator[Picture]:
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
    for R in thresholds:
        kept = keep_confident(maps.disparity, maps.confidence, R)
        picture = disparity_picture(f"kept at R = {R:g}", kept, span, "not kept")
        yield replace(picture, legend=picture.legend + _told(maps.tally, R, kept))


def _span(maps: SceneMaps) -> tuple[float, float]:
    """Return the disparities of the first and last colour, px: the same for truth, raw and filtered maps."""
    known = [each.ravel() for each in (maps.disparity, maps.truth) if each is not None]
    return disparity_span(np.concatenate(known)) if known else (0, 1)


def _told(tally: Tally | None, R: float, kept: NDArray[np.float32]) -> Html:
    """Return the caption of a filtered map: the share that is kept and, where the truth is known, its error."""
    rows = [row for row in tally.rows("", MASK, THRESHOLD) if row["R"] == R] if tally else []
    if not rows:
        return tag("span", text(f"kept: {percent(np.isfinite(kept))} of all pixels"))
    share = f"kept: {100 - rows[0]['invalid']:.1f} % of the {MASK} pixels"
    wrong = f"; {rows[0]['bad']:.1f} % of these are off by more than {THRESHOLD:g} px" if "bad" in rows[0] else ""
    return tag("span", text(share + wrong))
