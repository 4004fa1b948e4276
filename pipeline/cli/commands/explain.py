"""Say what a product's key is made of, readable by people and by scripts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from semidense.cache import Entry, Store
from semidense.pipeline.api import Task
from semidense.pipeline.cli.console import why
from semidense.pipeline.files.suggestion import run_command
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Planned
from semidense.pipeline.results.provenance import ancestry, tree_lines
from semidense.pipeline.results.text import value_text


def explanation(planned: Planned, store: Store) -> dict[str, Any]:
    """Return a product's ingredients: its recipe if the key is known, its own part of it if inputs are not there yet.

    Returns:
        ``product``, ``scene``, ``state``, ``key``, ``changed``, ``why``, ``recipe``; of a hit also ``digest``,
        ``created``, ``seconds``, ``bytes``, ``extras`` (versions, command line, configuration), ``provenance``
        (all it was made from, nearest first) and ``tree`` (the same as lines of text).
    """
    step = planned.step
    found: dict[str, Any] = {
        "product": step.product,
        "scene": step.scene,
        "state": planned.state,
        "key": planned.key,
        "changed": [{"field": change.field, "old": change.old, "new": change.new} for change in planned.changed],
        "why": why(planned),
    }
    entry = store.find(planned.key) if planned.key else None
    if entry is None:
        own = {"stage": step.product, "code": step.code, "params": step.settings, "environment": step.environment}
        return found | {"recipe": own | {"inputs": dict.fromkeys(step.inputs, "open")}}
    chain = ancestry(store, entry.key)
    return (
        found | _of_entry(entry) | {"provenance": [each.to_dict() for each in chain], "tree": list(tree_lines(chain))}
    )


def draw_provenance(planned: Planned, store: Store, path: Path, task: Task) -> None:
    """Draw what a product was made from.

    Raises:
        UsageError: if it is not cached, or the file cannot be written.
    """
    if planned.state != "hit" or planned.key is None:
        name, product = planned.step.name, planned.step.product
        raise UsageError(f"{name} is not cached ({why(planned)}): make it with `{run_command(task, product)}`")
    from semidense.pipeline.figures.provenance import save_graph

    save_graph(ancestry(store, planned.key), path)


def _of_entry(entry: Entry) -> dict[str, Any]:
    return {
        "recipe": entry.recipe.to_dict(),
        "digest": entry.digest,
        "created": entry.created,
        "seconds": entry.seconds,
        "bytes": entry.size,
        "extras": dict(entry.extras),
    }


def print_explanation(found: Mapping[str, Any], graph: Path | None = None) -> None:
    """Print the ingredients, a line each, code as module and the first digits of its hash; and what was drawn."""
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"{found['product']} of {found['scene']}: {found['state']}", style="bold", markup=False)
    if "preset" in found:
        settings = " ".join(found["preset"]["settings"]) or "the defaults"
        console.print(f"preset  {found['preset']['name']}: {settings}", markup=False)
    console.print(f"key     {found['key'] or 'open until its inputs are made'}")
    if "digest" in found:
        made = f"made {found['created']} in {found['seconds']:.2f} s, {found['bytes']:,} bytes"
        console.print(f"digest  {found['digest']}\n{made}")
    if found["why"]:
        console.print(f"why     {found['why']}", style="yellow", markup=False)
    for change in found["changed"]:
        console.print(f"changed {change['field']}: {change['old']} -> {change['new']}", style="yellow", markup=False)
    for part in ("params", "inputs", "environment", "code"):
        console.print(f"\n{part}", style="bold")
        for name, value in found["recipe"][part].items():
            console.print(f"  {name} = {value_text(value)}", markup=False)
    if "tree" in found:
        console.print("\nmade from", style="bold")
        for line in found["tree"][1:]:
            console.print(line, markup=False)
    if graph:
        console.print(f"wrote {graph}", markup=False)
