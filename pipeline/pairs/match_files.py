"""Write what a matched pair gives into a folder: all of it, or nothing.

::

    FOLDER/
        summary.json            parameters, versions, timings, density, warnings, and what each file holds
        disparity.*             the map: .pfm (none: infinity), .png (KITTI's 16 bits, none: 0), .tif, .npy (none: NaN)
        disparity-colour.png    the same as a picture with a legend
        disparity_raw.*         the map before anything was dropped or refined, and disparity_raw-colour.png
        confidence.*            the same formats, and confidence-colour.png
        depth.*                 with a calibration: metres (16-bit PNG: millimetres)
        points.ply              with a calibration: the coloured points, right side up
        right_disparity.*       if asked for: the right view's raw map
        guessed.png             if holes were filled: white where
        survey.png              if the views do not fit together: where

The files are made in a hidden folder beside their place and moved when all of them are there. Files of an earlier match
are replaced or deleted. The pair's own files, and files that ``summary.json`` does not name, are refused.
"""

import json
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import SceneSource
from semidense.datasets.formats.ply import write_ply
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.files.file_names import safe_names
from semidense.pipeline.files.map_files import (
    CONFIDENCE,
    DEPTH,
    DISPARITY,
    ENDINGS,
    FORMATS,
    RAW_DISPARITY,
    RIGHT_DISPARITY,
    Png16Error,
    Quantity,
    write_map,
)
from semidense.pipeline.files.map_pictures import confidence_picture, disparity_picture
from semidense.pipeline.files.publishing import publishing, refuse_foreign
from semidense.pipeline.files.writing import require_writable, write_rgb
from semidense.pipeline.pairs.match import Match
from semidense.pipeline.results.opening import open_product
from semidense.stages.evaluation.calibration.table import told

_Map = NDArray[np.float32]
_SUMMARY = "summary.json"
_QUANTITIES = (DISPARITY, RAW_DISPARITY, CONFIDENCE, DEPTH, RIGHT_DISPARITY)
_PICTURES = {
    "disparity-colour.png",
    "disparity_raw-colour.png",
    "confidence-colour.png",
    "guessed.png",
    "survey.png",
    "points.ply",
}
"""What is written beside the maps."""
_ALL = {f"{each.name}.{ending}" for each in _QUANTITIES for ending in ENDINGS.values()} | _PICTURES
_POINTS = "x right, y up, z towards the viewer; metres, from the left camera"


def save_all(matches: Sequence[Match], folder: Path, formats: Sequence[str] = FORMATS) -> list[dict[str, Any]]:
    """Write pairs: a single one into the folder itself, several into a folder each, named by the pair.

    Returns:
        The summaries, as ``summary.json`` holds them.

    Raises:
        UsageError: if the folder cannot be written, or holds a file of somebody else that would be replaced; nothing
            of a pair that could not be written whole is left.
        CacheError: if a result is no longer in the cache.
    """
    places = _places([match.scene for match in matches], folder)
    return [save(match, places[match.scene.name], formats) for match in matches]


def _places(scenes: Sequence[SceneSource], folder: Path) -> dict[str, Path]:
    names = safe_names(scene.name for scene in scenes)
    return {name: folder if len(scenes) == 1 else folder / safe for name, safe in names.items()}


def require_place(scenes: Sequence[SceneSource], folder: Path, formats: Sequence[str] = FORMATS) -> None:
    """Refuse a folder that cannot be written, without making it: matching takes long.

    Raises:
        UsageError: if it, or the nearest folder above it that there is, is a file or closed to this user; or if a file
            of the pair, or of somebody else, would be replaced.
    """
    require_writable(folder)
    inputs = [path for scene in scenes for path in scene.files.values()]
    endings = {ENDINGS[kind] for kind in formats}
    maps = {f"{each.name}.{ending}" for each in _QUANTITIES for ending in endings}
    for each in _places(scenes, folder).values():
        refuse_foreign(each, _SUMMARY, maps | _PICTURES | {_SUMMARY}, inputs)


def save(match: Match, folder: Path, formats: Sequence[str] = FORMATS) -> dict[str, Any]:
    """Write one pair; as `save_all`."""
    with publishing(folder, _SUMMARY, match.scene.files.values(), _ALL) as draft:
        writer = _Writer(match, draft, formats)
        writer.write_maps()
        writer.write_pictures()
        writer.write_points()
        summary = writer.write_summary()
    return summary | {"folder": str(folder)}


@dataclass
class _Writer:
    """The files of one pair, written so far."""

    match: Match
    folder: Path
    formats: Sequence[str]
    files: list[dict[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def write_maps(self) -> None:
        """Write every map of numbers in every format, some at a time: packing them takes longest."""
        with ThreadPoolExecutor() as pool:
            for made in pool.map(self._write, *zip(*self._maps(), strict=True)):
                if isinstance(made, str):
                    self.notes.append(made)
                else:
                    self.files.append(made)

    def _maps(self) -> Iterable[tuple[Quantity, _Map, str]]:
        match = self.match
        maps = [(DISPARITY, match.disparity), (RAW_DISPARITY, match.raw), (CONFIDENCE, match.confidence)]
        maps += [(DEPTH, match.depth)] if match.scene.calibration else []
        maps += [(RIGHT_DISPARITY, match.right_disparity)] if match.wishes.right_view else []
        return [(*each, kind) for each in maps for kind in self.formats]

    def _write(self, quantity: Quantity, values: _Map, kind: str) -> dict[str, str] | str:
        """Write one file and return its entry in the summary; a note if the format cannot hold the values."""
        try:
            name, about = write_map(values, quantity, kind, self.folder)
        except Png16Error as error:
            return f"{quantity.name}.png was not written: {str(error).partition(': ')[2]}"
        return {"file": name, **about}

    def write_pictures(self) -> None:
        """Write what is for the eye."""
        with ThreadPoolExecutor() as pool:
            self.files += pool.map(self._draw, (DISPARITY, RAW_DISPARITY, CONFIDENCE))
        if self.match.wishes.fill:
            self._write_guessed()
        if self.match.misfits:
            self._draw_survey()

    def _draw(self, quantity: Quantity) -> dict[str, str]:
        match = self.match
        values = {DISPARITY: match.disparity, RAW_DISPARITY: match.raw, CONFIDENCE: match.confidence}[quantity]
        draw = confidence_picture if quantity is CONFIDENCE else disparity_picture
        name = f"{quantity.name}-colour.png"
        unit = "" if quantity.unit == "1" else f" ({quantity.unit})"
        write_rgb(draw(values, f"{match.scene.name}: {quantity.about}{unit}"), self.folder / name)
        return {"file": name, "quantity": f"picture of {quantity.name}, with a legend", "reference view": "left"}

    def _write_guessed(self) -> None:
        white = self.match.guessed.astype(np.uint8)[..., np.newaxis].repeat(3, axis=2) * 255
        write_rgb(white, self.folder / "guessed.png")
        self.files.append({"file": "guessed.png", "quantity": "white: filled in, a guess", "reference view": "left"})

    def _draw_survey(self) -> None:
        from semidense.pipeline.figures.figure import figure, product_title
        from semidense.pipeline.files.writing import save_png

        dataset = open_product(self.match.result.store, self.match.made("survey").key)
        save_png(figure("survey", dataset, title=product_title(dataset)), self.folder / "survey.png")
        self.files.append(
            {"file": "survey.png", "quantity": "picture of survey, with a legend", "reference view": "left"}
        )

    def write_points(self) -> None:
        """Write the cloud, if there is a calibration."""
        if self.match.scene.calibration:
            write_ply(self.folder / "points.ply", *self.match.points(), [_POINTS])
            self.files.append(
                {"file": "points.ply", "quantity": f"points: {_POINTS}", "unit": "m", "reference view": "left"}
            )

    def write_summary(self) -> dict[str, Any]:
        """Write and return the summary."""
        notes = [*_calibration_notes(self.match), *self.notes]
        about = summary(self.match) | {"notes": notes, "files": self.files}
        (self.folder / _SUMMARY).write_text(json.dumps(about, indent=2, allow_nan=False) + "\n")
        return about


def _basis(match: Match) -> dict[str, Any]:
    """Return where R comes from; for a wanted error, what to expect and what it came to in training scenes."""
    if match.filtered_by.get("max_error") is None:
        own = "from the pair's own confidences, for the density asked for"
        return {"R_from": "as set" if match.filtered_by.get("density") is None else own}
    expected = match.expected_error
    words = "no pixel is sure enough for that error" if expected is None else f"R = {told(match.R)}"
    basis = match.basis.words if match.basis else "by the confidences of the kept pixels"
    return {
        "R_from": "for the error asked for",
        "R_basis": f"{words}; {basis}",
        "expected_error_percent": None if expected is None else 100 * expected,
    }


def _calibration_notes(match: Match) -> list[str]:
    """Say so if the calibration was measured with other cost volumes than those of the match."""
    made = {each.step.product: each.step for each in match.result.made.values()}
    if not {"costvolume", "calibration"} <= made.keys():
        return []
    mode, shipped = made["costvolume"].settings.get("mode"), getattr(made["calibration"].argument, "name", "")
    if (mode, shipped) != ("fast", "calibration"):
        return []
    return ["the calibration was measured with exact cost volumes, and is used for these fast ones"]


def _given_map(scene: SceneSource) -> dict[str, Any]:
    """Return where the raw map came from and how it was read, if another matcher made it."""
    if not scene.has("disparity"):
        return {}
    return {"map": str(scene.files.get("disparity", "an array")), "map_reading": dict(scene.map_reading)}


def summary(match: Match) -> dict[str, Any]:
    """Return what is to be said of a matched pair, ready for JSON."""
    steps = [each for each in match.result.made.values() if each.step.scene == match.scene.name]
    known = match.scene.calibration
    wishes = match.wishes
    return {
        "pair": match.scene.name,
        "left": str(match.scene.files.get("left", "an array")),
        "right": None if match.scene.one_view else str(match.scene.files.get("right", "an array")),
        **_given_map(match.scene),
        "rows": match.scene.size[0],
        "columns": match.scene.size[1],
        "reference_view": "left",
        "disparities": asdict(match.disparities) | {"estimated": list(match.scene.open_ends)},
        "rows_shifted_px": match.shifts,
        "R": match.R,
        **_basis(match),
        "wishes": asdict(wishes),
        "density_percent": 100 * match.density,
        "guessed_percent": 100 * float(match.guessed.mean()),
        "calibration_mm_px": asdict(known) if known else None,
        "warnings": match.warnings,
        "seconds": {each.step.product: each.seconds for each in steps},
        "reused": [each.step.product for each in steps if each.reused],
        "preset": match.result.preset,
        "configuration": [{"sections": dict(match.made("semidense").step.asked)}],
        "settings": {each.step.product: dict(each.step.settings) for each in steps},
        "keys": {each.step.product: each.key for each in steps},
    } | provenance(sys.argv)
