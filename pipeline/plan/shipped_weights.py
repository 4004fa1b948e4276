"""The weights that come with the package: products that stand in for trained networks and their calibration."""

import hashlib
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

from semidense.stages.catalog import STAGES
from semidense.stages.matching.declaration import Mode
from semidense.stages.stage import Array, Inputs, Stage, StageError

WEIGHTS = {
    product: Stage(
        product=product,
        inputs=(),
        outputs=stage.outputs,
        compute=f"{__name__}:read_shipped_{'table' if product == 'calibration' else 'weights'}",
    )
    for product, stage in STAGES.items()
    if product in ("matching_net", "descriptor_net", "evaluation_net", "calibration")
}
_LEARNT_FROM_MAPS = ("evaluation_net", "calibration")
"""Products of which those for guided volumes are others: the errors of such maps hang together."""


def weights_name(product: str, mode: Mode) -> str:
    """Return the name of a product's shipped weights for volumes of a mode.

    >>> weights_name("evaluation_net", "guided"), weights_name("matching_net", "guided")
    ('evaluation_net.guided', 'matching_net')
    """
    return f"{product}.guided" if mode == "guided" and product in _LEARNT_FROM_MAPS else product


def weights_file(name: str) -> Traversable:
    """Return the file of shipped weights.

    Raises:
        StageError: if this installation has none.
    """
    file = resources.files("semidense.stages") / "weights" / f"{name}.safetensors"
    if not file.is_file():
        raise StageError(_missing(name))
    return file


@cache
def weights_digest(name: str) -> str:
    """Return the sha256 of shipped weights."""
    return hashlib.sha256(weights_file(name).read_bytes()).hexdigest()


def read_shipped_weights(name: str, _: Inputs) -> dict[str, Array]:
    """Return a shipped network as its training left it, checked."""
    from semidense.stages.weights import read_weights

    return {**read_weights(_product(name), weights_file(name).read_bytes())}


def read_shipped_table(name: str, _: Inputs) -> dict[str, Array]:
    """Return the shipped calibration, checked."""
    from semidense.stages.weights.tables import read_table

    return read_table(weights_file(name).read_bytes())


def _missing(name: str) -> str:
    """Return what is missing and what to do about it."""
    product, _, mode = name.partition(".")
    if product != "calibration":
        return f"no weights for {name} come with this installation: train them with --train"
    of_mode = f" MODE={mode}" if mode else ""
    return (
        "no calibration of such volumes comes with this installation: a wanted error and calibrated probabilities need "
        f"one; `make calibration DATA=DIR{of_mode}` makes it from Middlebury's training scenes"
    )


def _product(name: str) -> str:
    return name.partition(".")[0]
