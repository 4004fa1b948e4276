"""What a result was made from: in a cache up to the images, weights and code, in a plan step by step."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from semidense.cache import Entry, EntryNotFound, Store, code_hash_of
from semidense.cache.entries.index import Content, Index, inputs_of
from semidense.cache.keys.recipe import short
from semidense.pipeline.plan.plan import Made, Planned
from semidense.pipeline.plan.steps import Step
from semidense.pipeline.results.text import time_text, value_text

MOST = 3
"""Most inputs of one product that are written out; the rest is counted, such as the training scenes."""


@dataclass(frozen=True)
class Ancestor:
    """A product that another was made from: its entry, or only name and digest if the entry was deleted.

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
        """The scene's name; empty if the entry was deleted."""
        return _scene(self.entry) if self.entry else ""

    @property
    def contents(self) -> list[Content]:
        """Product and digest of each of its inputs."""
        return [(product, digest) for product, digests in self.inputs.items() for digest in digests]

    @property
    def origins(self) -> dict[str, str]:
        """The files or weights it was read from, with their sha256, or the generator that drew it."""
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


class Provenance:
    """What entries of a cache were made from, and what was made from them; give it all entries of the cache.

    Attributes:
        entries: the first made first.
    """

    def __init__(self, entries: Iterable[Entry]) -> None:
        self.entries = sorted(entries, key=lambda entry: entry.created)
        self.index = Index(self.entries)
        self._made_from: dict[Content, list[Entry]] = {}
        for entry in self.entries:
            for content in single_inputs(entry):
                self._made_from.setdefault(content, []).append(entry)

    def made_from(self, content: Content) -> Sequence[Entry]:
        """Return what was made from a product alone, or from it and other single products."""
        return self._made_from.get(content, ())

    def chain(self, entry: Entry) -> dict[str, Entry]:
        """Return an entry and what it was made from that is still there, nearest first, one a product.

        Scenes that a network learnt from are left out.
        """
        found = {entry.recipe.stage: entry}
        waiting = [entry]
        for each in waiting:
            for product, digest in single_inputs(each):
                above = self.index.find(product, digest, scene=_scene(each))
                if above and product not in found:
                    found[product] = above
                    waiting.append(above)
        return found

    def ancestors(self, entry: Entry) -> list[Ancestor]:
        """Return an entry and all it was made from, nearest first, each once."""
        found = {(entry.recipe.stage, entry.digest): _ancestor(entry)}
        waiting = list(found.values())
        for child in waiting:
            for product, digest in child.contents:
                if (product, digest) not in found:
                    above = self.index.find(product, digest, scene=child.scene)
                    found[product, digest] = _ancestor(above) if above else Ancestor(product, digest, None, {})
                    waiting.append(found[product, digest])
        return waiting


def ancestry(store: Store, key: str) -> list[Ancestor]:
    """Return an entry and all it was made from, nearest first, each once.

    Raises:
        EntryNotFound: if there is no such entry.
        InvalidKey: if ``key`` is not one.
    """
    entry = store.find(key)
    if entry is None:
        raise EntryNotFound(f"no entry has the key {key} in {store.root}")
    return Provenance(store.entries()).ancestors(entry)


def single_inputs(entry: Entry) -> list[Content]:
    """Return product and digest of each single product that an entry was made from."""
    return [(product, content) for product, content in entry.recipe.inputs.items() if isinstance(content, str)]


def _ancestor(entry: Entry) -> Ancestor:
    return Ancestor(entry.recipe.stage, entry.digest, entry, inputs_of(entry.recipe))


def _scene(entry: Entry) -> str:
    return entry.label.get("scene", "")


def lineage(
    made: Mapping[str, Made | Planned], step_id: str, *, over_training: bool = False, up_to: str | None = None
) -> list[Step]:
    """Return a step of a run or a plan, and what it is made from, nearest first.

    Args:
        made: the results of a run, or the steps of a plan, by the step's id.
        step_id: the step.
        over_training: go on through the training scenes; without, only steps of the same scene and of the training
            split are in it, one a product.
        up_to: a product beyond which not to go.
    """
    found: dict[str, Step] = {}
    waiting = [step_id]
    for each in waiting:
        if each not in found:
            found[each] = step = made[each].step
            if step.product == up_to:
                continue
            inputs = [ids for product, ids in step.inputs.items() if over_training or not step.takes_list(product)]
            waiting += [each for ids in inputs for each in ids]
    return list(found.values())


def tree_lines(chain: list[Ancestor]) -> Iterator[str]:
    """Yield the chain as indented lines; a product that appears again is only named."""
    by_content = {(each.product, each.digest): each for each in chain}
    told: set[tuple[str, str]] = set()

    def lines(each: Ancestor, depth: int) -> Iterator[str]:
        indent = "  " * depth
        again = (each.product, each.digest) in told
        told.add((each.product, each.digest))
        yield f"{indent}{_headline(each)}{' (as above)' if again and each.inputs else ''}"
        if again:
            return
        yield from (f"{indent}    {name}: {value_text(value)}" for name, value in _details(each).items())
        for product, digests in each.inputs.items():
            for digest in digests[:MOST]:
                yield from lines(by_content[product, digest], depth + 1)
            if len(digests) > MOST:
                yield f"{indent}  and {len(digests) - MOST} more {product}, one a scene"

    return lines(chain[0], 0)


def _headline(each: Ancestor) -> str:
    if each.entry is None:
        return f"{each.product}, digest {short(each.digest)}: its entry was deleted since"
    return f"{each.product} of {each.scene}, key {short(each.entry.key)}, made {time_text(each.entry.created)}"


def _details(each: Ancestor) -> dict[str, str]:
    """Return what it was made with: origins, settings, code and versions."""
    if each.entry is None:
        return {}
    params = {
        name: value
        for name, value in each.entry.recipe.params.items()
        if name not in ("files", "shipped", "reader", "tiles")
    }
    settings = ", ".join(f"{name}={value_text(value)}" for name, value in params.items())
    code = each.entry.recipe.code
    return {
        **each.origins,
        **({"settings": settings} if settings else {}),
        "code": f"{short(code_hash_of(code))}, {len(code)} modules",
    }
