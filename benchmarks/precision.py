"""How far bfloat16 is from float32, and how fast each is: error, disparities, costs and time on the same rows.

    python -m benchmarks.precision [DATASET] [--rows N] [--json FILE]

The rows lie in the middle of each scene, since a CPU without bfloat16 units needs minutes for a whole one.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, timed
from semidense.datasets import SceneSource, open_dataset
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.compute.precision import Precision, fast_bfloat16
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.matching.cost_volume import padded_cost_volume
from semidense.stages.matching.declaration import RADIUS
from semidense.stages.matching.net import MatchingNet, net_from_parameters
from semidense.stages.metrics.errors import raw_bad
from semidense.stages.transforms.channels import channels


def measure(scene: SceneSource, net: MatchingNet, rows: int) -> dict[str, Any]:
    """Return raw error (> 1 px, nonocc, %) and time in both precisions, changed disparities and cost difference."""
    block, truth, mask = middle_rows(scene, rows)
    disparities = range(scene.disparities.minimum, scene.disparities.maximum + 1)
    costs = {precision: block_costs(net, block, disparities, precision) for precision in ("float32", "bfloat16")}
    maps = {precision: winner_take_all(cost, disparities.start) for precision, cost in costs.items()}
    seconds = {precision: timed(lambda p=precision: block_costs(net, block, disparities, p)) for precision in costs}
    changed = np.abs(maps["bfloat16"] - maps["float32"])[mask]
    return {
        "scene": scene.name,
        "pixels": int(mask.sum()),
        **{f"raw_bad_{precision}": raw_bad(made, truth, mask, 1.0) for precision, made in maps.items()},
        **{f"seconds_{precision}": taken for precision, taken in seconds.items()},
        "changed_percent": 100 * float((changed > 0).mean()),
        "changed_over_1px_percent": 100 * float((changed > 1).mean()),
        "largest_cost_difference": float(np.nanmax(np.abs(costs["bfloat16"] - costs["float32"]))),
    }


def middle_rows(scene: SceneSource, rows: int) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Return the channels of some rows with their context, their true disparities, and which of them count."""
    loaded = scene.load()
    if loaded.truth is None:
        raise typer.BadParameter(f"{scene.name} has no ground truth")
    first = max(RADIUS, (scene.size[0] - rows) // 2)
    block = channels(loaded.left, loaded.right)[:, :, first - RADIUS : first + rows + RADIUS]
    return block, loaded.truth.disparity[first : first + rows], loaded.truth.nonocc[first : first + rows]


def block_costs(
    net: MatchingNet, block: NDArray[np.float32], disparities: range, precision: Precision
) -> NDArray[np.float32]:
    """Return the costs of a block that brings its rows of context, but not what lies beyond its sides."""
    padded = np.pad(block, ((0, 0), (0, 0), (0, 0), (RADIUS, RADIUS)), mode="edge")
    return padded_cost_volume(net, padded, disparities, precision)


def compare(
    dataset: Annotated[str, typer.Argument(help="such as middlebury:DIR")] = "motorcycle",
    rows: Annotated[int, typer.Option(help="rows of each scene")] = 16,
    out: Annotated[Path | None, typer.Option("--json", help="write the figures here")] = None,
) -> None:
    """Measure, print a table and write JSON."""
    net = net_from_parameters(read_network(shipped_weights("matching_net", "exact"), {})["parameters"], 3)
    found = [measure(scene, net, rows) for scene in open_dataset(dataset).scenes if scene.has_truth]
    mean = {name: float(np.mean([row[name] for row in found])) for name in found[0] if name != "scene"}
    table = Table("scene", *mean, box=None)
    for row in [*found, {"scene": "mean"} | mean]:
        table.add_row(row["scene"], *(f"{row[name]:.4g}" for name in mean))
    Console(width=200).print(table)
    if out:
        out.write_text(
            json.dumps({"name": "precision", "figures": mean, "scenes": found, "fast_bfloat16": fast_bfloat16()})
        )


if __name__ == "__main__":
    as_command(compare)
