"""Make the pictures of the documents again: ``python -m tests.system.pictures [DATASET]``.

They are of the bundled Motorcycle pair, in a cache of their own. With a copy of MiddEval3, such as
``middlebury:DIR/MiddEval3/trainingQ``, the figure of other matchers is made too. The two pictures of speed are not:
``make bench`` makes them.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from PIL import Image
from skimage.data import stereo_motorcycle

from tests.conftest import PROJECT
from tests.system.conftest import chromium, serving

ROBUST = ("motorcycle", "--preset", "robust")
SURE = ("--set", "semidense.density=0.6")
TURNED = "pair:photos/left.png,photos/turned.png"
COMMANDS = (
    ("run", *ROBUST, "--output", "results"),
    ("run", "motorcycle", "--mode", "guided"),
    ("run", *ROBUST, *SURE),
    ("run", TURNED, "--preset", "robust", "--upto", "alignment"),
    ("inspect", "alignment", TURNED, "--preset", "robust", "--png", "alignment.png"),
    ("inspect", "confidence", *ROBUST, "--png", "confidence.png"),
    ("inspect", "semidense", *ROBUST, *SURE, "--png", "disparity.png"),
    ("match", "photos/left.png", "photos/right.png", "-o", "matched"),
    ("report", *ROBUST, "-o", "report.html"),
)
COMPARE = ("--preset", "robust", "--experiment", "density", "--without", "mc_cnn_accurate", "-o", "density")
PICTURES = {
    "motorcycle-raw.png": "results/Motorcycle/disparity_raw-colour.png",
    "motorcycle-kept.png": "results/Motorcycle/disparity-colour.png",
    "alignment.png": "alignment.png",
    "confidence.png": "confidence.png",
    "disparity.png": "disparity.png",
    "unrectified.png": "matched/survey.png",
    "report.jpg": "report.jpg",
    "viewer.jpg": "viewer.jpg",
    "comparison-density.png": "density/density.png",
}
"""Each picture of the documents, and the file that it is made of."""
WIDEST = 1280
"""Columns of a picture, at most."""
SCREEN = {"width": 1280, "height": 1000}
CHOSEN = (("configuration", "robust"), ("compare", "paper"))
"""The choices of the viewer, and how what is chosen begins."""
PIXEL = {"y": 250, "x": 300}
WAIT = 3000
"""Milliseconds after which a page has drawn what was chosen."""


def main(
    dataset: Annotated[str | None, typer.Argument(help="MiddEval3, for the figure of other matchers.")] = None,
    output: Annotated[Path, typer.Option(help="Where the pictures go.")] = PROJECT / "docs" / "pictures",
) -> None:
    """Make the pictures, and print the name of each."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_unrectified(folder / "photos")
        for command in COMMANDS:
            run(command, folder)
        with chromium() as browser:  # before the cache holds other scenes: the viewer shows the first one
            photograph_report(browser, folder)
            photograph_viewer(browser, folder)
        if dataset:
            run(("compare", dataset, *COMPARE), folder)
        for name, source in PICTURES.items():
            if (folder / source).exists():
                save_small(folder / source, output / name)
                print(output / name)


def write_unrectified(folder: Path) -> None:
    """Write the Motorcycle pair at half size, its right view 5 px too low, and another one turned by 0.2 degrees."""
    folder.mkdir()
    left, right, _ = stereo_motorcycle()
    half = [np.asarray(Image.fromarray(view).resize((370, 250))) for view in (left, right)]
    Image.fromarray(half[0]).save(folder / "left.png")
    Image.fromarray(np.roll(half[1], 5, axis=0)).save(folder / "right.png")
    Image.fromarray(half[1]).rotate(0.2, Image.Resampling.BICUBIC).save(folder / "turned.png")


def save_small(source: Path, target: Path) -> None:
    """Save a PNG file at a width for pages; copy a JPEG file as it is."""
    if target.suffix == ".jpg":
        shutil.copyfile(source, target)
    else:
        picture = Image.open(source).convert("RGB")
        picture.thumbnail((WIDEST, WIDEST))
        picture.save(target, optimize=True)


def run(command: tuple[str, ...], folder: Path) -> None:
    """Run a command of ``pipeline`` in the folder, with a cache in it."""
    environment = os.environ | {"PIPELINE_CACHE": str(folder / "cache")}
    subprocess.run([sys.executable, "-m", "semidense.pipeline", *command], cwd=folder, env=environment, check=True)


def photograph_report(browser: Any, folder: Path) -> None:  # noqa: ANN401
    """Write ``report.jpg``: the first screen of the report."""
    page = browser.new_page(viewport=SCREEN)
    page.goto((folder / "report.html").as_uri())
    page.screenshot(path=folder / "report.jpg", quality=85)


def photograph_viewer(browser: Any, folder: Path) -> None:  # noqa: ANN401
    """Write ``viewer.jpg``: two configurations, and the costs of a pixel."""
    with serving(folder / "cache") as (address, _):
        page = browser.new_page(viewport=SCREEN)
        page.goto(address)
        page.wait_for_function("window.Bokeh && Bokeh.documents.length && Bokeh.documents[0].is_idle")
        model = "Bokeh.documents[0].get_model_by_name"
        for control, start in CHOSEN:
            option = f"{model}('{control}').options.find((each) => each.startsWith('{start}'))"
            page.wait_for_function(f"{option} !== undefined")  # the choice before it may still be being drawn
            page.evaluate(f"{model}('{control}').value = {option}")
            page.wait_for_timeout(WAIT)
        for control, value in PIXEL.items():
            page.evaluate(f"{model}('{control}').value = {value}")
        page.wait_for_timeout(WAIT)
        page.screenshot(path=folder / "viewer.jpg", quality=85)


if __name__ == "__main__":
    typer.run(main)
