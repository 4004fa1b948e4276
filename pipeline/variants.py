"""What a sweep tries: thresholds R, and values of settings, in all combinations."""

import itertools
from collections.abc import Iterable, Mapping

import numpy as np

from semidense.pipeline.plan.arguments import require_number, texts
from semidense.pipeline.plan.config import alternatives, parse_setting, value_text
from semidense.pipeline.plan.errors import UsageError, shortened

Thresholds = str | float | Iterable[float]
"""What R may be: a number, several, or a text of them."""
Swept = Mapping[str, object] | Iterable[str] | str | None
"""What is swept beside R: ``{"section.field": [value1, value2]}``, or ``section.field=value1,value2`` once or more."""


def variants_of(R: Thresholds, over: Swept) -> list[tuple[str, ...]]:
    """Return the settings of each variant, as texts: a threshold, and a value of each setting that is swept.

    Raises:
        UsageError: if a threshold is none, R is swept in two ways, or a setting is given twice or has no value to try.

    >>> variants_of("0.1,0.2", {"channels.rank_window": 15})
    [('semidense.R=0.1', 'channels.rank_window=15'), ('semidense.R=0.2', 'channels.rank_window=15')]
    """
    thresholds, combined = [f"semidense.R={value!r}" for value in parse_thresholds(R)], _combined(over)
    if any(setting.partition("=")[0] == "semidense.R" for values in combined for setting in values):
        raise UsageError("semidense.R is swept by R; give its values there")
    return [(threshold, *combination) for combination in itertools.product(*combined) for threshold in thresholds]


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
