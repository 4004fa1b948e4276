"""The guided cost volume against the exact one: time and raw error, on the same rows of the same scenes.

    python -m benchmarks.guided [DATASET] [--rows N] [--votes N]

The two sides compute the stage ``costvolume`` of a scene in turn, tile by tile on one thread, from channels in memory.
The rows lie in the middle of each scene, since an exact volume takes minutes for a whole one; ``--rows 0`` takes all.
Of a few scenes each is taken more than once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.harness import PAIRS, Ratio, as_command, report, timed
from semidense.datasets import SceneSource, open_dataset
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.compute.precision import resolve
from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.matching.declaration import COST_VOLUME, CostVolumeParams, Mode
from semidense.stages.metrics.errors import raw_bad
from semidense.stages.transforms.channels import channels

MODES: tuple[Mode, Mode] = ("guided", "exact")
DEFAULTS = CostVolumeParams()
TILE_ROWS = COST_VOLUME.tile_rows or 32
Nets = dict[str, Mapping[str, NDArray[np.generic]]]
"""The networks' parameters, by product."""


@dataclass
class Side:
    """One way to make the volume of some rows of a scene."""

    params: CostVolumeParams
    views: NDArray[np.float32]
    rows: range
    nets: Nets
    volume: NDArray[np.float16] = field(init=False)

    def __call__(self) -> None:
        """Make the volume."""
        margin = COST_VOLUME.halo(self.params)
        padded = np.pad(self.views, ((0, 0), (0, 0), (margin, margin), (margin, margin)), mode="edge")
        tiles = []
        for top in range(self.rows.start, self.rows.stop, TILE_ROWS):
            block = padded[:, :, top : min(top + TILE_ROWS, self.rows.stop) + 2 * margin]
            given = {"channels": {"channels": block}, **self.nets}
            tiles.append(COST_VOLUME.function()(self.params, given)["cost"])
        self.volume = np.concatenate(tiles)


@dataclass(frozen=True)
class Outcome:
    """What both sides made of a scene's rows."""

    scene: str
    speed: float
    seconds: tuple[float, float]
    judged: float
    errors: tuple[float, float]


def shipped_nets() -> Nets:
    """Return the networks that a guided volume takes."""
    return {net: read_network(shipped_weights(net, "exact"), {}) for net in CostVolumeParams(mode="guided").inputs[1:]}


def measure(scene: SceneSource, nets: Nets, rows: int, votes: int) -> Outcome:
    """Time both sides in turn; return the share of the valid cells that was judged, and raw errors (> 1 px, nonocc)."""
    loaded = scene.load()
    if loaded.truth is None:
        raise typer.BadParameter(f"{scene.name} has no ground truth")
    height = scene.size[0]
    first = (height - min(rows or height, height)) // 2
    taken = range(first, first + min(rows or height, height))
    views, low, high = channels(loaded.left, loaded.right), scene.disparities.minimum, scene.disparities.maximum
    sides = [
        Side(
            CostVolumeParams(d_min=low, d_max=high, mode=mode, precision=resolve("auto"), votes=votes),
            views,
            taken,
            nets,
        )
        for mode in MODES
    ]
    times = timed(sides[0]), timed(sides[1])
    truth, mask = (each[taken.start : taken.stop] for each in (loaded.truth.disparity, loaded.truth.nonocc))
    errors = [raw_bad(winner_take_all(side.volume, low), truth, mask, 1.0) for side in sides]
    judged, valid = (int(np.isfinite(side.volume).sum()) for side in sides)
    return Outcome(scene.name, times[1] / times[0], times, 100 * judged / valid, (errors[0], errors[1]))


def main(
    dataset: Annotated[str, typer.Argument(help="such as middlebury:DIR")] = "motorcycle",
    rows: Annotated[int, typer.Option(help="rows of each scene; 0: all")] = 32,
    votes: Annotated[int, typer.Option(help="costvolume.votes")] = DEFAULTS.votes,
) -> None:
    """Measure each scene, print what was found of each, and report the ratios."""
    keep_one_thread()
    nets = shipped_nets()
    scenes = [scene for scene in open_dataset(dataset).scenes if scene.has_truth]
    measure(scenes[0], nets, 4, votes)  # the warm-up, which compiles
    found = [measure(scene, nets, rows, votes) for _ in range(-(-PAIRS // len(scenes))) for scene in scenes]
    table = Table("scene", "times exact", "cells judged, %", "raw error guided, %", "exact, %", box=None)
    for each in found:
        figures = (each.speed, each.judged, *each.errors)
        table.add_row(each.scene, *(f"{value:.4g}" for value in figures))
    Console(width=160).print(table)
    seconds = (
        float(np.median([each.seconds[0] for each in found])),
        float(np.median([each.seconds[1] for each in found])),
    )
    worse = tuple(each.errors[0] - each.errors[1] for each in found)
    report(
        "guided",
        [
            Ratio("guided cost volume, times exact", tuple(each.speed for each in found), 5, seconds=seconds),
            Ratio("its raw error above the exact one's, points", worse, 0.3, at_most=True),
        ],
    )


if __name__ == "__main__":
    as_command(main)
