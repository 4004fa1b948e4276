"""Name a configuration as a person would: preset, mode, what sets it apart from the others, and when it was made."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from pydantic_core import PydanticUndefined, to_jsonable_python

from semidense.cache import Entry
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.presets import DEFAULT
from semidense.pipeline.results.settings import USES, stage_of
from semidense.pipeline.results.text import time_text, value_text
from semidense.stages.catalog import STAGES

_MADE = {stage: product for uses in USES.values() for product, stage in uses.items()}
"""The product that a preset's stage makes in the place of its own."""
_UNSAID = ("tiles", "mode")
"""Parameters that are no setting, or said already."""
_SHOWN = 3
"""Settings in a name, at most."""
Chain = Mapping[str, Entry]


def names(chains: Sequence[Chain]) -> list[str]:
    """Return a name for each configuration of a scene, no two alike.

    A setting is in it if it is not the preset's and not the same in all configurations. The hash of shipped weights is
    in it only where the rest does not tell all configurations apart.
    """
    settings = [dict(_chosen(chain)) for chain in chains]
    every = dict.fromkeys(name for each in settings for name in each if _in_all(name, chains))
    differing = [name for name in every if _differs(name, settings)]
    plain = [name for name in differing if not name.endswith(".shipped")]
    heads = [_head(chain, _told(each, plain)) for chain, each in zip(chains, settings, strict=True)]
    if len(set(heads)) < len(heads):
        heads = [_head(chain, _told(each, differing)) for chain, each in zip(chains, settings, strict=True)]
    return [f"{head} - {_when(chain)}" for head, chain in zip(heads, chains, strict=True)]


def _differs(name: str, settings: Sequence[Mapping[str, str]]) -> bool:
    """Return whether a setting tells configurations apart.

    A precision does so only if two configurations have different ones: the machine fills it in if nobody sets it.
    """
    values = {each.get(name) for each in settings}
    return len(values - {None} if name.endswith(".precision") else values) > 1


def _told(settings: Mapping[str, str], names: Sequence[str]) -> list[str]:
    return [f"{name}={settings[name][:24]}" for name in names if name in settings]


def _in_all(setting: str, chains: Sequence[Chain]) -> bool:
    """Return whether all configurations have the product of a setting."""
    stage = setting.partition(".")[0]
    return all(_MADE.get(stage, stage) in chain for chain in chains)


def _head(chain: Chain, settings: list[str]) -> str:
    mode = [_mode(chain["costvolume"].recipe.params)] if "costvolume" in chain else []
    parts = [_preset(chain), *mode, *settings[:_SHOWN], "" if "confidence" in chain else "no confidence"]
    return ", ".join(part for part in parts if part)


def _mode(params: Mapping[str, Any]) -> str:
    """Return the mode of a cost volume; a record of the default mode may not have it."""
    return str(params.get("mode", STAGES["costvolume"].params.model_fields["mode"].default))


def _when(chain: Chain) -> str:
    end = next(iter(chain.values()))
    return f"{time_text(end.created)[:16]} ({end.key[:6]})"


def _preset(chain: Chain) -> str:
    """Return the preset whose stages made a configuration; empty if there is none."""
    made = {product: stage_of(product, chain[product].recipe.params) for product in _exchanged() if product in chain}
    fitting = [preset for preset, uses in USES.items() if all(made[each] == uses.get(each, each) for each in made)]
    return next(iter(fitting), "")


def _exchanged() -> list[str]:
    return list(dict.fromkeys(product for uses in USES.values() for product in uses))


def _chosen(chain: Chain) -> Iterator[tuple[str, str]]:
    """Yield the settings that are not those of the preset, as text; each is named as ``--set`` takes it."""
    preset = _preset(chain) or DEFAULT
    for product, entry in chain.items():
        if product in ("images", "truth"):
            continue
        stage = stage_of(product, entry.recipe.params)
        defaults = _defaults(stage, preset) if stage in STAGES else {}
        for name, value in entry.recipe.params.items():
            if name not in _UNSAID and defaults.get(name, PydanticUndefined) != value:
                yield f"{stage}.{name}", value_text(value)


@cache
def _defaults(stage: str, preset: str) -> Mapping[str, Any]:
    """Return the settings of a stage that a preset has."""
    section = Config.load(preset=preset).section(STAGES[stage].section or stage)
    found: Mapping[str, Any] = to_jsonable_python(dict(section), fallback=str)
    return found
