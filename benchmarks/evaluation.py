"""evaluation-Net at every pixel against patch by patch: ``python -m benchmarks.evaluation``.

Patches are run in batches of 64, as training would; the sides differ in the number of pixels, so the ratio is of
pixels a second. A patch answers for one pixel.
"""

import numpy as np
import torch

from benchmarks.harness import compare, report
from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.evaluation.confidence import confidence
from semidense.stages.evaluation.declaration import PATCH
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import initialise

SIZE = (128, 192)
PATCHES = 64


def main() -> None:
    """Compare on noise: the arithmetic does not depend on what is seen. One thread on both sides."""
    keep_one_thread()
    net = EvaluationNet()
    initialise(net, 0)
    layers = np.random.default_rng(0).normal(size=(2, *SIZE)).astype(np.float32)
    patches = torch.randn(PATCHES, 2, PATCH, PATCH)

    def single() -> None:
        with torch.inference_mode():
            net(patches)

    work = SIZE[0] * SIZE[1] / PATCHES
    report(
        "evaluation",
        [compare("evaluation-Net, times patch by patch", lambda: confidence(net, layers), single, 50, work=work)],
    )


if __name__ == "__main__":
    main()
