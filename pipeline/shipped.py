"""The weights that come with the package: products that stand in for trained networks."""

import hashlib
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

from stages.stage import Array, Inputs, Output, Stage, StageError

WEIGHTS = {
    product: Stage(
        product=product,
        inputs=(),
        outputs=(Output("parameters", ("parameter",), "float32", "1", "weights that come with the package"),),
        compute="pipeline.shipped:read_shipped_weights",
    )
    for product in ("matching_net", "evaluation_net")
}


def weights_file(product: str) -> Traversable:
    """Return the file of a product's shipped weights.

    Raises:
        StageError: if this installation has none.
    """
    file = resources.files("stages") / "weights" / f"{product}.safetensors"
    if not file.is_file():
        raise StageError(f"no weights for {product} come with this installation: train them with --train")
    return file


@cache
def weights_digest(product: str) -> str:
    """Return the sha256 of a product's shipped weights."""
    return hashlib.sha256(weights_file(product).read_bytes()).hexdigest()


def read_shipped_weights(product: str, _: Inputs) -> dict[str, Array]:
    """Return the shipped parameters of a network, checked."""
    from stages.weights import read_weights

    return {"parameters": read_weights(product, weights_file(product).read_bytes())}
