"""Errors beside OpenCV's SGBM at the same density, on any dataset with ground truth.

    python -m benchmarks.against_sgbm DATASET [--scene NAME]... [--R 0.9] [--set K=V]... [--cache DIR] [--json FILE]

A line a scene: density and error of reported pixels (> 1 px, mask nonocc) of SGBM; the same of this project at R, and
at SGBM's density, by its most confident pixels. Both search the scene's own range. SGBM: 8 paths, left-right check
1 px, uniqueness 10. Densities are shares of the mask.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from datasets import SceneSource, Truth, open_dataset
from pipeline.api import Result, Task, run
from stages.filtering import keep_confident, threshold_for
from stages.transforms.gray import to_gray

THRESHOLD = 1.0
_BLOCK = 5
_FIGURES = ("density", "bad")


def sgbm(scene: SceneSource) -> NDArray[np.float32]:
    """Return SGBM's disparities of a scene: (y, x) float32, px, NaN where it reports none."""
    left, right = (to_gray(view) for view in scene.load_images())
    return sgbm_map(left, right, range(scene.disparities.minimum, scene.disparities.maximum + 1))


def sgbm_map(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float32]:
    """Return SGBM's disparities: (y, x) float32, px, NaN where it reports none."""
    import cv2

    low = disparities[0]
    count = -(-len(disparities) // 16) * 16
    matcher = cv2.StereoSGBM.create(
        minDisparity=low,
        numDisparities=count,
        blockSize=_BLOCK,
        P1=8 * _BLOCK**2,
        P2=32 * _BLOCK**2,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    # Without room on the left, OpenCV matches none of the first columns.
    room = max(0, low + count)
    padded = (cv2.copyMakeBorder(view, 0, 0, room, 0, cv2.BORDER_REPLICATE) for view in (left, right))
    found = matcher.compute(*padded)[:, room:].astype(np.float32) / 16
    return np.where(found < low, np.float32(np.nan), found)


def figures(disparity: NDArray[np.float32], truth: Truth) -> dict[str, float]:
    """Return density and error of reported pixels, % of the mask and of what is reported; NaN if nothing is."""
    kept = np.isfinite(disparity) & truth.nonocc
    wrong = np.abs(disparity - truth.disparity)[kept] > THRESHOLD
    bad = 100 * float(wrong.mean()) if wrong.size else float("nan")
    return {"density": 100 * float(kept.sum() / truth.nonocc.sum()), "bad": bad}


def compare(scene: SceneSource, result: Result, R: float) -> dict[str, Any]:
    """Return the figures of one scene for SGBM, for this project at R, and at SGBM's density."""
    truth = scene.load_truth()
    if truth is None or not truth.nonocc.any():
        raise typer.BadParameter(f"{scene.name} has no ground truth")
    raw = result.open("disparity", scene.name)["disparity"].values
    confidence = result.open("confidence", scene.name)["confidence"].values
    other = figures(sgbm(scene), truth)
    counted = np.where(truth.nonocc, raw, np.float32(np.nan))[truth.nonocc]
    equal = threshold_for(other["density"] / 100, counted, confidence[truth.nonocc])
    return {
        "scene": scene.name,
        "sgbm": other,
        "at_R": figures(keep_confident(raw, confidence, R), truth),
        "at_equal_density": figures(keep_confident(raw, confidence, equal), truth) | {"R": equal},
    }


def main(
    dataset: str,
    scene: Annotated[list[str] | None, typer.Option()] = None,
    threshold: Annotated[float, typer.Option("--R")] = 0.9,
    settings: Annotated[list[str] | None, typer.Option("--set")] = None,
    cache: Annotated[Path | None, typer.Option()] = None,
    json_file: Annotated[Path | None, typer.Option("--json")] = None,
) -> None:
    """Print the table; every product comes from the cache, or is made once."""
    task = Task(dataset, tuple(scene or ()), tuple(settings or ()), cache=cache)
    result = run(task, "confidence")
    whole = open_dataset(dataset)
    scenes = (whole.select(scene) if scene else whole).scenes
    rows = [compare(each, result, threshold) for each in scenes if each.has_truth]
    kinds = ("sgbm", "at_R", "at_equal_density")
    means = {kind: {name: float(np.nanmean([row[kind][name] for row in rows])) for name in _FIGURES} for kind in kinds}
    table = Table("scene", *(f"{kind} {name} %" for kind in kinds for name in _FIGURES), box=None)
    for row in [*rows, {"scene": f"mean of {len(rows)}", **means}]:
        table.add_row(row["scene"], *(f"{row[kind][name]:.1f}" for kind in kinds for name in _FIGURES))
    Console(width=160).print(table)
    if json_file:
        json_file.write_text(json.dumps({"name": "against_sgbm", "figures": {"scenes": rows, "mean": means}}, indent=2))


if __name__ == "__main__":
    typer.run(main)
