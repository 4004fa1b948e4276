"""List what a cache has to look at: scenes, and for each the configurations its maps were made with.

Only the records are read. An entry names what it was made from by the digest of its content, so going up from a
confidence or a disparity finds everything behind it, whatever dataset or command made it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from semidense.cache import Entry, Store
from semidense.cache.entries.index import Content
from semidense.pipeline.pages.viewer.naming import names
from semidense.pipeline.plan.steps import SPLIT
from semidense.pipeline.results.provenance import Provenance, single_inputs

_ENDS = ("confidence", "disparity")
"""The last product of a configuration: a confidence, or a disparity without one."""
Chain = dict[str, Entry]


@dataclass(frozen=True)
class Configuration:
    """The products of a scene that were made with one set of settings.

    Attributes:
        name: its preset, mode, the settings in which it differs from the scene's others, and when it was made.
        entries: its products, by name; the truth among them, if it is known.
        further: what was made from its products, oldest first: filtered maps, figures, other matchers and measures.
    """

    name: str
    entries: Mapping[str, Entry]
    further: tuple[Entry, ...]

    @property
    def keys(self) -> dict[str, str]:
        """The keys of its products."""
        return {product: entry.key for product, entry in self.entries.items()}


@dataclass(frozen=True)
class CatalogueScene:
    """A scene of a cache; two pairs of images of one name are two scenes.

    Attributes:
        dataset: its name in the records.
        name: of the scene.
        configurations: the latest first.
    """

    dataset: str
    name: str
    configurations: tuple[Configuration, ...]


def catalogue(store: Store) -> tuple[CatalogueScene, ...]:
    """Return the scenes of a cache in the order of their names.

    Raises:
        CacheUnavailable: if the cache cannot be read.
    """
    records = _Records(store.entries())
    scenes: dict[tuple[str, str, str], list[Chain]] = {}
    for chain in records.chains():
        label = next(iter(chain.values())).label
        pair = chain["images"].digest if "images" in chain else ""
        scenes.setdefault((label.get("dataset", ""), label.get("scene", ""), pair), []).append(chain)
    numbered = _numbered(scenes)
    return tuple(CatalogueScene(*numbered[place], _named(chains, records)) for place, chains in sorted(scenes.items()))


def _numbered(places: Iterable[tuple[str, str, str]]) -> dict[tuple[str, str, str], tuple[str, str]]:
    """Return dataset and name of each pair of images; two pairs of one name get the start of their digests."""
    every = list(places)
    alike = [place[:2] for place in every]
    return {
        place: (place[0], place[1] if alike.count(place[:2]) == 1 else f"{place[1]} ({place[2][:6] or 'no images'})")
        for place in every
    }


class _Records:
    """The chains of products that a cache holds, and the truth of each pair of images."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        self.provenance = Provenance(entries)
        self._truths = dict(self._compared())

    def _compared(self) -> Iterator[tuple[str, str]]:
        """Yield the digests of images with those of the truth that they were compared with."""
        for entry in self.provenance.entries:
            for digest, truth in _pairs(entry.recipe.inputs):
                disparity = self.provenance.index.find("disparity", digest)
                images = self.provenance.chain(disparity).get("images") if disparity else None
                if images:
                    yield images.digest, truth

    def chains(self) -> Iterator[Chain]:
        """Yield the products behind each confidence, and behind each disparity without one, the latest first."""
        seen: set[str] = set()
        for end in _ENDS:
            for entry in reversed([each for each in self.provenance.entries if each.recipe.stage == end]):
                if entry.digest not in seen:
                    chain = self.provenance.chain(entry)
                    seen |= {chain[product].digest for product in _ENDS if product in chain}
                    yield chain | self._truth_of(chain)

    def _truth_of(self, chain: Chain) -> Chain:
        """Return the truth of a chain's images, if they were compared with one that is still there."""
        images = chain.get("images")
        truth = self.provenance.index.find("truth", self._truths.get(images.digest, "")) if images else None
        return {"truth": truth} if truth else {}

    def further(self, chain: Chain) -> tuple[Entry, ...]:
        """Return what was made from a scene's products, from each other, and from learnt products, oldest first."""
        known = {(product, entry.digest) for product, entry in chain.items()}
        found: dict[str, Entry] = {}
        waiting = [content for content in known if not self._is_learnt(content)]
        for content in waiting:
            for entry in self.provenance.made_from(content):
                own = (entry.recipe.stage, entry.digest)
                if entry.recipe.stage in (*chain, *_ENDS) or entry.key in found:
                    continue
                if all(each in known or self._is_learnt(each) for each in single_inputs(entry)):
                    found[entry.key] = entry
                    known.add(own)
                    waiting.append(own)
        return tuple(sorted(found.values(), key=lambda entry: entry.created))

    def _is_learnt(self, content: Content) -> bool:
        entry = self.provenance.index.find(*content)
        return entry is not None and entry.label.get("scene") == SPLIT


def _pairs(inputs: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the disparities and truths that a product compares, by digest."""
    disparity, truth = inputs.get("disparity", ()), inputs.get("truth", ())
    if isinstance(disparity, str) and isinstance(truth, str):
        yield disparity, truth
    elif isinstance(disparity, list) and isinstance(truth, list):
        yield from zip(disparity, truth, strict=False)


def _named(chains: list[Chain], records: _Records) -> tuple[Configuration, ...]:
    """Return the configurations of a scene by name, the latest first."""
    latest = sorted(chains, key=lambda chain: max(entry.created for entry in chain.values()), reverse=True)
    return tuple(
        Configuration(name, chain, records.further(chain)) for name, chain in zip(names(latest), latest, strict=True)
    )
