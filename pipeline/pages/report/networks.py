"""Show how the networks learnt: their loss curves, and for shipped weights the training record in the file."""

import json
from collections.abc import Mapping
from typing import Any

from semidense.pipeline.figures.figure import figure
from semidense.pipeline.figures.training import loss_name
from semidense.pipeline.pages.html import Html, folded, table, tag, text
from semidense.pipeline.pages.report.gathered import Gathered
from semidense.pipeline.pages.report.pictures import svg
from semidense.pipeline.plan.plan import Planned
from semidense.pipeline.plan.shipped_weights import Weights
from semidense.pipeline.results.opening import open_product
from semidense.stages.weights import read_metadata


def networks(found: Gathered) -> Html:
    """Return the part of the page about both networks."""
    return "".join(_network(found, product, planned) for product, planned in found.networks.items())


def _network(found: Gathered, product: str, planned: Planned) -> Html:
    dataset = open_product(found.store, planned.key or "")
    weights = planned.step.argument
    about = read_metadata(weights.read()) if isinstance(weights, Weights) else None
    if about is not None:
        dataset = dataset.assign_attrs(params=json.dumps(about.get("configuration", {}).get(product, {})))
    drawn = svg(
        figure(product, dataset, title=f"{product}: training loss"), f"Training loss of {product} over its steps"
    )
    return drawn if about is None else _shipped(product, about) + drawn


def _shipped(product: str, about: Mapping[str, Any]) -> Html:
    """Return the training record of weights that come with the package."""
    configuration = about.get("configuration", {})
    steps = f", trained in {about['steps']:,} steps" if "steps" in about else ""
    name = loss_name(configuration.get(product, {}))
    loss = f" to a final loss of {about['loss']:.3f} ({name}, nats)" if "loss" in about else ""
    told = tag("p", text(f"{product}: the weights that come with the package{steps}{loss}."))
    settings = [[f"{part}.{name}", value] for part, fields in configuration.items() for name, value in fields.items()]
    if not settings:
        return told
    caption = f"Settings of the training of {product}"
    return told + folded(f"How {product} was trained", table(["setting", "value"], settings, caption=caption, words=2))
