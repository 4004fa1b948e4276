"""The non-default settings that an entry was made with, as a short text."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic_core import to_jsonable_python

from semidense.cache import Entry
from semidense.cache.entries.index import Index, inputs_of
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.environment import former_version
from semidense.pipeline.plan.presets import PRESETS
from semidense.pipeline.results.text import value_text
from semidense.stages.catalog import STAGES
from semidense.stages.evaluation.filtering import SemidenseParams

DEFAULTS = "defaults"
USES = {
    preset: dict(each.removeprefix("use.").split("=") for each in settings if each.startswith("use."))
    for preset, settings in PRESETS.items()
}
"""The stages that a preset exchanges: product -> stage."""


def stage_of(product: str, params: Mapping[str, Any]) -> str:
    """Return the stage of a preset that made a product: the one with the most of its settings in the record."""
    candidates = [product, *(uses[product] for uses in USES.values() if product in uses)]
    return max(candidates, key=lambda name: _recorded(name, params)) if len(candidates) > 1 else product


def _recorded(stage: str, params: Mapping[str, Any]) -> int:
    fields = set(STAGES[stage].params.model_fields)
    return len(fields) if fields <= set(params) else -1


def filter_text(params: SemidenseParams) -> str:
    """Return by what a map is filtered, to be read after "kept at".

    >>> filter_text(SemidenseParams()), filter_text(SemidenseParams(density=0.6))
    ('R = 0.9', 'a density of 60 %')
    """
    if params.density is not None:
        return f"a density of {100 * params.density:g} %"
    if params.max_error is not None:
        return f"an expected error of {100 * params.max_error:g} %"
    return f"R = {params.R:g}{', calibrated' * params.calibrated}"


class Settings:
    """The non-default settings that produced an entry, its own and its inputs', given all entries of the cache."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        self._index = Index(entries)
        self._known: dict[str, frozenset[str]] = {}

    def text(self, entry: Entry) -> str:
        """Return the settings, such as ``channels.rank_window=15 semidense.R=0.8``, or that they are the defaults.

        An entry of another version of the project names that version: its settings meant something else.
        """
        if (version := former_version(entry)) is not None:
            return f"of version {version}"
        return " ".join(sorted(self._of(entry))) or DEFAULTS

    def _of(self, entry: Entry) -> frozenset[str]:
        if entry.key not in self._known:
            self._known[entry.key] = frozenset(_own(entry))  # before its inputs': a hostile record may name itself
            contents = [(product, each) for product, all_ in inputs_of(entry.recipe).items() for each in all_]
            above = [self._index.find(product, digest) for product, digest in contents]
            self._known[entry.key] = self._known[entry.key].union(*(self._of(each) for each in above if each))
        return self._known[entry.key]


def _own(entry: Entry) -> Iterable[str]:
    """Yield the entry's own settings that were chosen; what a run fills in by itself has an open default."""
    product, params = entry.recipe.stage, entry.recipe.params
    stage = stage_of(product, params)
    if stage != product:
        yield f"use.{product}={stage}"
    defaults = to_jsonable_python(dict(Config.load().section(stage)))  # those that no key has, too
    for name, value in params.items():
        if name in defaults and defaults[name] not in (None, "auto", value):
            yield f"{stage}.{name}={value_text(value)}"
