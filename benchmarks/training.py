"""Training in the dense form against the paper's patches, cells a second: ``python -m benchmarks.training``.

A step is the whole of it: cutting crops, forward, backward and the optimiser; float32, one thread, the paper's loss.
Cells that teach nothing, such as those between match and mismatch, do not count.
"""

from collections.abc import Callable
from typing import Annotated

import numpy as np
import torch
import typer

from benchmarks.harness import PAIRS, as_command, compare, report
from semidense.datasets import open_dataset
from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.learning.optimiser import optimisers_of
from semidense.stages.learning.parameters import initialise
from semidense.stages.matching.crops import IGNORED, cut_crop
from semidense.stages.matching.declaration import Form, MatchingNetParams, MatchingSamplesParams
from semidense.stages.matching.net import MatchingNet
from semidense.stages.matching.samples import draw_samples
from semidense.stages.matching.train import crops_loss
from semidense.stages.transforms.channels import channels

SCENE = "synthetic:train=0,test=1,height=128,width=192,disparities=40"


def trainer(form: Form, batch: int) -> tuple[Callable[[], None], int]:
    """Return a training step over the same crops each time, and the cells that it learns from."""
    scene = open_dataset(SCENE).scenes[0].load()
    if scene.truth is None:
        raise typer.BadParameter(f"{SCENE} has no ground truth")
    ends = np.array([scene.disparities.minimum, scene.disparities.maximum])
    truth = {"disparity": scene.truth.disparity, "nonocc": scene.truth.nonocc, "range": ends}
    views = [channels(scene.left, scene.right)]
    params = MatchingSamplesParams(form=form, samples=batch, mirror=False)
    samples = draw_samples(params, {"truth": [truth | _no_right_truth(scene.truth.disparity.shape)]})
    net = MatchingNet(3).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, 0)
    optimisers = optimisers_of(net, MatchingNetParams())
    rng = np.random.default_rng(0)

    def step() -> None:
        crops = [cut_crop(samples, index, views, 0.0, rng) for index in range(batch)]
        net.zero_grad()
        crops_loss(net, crops, 0.0).backward()
        for optimiser in optimisers:
            optimiser.step()

    labels = [cut_crop(samples, index, views, 0.0, rng).labels for index in range(batch)]
    return step, sum(int((each != IGNORED).sum()) for each in labels)


def _no_right_truth(shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    return {"right_disparity": np.full(shape, np.nan, np.float32), "right_nonocc": np.zeros(shape, bool)}


def main(
    batch: Annotated[int, typer.Option(help="dense crops a step")] = 4,
    patches: Annotated[int, typer.Option(help="patches a step")] = 64,
    pairs: Annotated[int, typer.Option()] = PAIRS,
) -> None:
    """Compare a step of each form."""
    keep_one_thread()
    dense, cells = trainer("dense", batch)
    patch, samples = trainer("patch", patches)
    ratio = compare("training, dense, times patches", dense, patch, 50, work=cells / samples, pairs=pairs)
    report("training", [ratio])


if __name__ == "__main__":
    as_command(main)
