"""What a sweep tries: thresholds R, and values of settings, in all combinations."""

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from semidense.pipeline.plan.arguments import require_number, texts
from semidense.pipeline.plan.config import Config, alternatives, parse_setting, value_text
from semidense.pipeline.plan.errors import UsageError, shortened

THRESHOLDS = "0.05:0.95:0.05"
"""The thresholds that are tried if none are named."""
_INSTEAD_OF_R = ("semidense.density", "semidense.max_error")
Thresholds = str | float | Iterable[float] | None
"""What R may be: a number, several, a text of them, or None for ``THRESHOLDS``."""
Swept = Mapping[str, object] | Iterable[str] | str | None
"""What is swept beside R: ``{"section.field": [value1, value2]}``, or ``section.field=value1,value2`` once or more."""


def variants_of(R: Thresholds, over: Swept, by_R: bool = True) -> list[tuple[str, ...]]:
    """Return the settings of each variant, as texts: a threshold, and a value of each setting that is swept.

    Args:
        R: the thresholds; None takes ``THRESHOLDS``.
        over: the settings that are swept, each with its values.
        by_R: whether R decides what is kept, as far as the settings say that are not swept. If not, or if one that
            replaces R is swept, no variant has a threshold.

    Raises:
        UsageError: if a threshold is none, R is swept in two ways or where it decides nothing, or a setting is given
            twice or has no value to try.

    >>> variants_of("0.1,0.2", {"channels.rank_window": 15})
    [('semidense.R=0.1', 'channels.rank_window=15'), ('semidense.R=0.2', 'channels.rank_window=15')]
    >>> variants_of(None, {"semidense.density": [0.6, 0.8]})
    [('semidense.density=0.6',), ('semidense.density=0.8',)]
    """
    combined = _combined(over)
    names = {setting.partition("=")[0] for values in combined for setting in values}
    if "semidense.R" in names:
        raise UsageError("semidense.R is swept by R; give its values there")
    if by_R and names.isdisjoint(_INSTEAD_OF_R):
        tried = parse_thresholds(THRESHOLDS if R is None else R)
        thresholds: list[tuple[str, ...]] = [(f"semidense.R={value!r}",) for value in tried]
    elif R is None:
        thresholds = [()]
    else:
        raise UsageError(f"{' and '.join(_INSTEAD_OF_R)} replace R, which then decides nothing; leave R out")
    return [(*threshold, *combination) for combination in itertools.product(*combined) for threshold in thresholds]


def without_effect(configs: Mapping[str, Config], targets: Iterable[tuple[str, str]]) -> list[str]:
    """Return the settings in which variants differ though they make the very same products.

    Args:
        configs: the configuration of each variant, by its name.
        targets: ids of what was asked for, each with its variant, as a plan has them.
    """
    made: dict[str, list[str]] = {variant: [] for variant in configs}
    for step_id, variant in targets:
        made[variant].append(step_id)
    settings = {variant: _flat(config) for variant, config in configs.items()}
    names = dict.fromkeys(name for each in settings.values() for name in each)
    return [name for name in names if _makes_no_difference(name, settings, made)]


def _flat(config: Config) -> dict[str, str]:
    """Return all settings of a configuration as JSON, by name."""
    sections = config.to_dict().items()
    return {f"{name}.{field}": json.dumps(value) for name, fields in sections for field, value in fields.items()}


def _makes_no_difference(
    name: str, settings: Mapping[str, Mapping[str, str]], made: Mapping[str, Sequence[str]]
) -> bool:
    """Return whether variants that differ in one setting alone make the same, and there are such variants."""
    if len({each.get(name) for each in settings.values()}) == 1:
        return False
    alike: dict[frozenset[tuple[str, str]], list[str]] = {}
    for variant, each in settings.items():
        alike.setdefault(frozenset((key, value) for key, value in each.items() if key != name), []).append(variant)
    groups = [[made[variant] for variant in group] for group in alike.values()]
    return max(map(len, groups)) > 1 and all(each == group[0] for group in groups for each in group)


def _combined(over: Swept) -> list[list[str]]:
    """Return each swept setting as one text a value.

    Raises:
        UsageError: if a setting is given twice: of two values of it, a variant would have the later one alone.
    """
    if isinstance(over, Mapping):
        return [
            [f"{name}={value_text(name, value)}" for value in _several(name, values)] for name, values in over.items()
        ]
    settings = texts("over", over)
    given: dict[str, str] = {}
    for setting in settings:
        section, field, values = parse_setting(setting)
        if (name := f"{section}.{field}") in given:
            together = f"{name}={given[name]},{values}"
            raise UsageError(f"{name} is given twice; a sweep takes all values of a setting at once: {together}")
        given[name] = values
    return [alternatives(setting) for setting in settings]


def _several(name: str, values: object) -> list[object]:
    """Return the values of a setting that is swept; one that stands alone, as one."""
    found: list[object] = list(values) if np.iterable(values) and not isinstance(values, str) else [values]
    if not found:
        raise UsageError(f"{name} has no value to try; give at least one")
    return found


def parse_thresholds(R: Thresholds) -> list[float]:
    """Return the thresholds that ``first:last:step``, ``value,value``, a number or a sequence names.

    Raises:
        UsageError: if it is none of these, or a threshold lies outside [0, 1].

    >>> parse_thresholds("0.1:0.3:0.1")
    [0.1, 0.2, 0.3]
    """
    try:
        values = _span(R) if isinstance(R, str) and ":" in R else _list(R)
    except (TypeError, ValueError):
        raise UsageError(f"R = {shortened(R)}: write a number, numbers with commas, or first:last:step") from None
    outside = [value for value in values if not 0 <= value <= 1]
    if outside or not values:
        raise UsageError(
            f"R = {shortened(R)}: every threshold must lie in [0, 1]" + (f", not {outside[0]:g}" if outside else "")
        )
    return values


def _span(text: str) -> list[float]:
    first, last, step = (float(part) for part in text.split(":"))
    if step <= 0 or last < first or (last - first) / step > 1000:
        raise ValueError
    return [round(first + index * step, 10) for index in range(int((last - first) / step + 1e-9) + 1)]


def _list(R: Thresholds) -> list[float]:
    parts = R.split(",") if isinstance(R, str) else R if np.iterable(R) else [R]
    return [float(part if isinstance(part, str) else require_number("R", part)) for part in parts]
