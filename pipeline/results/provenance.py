"""From a cached product up to the images, weights and code that it was made from."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from semidense.cache import Entry, EntryNotFound, Store, code_hash_of

MOST = 3
"""Inputs of one product that are written out; of more, such as one a training scene, the rest is counted."""


@dataclass(frozen=True)
class Ancestor:
    """A product in a chain: its entry, or only its name and digest where the entry is gone.

    Attributes:
        product: its name.
        digest: of its content.
        entry: what its record tells; None if it was deleted since.
        inputs: digests of what it was made from, by product.
    """

    product: str
    digest: str
    entry: Entry | None
    inputs: Mapping[str, tuple[str, ...]]

    @property
    def scene(self) -> str:
        """Whose product it is; empty if that is not known any more."""
        return self.entry.label.get("scene", "") if self.entry else ""

    @property
    def origins(self) -> dict[str, str]:
        """What it was read from, not made from: files and weights with their sha256, or how it was drawn."""
        params = dict(self.entry.recipe.params) if self.entry else {}
        found = {f"file {role}": str(value) for role, value in (params.get("files") or {}).items()}
        if "shipped" in params:
            found["weights"] = str(params["shipped"])
        if "reader" in params:
            found["reader"] = str(params["reader"])
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain JSON types."""
        about: dict[str, Any] = {"product": self.product, "digest": self.digest, "inputs": dict(self.inputs)}
        if self.entry is None:
            return about | {"there": False}
        return about | {
            "there": True,
            "scene": self.scene,
            "key": self.entry.key,
            "created": self.entry.created,
            "seconds": self.entry.seconds,
            "size": self.entry.size,
            "settings": dict(self.entry.recipe.params),
            "environment": dict(self.entry.recipe.environment),
            "code": dict(self.entry.recipe.code),
            "versions": self.entry.extras.get("versions", {}),
        }


def ancestry(store: Store, key: str) -> list[Ancestor]:
    """Return an entry and all it was made from, nearest first, each once.

    Raises:
        EntryNotFound: if there is no such entry.
        InvalidKey: if ``key`` is not one.
    """
    entry = store.find(key)
    if entry is None:
        raise EntryNotFound(f"no entry has the key {key} in {store.root}")
    known: dict[tuple[str, str], list[Entry]] = {}
    for each in store.entries():
        known.setdefault((each.recipe.stage, each.digest), []).append(each)
    found = {(entry.recipe.stage, entry.digest): _ancestor(entry)}
    waiting = [found[entry.recipe.stage, entry.digest]]
    for child in waiting:
        for product, digest in _inputs(child):
            if (product, digest) not in found:
                nearest = _nearest(known.get((product, digest), []), child.scene)
                found[product, digest] = _ancestor(nearest) if nearest else Ancestor(product, digest, None, {})
                waiting.append(found[product, digest])
    return waiting


def _ancestor(entry: Entry) -> Ancestor:
    inputs = {product: tuple(_digests(value)) for product, value in entry.recipe.inputs.items()}
    return Ancestor(entry.recipe.stage, entry.digest, entry, inputs)


def _digests(value: object) -> Iterable[str]:
    if isinstance(value, str):
        return [value]
    return [str(each) for each in (value.values() if isinstance(value, dict) else value)]  # type: ignore[attr-defined]


def _inputs(ancestor: Ancestor) -> Iterator[tuple[str, str]]:
    return ((product, digest) for product, digests in ancestor.inputs.items() for digest in digests)


def _nearest(candidates: list[Entry], scene: str) -> Entry | None:
    """Return the entry of the same scene if there is one, else the newest: equal content may have several."""
    return max(candidates, key=lambda each: (each.label.get("scene") == scene, each.created), default=None)


def tree_lines(chain: list[Ancestor]) -> Iterator[str]:
    """Yield the chain as an indented text; what appears a second time is only named."""
    by_content = {(each.product, each.digest): each for each in chain}
    told: set[tuple[str, str]] = set()

    def lines(each: Ancestor, depth: int) -> Iterator[str]:
        indent = "  " * depth
        again = (each.product, each.digest) in told
        told.add((each.product, each.digest))
        yield f"{indent}{_headline(each)}{' (as above)' if again and each.inputs else ''}"
        if again:
            return
        yield from (f"{indent}    {name}: {_short(value)}" for name, value in _details(each).items())
        for product, digests in each.inputs.items():
            for digest in digests[:MOST]:
                yield from lines(by_content[product, digest], depth + 1)
            if len(digests) > MOST:
                yield f"{indent}  and {len(digests) - MOST} more {product}, one a scene"

    return lines(chain[0], 0)


def _headline(each: Ancestor) -> str:
    if each.entry is None:
        return f"{each.product}, digest {each.digest[:12]}: its entry was deleted since"
    return f"{each.product} of {each.scene}, key {each.entry.key[:12]}, made {each.entry.created[:19]}"


def _details(each: Ancestor) -> dict[str, str]:
    """Return what it was made with: origins, settings, code and versions."""
    if each.entry is None:
        return {}
    params = {
        name: value
        for name, value in each.entry.recipe.params.items()
        if name not in ("files", "shipped", "reader", "tiles")
    }
    settings = ", ".join(f"{name}={_plain(value)}" for name, value in params.items())
    code = each.entry.recipe.code
    return {
        **each.origins,
        **({"settings": settings} if settings else {}),
        "code": f"{code_hash_of(code)[:12]}, {len(code)} modules",
    }


def _plain(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _short(value: str) -> str:
    return value[:12] if len(value) == 64 and set(value) <= set("0123456789abcdef") else value
