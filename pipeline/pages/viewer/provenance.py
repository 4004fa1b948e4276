"""List the products of a configuration: what made them, from what, when, and how to open them."""

from semidense.cache import Entry, Store
from semidense.cache.keys.recipe import short
from semidense.pipeline.pages.html import Html, folded, table, tag, text
from semidense.pipeline.pages.viewer.catalogue import Configuration
from semidense.pipeline.plan.steps import place
from semidense.pipeline.results.text import bytes_text, opening_text, time_text, value_text


def provenance_table(chosen: Configuration, store: Store) -> Html:
    """Return a table of a configuration's products, and below it each record, folded."""
    entries = sorted(chosen.entries.items(), key=lambda item: place(item[0]))
    rows = [
        [
            product,
            bytes_text(entry.size),
            f"{entry.seconds:.3g} s",
            time_text(entry.created),
            short(entry.key),
        ]
        for product, entry in entries
    ]
    head = ["product", "size", "made in", "made (UTC)", "key"]
    listed = table(head, rows, caption="The products of this configuration")
    records = "".join(folded(product, _record(entry, store)) for product, entry in entries)
    return listed + records + (_further(chosen) if chosen.further else "")


def _further(chosen: Configuration) -> Html:
    rows = [
        [
            entry.recipe.stage,
            _settings(entry)[:80],
            bytes_text(entry.size),
            f"{entry.seconds:.3g} s",
            time_text(entry.created),
            short(entry.key),
        ]
        for entry in chosen.further
    ]
    head = ["product", "settings", "size", "made in", "made (UTC)", "key"]
    told = table(head, rows, caption="`pipeline cache trace KEY` tells where one comes from", words=2)
    return folded(f"made from these: {len(rows)}", told)


def _settings(entry: Entry) -> str:
    return ", ".join(f"{name} {value_text(value)}" for name, value in entry.recipe.params.items() if name != "tiles")


def _record(entry: Entry, store: Store) -> Html:
    recipe = entry.recipe
    pairs: list[tuple[str, object]] = [("key", entry.key), ("digest", entry.digest)]
    pairs += [(f"setting {name}", value_text(value)) for name, value in recipe.params.items()]
    pairs += [(f"made from {name}", value_text(value)) for name, value in recipe.inputs.items()]
    pairs += [(f"environment: {name}", value) for name, value in recipe.environment.items()]
    pairs += [(f"version of {name}", value) for name, value in entry.extras.get("versions", {}).items()]
    pairs += [("command", " ".join(entry.extras.get("command", []))), ("code", f"{len(recipe.code)} modules")]
    return table(["what", "value"], [list(pair) for pair in pairs], caption="its record", words=2) + tag(
        "pre", text(opening_text(store.root, entry.key))
    )
