"""What rows 16 and 29 run on a cluster: toy scenes, or in their large form the eight scenes of MiddEval3, reduced."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semidense.cache import Store
from semidense.datasets.formats.pfm import read_pfm, write_pfm
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from tests.faults import world
from tests.faults.runs import slow

PROJECT = Path(__file__).parents[3]
SCENES = 8
FACTOR = 8
"""By how much the eight scenes are reduced in each direction: a run then takes seconds."""


class Work(Protocol):
    """Something to run.

    Attributes:
        name: what its scenes are, for the table.
        scenes: how many.
    """

    @property
    def name(self) -> str: ...

    @property
    def scenes(self) -> int: ...

    def run(self, store: Store, scheduler: str | None = None) -> dict[str, str]:
        """Run on a cluster, or on threads; return the digest of each product by its key."""


@dataclass(frozen=True)
class Toys:
    """Toy stages that take a while."""

    scenes: int = SCENES
    name: str = "toy scenes"

    def run(self, store: Store, scheduler: str | None = None) -> dict[str, str]:
        """See ``Work``."""
        graph = slow.scenes(self.scenes)
        workers = None if scheduler else 16
        made = attempt(lambda: world.plan(store, graph), store, Unwatched(), {}, scheduler, workers)[1]
        return {each.key: each.digest for each in made.values()}


@dataclass(frozen=True)
class Scenes:
    """The whole pipeline over the scenes of a folder."""

    folder: Path
    preset: str = "robust"
    name: str = "scenes of MiddEval3"
    scenes: int = SCENES

    def run(self, store: Store, scheduler: str | None = None) -> dict[str, str]:
        """See ``Work``."""
        task = Task(f"middlebury:{self.folder}", cache=store.root, preset=self.preset)
        made = api.run(task, scheduler=scheduler, workers=None if scheduler else 2).made
        return {each.key: each.digest for each in made.values()}


@contextmanager
def of_scale(scale: float, few: int = SCENES) -> Iterator[Work]:
    """Yield what a form of a row runs: in the large one the eight scenes, reduced, if their data are here.

    Args:
        scale: of the row.
        few: toy scenes of the quick form.
    """
    source = training_set() if scale >= 1 else None
    if source is None:
        yield Toys(SCENES if scale >= 1 else few)
        return
    with world.folder() as root:
        for scene in sorted(source.iterdir()):
            reduce_scene(scene, root.with_name("scenes") / scene.name)
        yield Scenes(root.with_name("scenes"))


def training_set() -> Path | None:
    """Return the folder of the eight scenes; None where it is not."""
    data = Path(os.environ.get("STEREO_DATA", PROJECT.parent / "shared" / "data"))
    found = (data / place / "MiddEval3" / "trainingQ" for place in ("middlebury", ""))
    return next(filter(Path.is_dir, found), None)


def reduce_scene(source: Path, target: Path) -> None:
    """Write a scene with a pixel for each square of ``FACTOR`` pixels: means of colours, one of their disparities."""
    target.mkdir(parents=True)
    for name in ("im0.png", "im1.png"):
        image = _cut(np.asarray(Image.open(source / name), np.float64))
        Image.fromarray(np.rint(image.mean(axis=(1, 3))).astype(np.uint8)).save(target / name)
    mask = _cut(np.asarray(Image.open(source / "mask0nocc.png")))
    Image.fromarray(np.ascontiguousarray(mask[:, 0, :, 0])).save(target / "mask0nocc.png")
    truth = _cut(read_pfm(source / "disp0GT.pfm"))[:, 0, :, 0]
    write_pfm(target / "disp0GT.pfm", np.ascontiguousarray(truth / FACTOR, np.float32))
    text = (source / "calib.txt").read_text()
    (target / "calib.txt").write_text(_reduced_calib(text, *truth.shape[:2]))


def _cut(image: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return whole squares of an image, as rows, rows inside, columns, columns inside, and the rest."""
    height, width = (length // FACTOR for length in image.shape[:2])
    whole = image[: height * FACTOR, : width * FACTOR]
    return whole.reshape(height, FACTOR, width, FACTOR, *image.shape[2:])


def _reduced_calib(text: str, height: int, width: int) -> str:
    """Return a calibration's lines with their lengths in pixels divided."""

    def divided(line: "re.Match[str]") -> str:
        numbers = re.sub(
            r"[\d.]+", lambda number: number[0] if number[0] == "1" else f"{float(number[0]) / FACTOR:g}", line[2]
        )
        return f"{line[1]}={numbers}"

    lines = re.sub(r"^ *(cam\d|doffs) *= *(.*)$", divided, text, flags=re.MULTILINE)
    disparities = -(-int(re.search(r"ndisp *= *(\d+)", text)[1]) // FACTOR)  # type: ignore[index]
    for name, value in (("width", width), ("height", height), ("ndisp", disparities)):
        lines = re.sub(rf"^ *{name} *=.*$", f"{name}={value}", lines, flags=re.MULTILINE)
    return re.sub(r"^ *(vmin|vmax|isint) *=.*\n?", "", lines, flags=re.MULTILINE)
