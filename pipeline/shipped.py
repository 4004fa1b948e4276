"""The weights that come with the package: products that stand in for trained networks and their calibration."""

import hashlib
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

from stages.catalog import STAGES
from stages.stage import Array, Inputs, Stage, StageError

WEIGHTS = {
    product: Stage(
        product=product,
        inputs=(),
        outputs=stage.outputs,
        compute=f"pipeline.shipped:read_shipped_{'table' if product == 'calibration' else 'weights'}",
    )
    for product, stage in STAGES.items()
    if product in ("matching_net", "descriptor_net", "evaluation_net", "calibration")
}
_HOW = {
    "calibration": "no calibration comes with this installation: a wanted error and calibrated probabilities need one; "
    "`make calibration DATA=DIR` makes it from Middlebury's training scenes"
}
"""What to do about a missing file, where it is not to train."""


def weights_file(product: str) -> Traversable:
    """Return the file of a product's shipped weights.

    Raises:
        StageError: if this installation has none.
    """
    file = resources.files("stages") / "weights" / f"{product}.safetensors"
    if not file.is_file():
        missing = f"no weights for {product} come with this installation: train them with --train"
        raise StageError(_HOW.get(product, missing))
    return file


@cache
def weights_digest(product: str) -> str:
    """Return the sha256 of a product's shipped weights."""
    return hashlib.sha256(weights_file(product).read_bytes()).hexdigest()


def read_shipped_weights(product: str, _: Inputs) -> dict[str, Array]:
    """Return a shipped network as its training left it, checked."""
    from stages.weights import read_weights

    return {**read_weights(product, weights_file(product).read_bytes())}


def read_shipped_table(product: str, _: Inputs) -> dict[str, Array]:
    """Return the shipped calibration, checked."""
    from stages.weights.tables import read_table

    return read_table(weights_file(product).read_bytes())
