"""Say what a product's key is made of, readable by people and by scripts."""

import json
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from cache import Entry, Store
from pipeline.plan import Planned


def explanation(planned: Planned, store: Store) -> dict[str, Any]:
    """Return a product's ingredients: its recipe if the key is known, its own part of it if inputs are not there yet.

    Returns:
        ``product``, ``scene``, ``state``, ``key``, ``changed``, ``recipe``; of a hit also ``digest``,
        ``created``, ``seconds``, ``bytes`` and ``extras`` (versions, command line, configuration).
    """
    step = planned.step
    found: dict[str, Any] = {
        "product": step.product,
        "scene": step.scene,
        "state": planned.state,
        "key": planned.key,
        "changed": [{"field": change.field, "old": change.old, "new": change.new} for change in planned.changed],
    }
    entry = store.find(planned.key) if planned.key else None
    if entry is None:
        own = {"stage": step.product, "code": step.code, "params": step.settings, "environment": step.environment}
        return found | {"recipe": own | {"inputs": dict.fromkeys(step.inputs, "open")}}
    return found | _of_entry(entry)


def _of_entry(entry: Entry) -> dict[str, Any]:
    return {
        "recipe": entry.recipe.to_dict(),
        "digest": entry.digest,
        "created": entry.created,
        "seconds": entry.seconds,
        "bytes": entry.size,
        "extras": dict(entry.extras),
    }


def print_explanation(found: Mapping[str, Any]) -> None:
    """Print the ingredients, a line each; code as module and the first digits of its hash."""
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"{found['product']} of {found['scene']}: {found['state']}", style="bold", markup=False)
    console.print(f"key     {found['key'] or 'open until its inputs are made'}")
    if "digest" in found:
        made = f"made {found['created']} in {found['seconds']:.2f} s, {found['bytes']:,} bytes"
        console.print(f"digest  {found['digest']}\n{made}")
    for change in found["changed"]:
        console.print(f"changed {change['field']}: {change['old']} -> {change['new']}", style="yellow", markup=False)
    for part in ("params", "inputs", "environment", "code"):
        console.print(f"\n{part}", style="bold")
        for name, value in found["recipe"][part].items():
            console.print(f"  {name} = {_short(value)}", markup=False)


def _short(value: object) -> str:
    """Return a value as JSON; of a hash the first 12 digits, of many the first and how many there are."""
    if isinstance(value, list) and len(value) > 3 and all(isinstance(item, str) for item in value):
        return f"{_short(value[0])} and {len(value) - 1} more"
    if isinstance(value, str) and len(value) == 64:
        return value[:12]
    return value if isinstance(value, str) else json.dumps(value)
