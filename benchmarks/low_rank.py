"""What a head of lower rank would save and cost: ``python -m benchmarks.low_rank [DATASET] [--rank K]``.

The hidden layer, 1600 -> 128, through K units between: its kernel is replaced by the nearest one of rank K (singular
value decomposition), so the errors are those of such a head. What it would save is counted, not timed: the share
of a cell's multiplications in the transformed domain that would be left.
"""

import copy
from typing import Annotated, Any

import numpy as np
import torch
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, write
from benchmarks.precision import block_costs, middle_rows
from semidense.datasets import SceneSource, open_dataset
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.matching.net import MatchingNet, net_from_parameters
from semidense.stages.metrics.errors import raw_bad

FULL = 128
RANKS = (16, 32, 64, 96)
THRESHOLD = 1.0
"""Largest error of a right disparity, px."""


def multiplications(rank: int) -> float:
    """Return those of a cell: conv3's, and the hidden layer's whole or in two parts."""
    conv3 = 36 * 384 * 64 / 16
    return conv3 + (64 * 64 * FULL / 16 if rank == FULL else 64 * 64 * rank / 16 + rank * FULL)


def truncated(net: MatchingNet, rank: int) -> tuple[MatchingNet, float]:
    """Return a copy whose hidden layer has a kernel of ``rank``, and the share of the kernel's squares that it has."""
    made = copy.deepcopy(net)
    layer = made.hidden[0].weight
    with torch.no_grad():
        u, values, v = torch.linalg.svd(layer.reshape(FULL, -1), full_matrices=False)
        layer.copy_(((u[:, :rank] * values[:rank]) @ v[:rank]).reshape(layer.shape))
    squares = values**2
    return made, float(squares[:rank].sum() / squares.sum())


def measure(scene: SceneSource, nets: dict[int, MatchingNet], rows: int) -> dict[int, float]:
    """Return the raw error (> 1 px, nonocc, %) for each rank, in the middle of a scene."""
    block, truth, mask = middle_rows(scene, rows)
    disparities = range(scene.disparities.minimum, scene.disparities.maximum + 1)
    costs = {rank: block_costs(net, block, disparities, "auto") for rank, net in nets.items()}
    maps = {rank: winner_take_all(cost, disparities.start) for rank, cost in costs.items()}
    return {rank: raw_bad(made, truth, mask, THRESHOLD) for rank, made in maps.items()}


def main(
    dataset: Annotated[str, typer.Argument(help="such as middlebury:DIR")] = "motorcycle",
    rank: Annotated[list[int] | None, typer.Option(help="instead of the usual ones", min=1, max=FULL)] = None,
    rows: Annotated[int, typer.Option(help="rows of each scene")] = 16,
) -> None:
    """Print and write the error and the multiplications of each rank."""
    net = net_from_parameters(read_network(shipped_weights("matching_net", "exact"), {})["parameters"], 3)
    made = {each: truncated(net, each) for each in (*(rank or RANKS), FULL)}
    nets = {each: one for each, (one, _) in made.items()}
    scenes = [scene for scene in open_dataset(dataset).scenes if scene.has_truth]
    found = {scene.name: measure(scene, nets, rows) for scene in scenes}
    rows_of_table: list[dict[str, Any]] = [
        {
            "rank": each,
            "kernel kept, %": 100 * kept,
            "multiplications, %": 100 * multiplications(each) / multiplications(FULL),
            "raw error, %": float(np.mean([errors[each] for errors in found.values()])),
        }
        for each, (_, kept) in made.items()
    ]
    write("low_rank", {"ranks": rows_of_table, "scenes": found})
    table = Table(*rows_of_table[0], box=None)
    for row in rows_of_table:
        table.add_row(*(f"{value:.4g}" for value in row.values()))
    print(f"{len(scenes)} scenes, {rows} rows of each, > {THRESHOLD:g} px, nonocc")
    Console(width=120).print(table)


if __name__ == "__main__":
    as_command(main)
