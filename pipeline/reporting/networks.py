"""How the networks learnt: their loss curves, and of shipped ones what is written in the file."""

import json
from importlib.resources import as_file
from typing import Any

from safetensors import safe_open

from pipeline.markup import Html, folded, table, tag, text
from pipeline.plan import Planned
from pipeline.reporting.gathered import Gathered
from pipeline.reporting.pictures import svg
from pipeline.shipped import weights_file
from pipeline.views.figures import figure
from pipeline.views.networks import loss_name


def networks(found: Gathered) -> Html:
    """Return the part of the page about both networks."""
    return "".join(_network(found, product, planned) for product, planned in found.networks.items())


def _network(found: Gathered, product: str, planned: Planned) -> Html:
    dataset, shipped = found.store.open(planned.key or ""), "shipped" in planned.step.settings
    if shipped:
        dataset = dataset.assign_attrs(params=_configuration(product).get(product, {}))
    drawn = svg(
        figure(product, dataset, title=f"{product}: training loss"), f"Training loss of {product} over its steps"
    )
    return _shipped(product) + drawn if shipped else drawn


def _shipped(product: str) -> Html:
    """Return what the package says of its own weights, which were trained elsewhere."""
    about = _metadata(product)
    steps = f", trained in {about['steps']:,} steps" if "steps" in about else ""
    name = loss_name(_configuration(product).get(product, {}))
    loss = f" to a final loss of {about['loss']:.3f} ({name}, nats)" if "loss" in about else ""
    told = tag("p", text(f"{product}: the weights that come with the package{steps}{loss}."))
    parts = _configuration(product).items()
    settings = [[f"{part}.{name}", value] for part, fields in parts for name, value in fields.items()]
    if not settings:
        return told
    caption = f"Settings of the training of {product}"
    return told + folded(f"How {product} was trained", table(["setting", "value"], settings, caption=caption, words=2))


def _configuration(product: str) -> dict[str, dict[str, Any]]:
    """Return the settings that the shipped weights were trained with: product -> name -> value."""
    found: dict[str, dict[str, Any]] = _metadata(product).get("configuration", {})
    return found


def _metadata(product: str) -> dict[str, Any]:
    """Return what the file of the shipped weights says of how they were made."""
    with as_file(weights_file(product)) as path, safe_open(path, framework="numpy") as file:
        written: dict[str, str] = file.metadata() or {}
    return {name: json.loads(value) for name, value in written.items() if name != "product"}
