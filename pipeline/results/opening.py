"""Open a cached product as a labelled dataset: with coordinates, units and names."""

import json
import math
from typing import TYPE_CHECKING, Any

from semidense.cache import Store
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.metric_rows import FIGURES

if TYPE_CHECKING:
    import xarray as xr

_PLAIN = ("key", "digest", "stage", "created", "seconds")
"""Attributes of an opened product that are no JSON."""


def open_product(store: Store, key: str) -> "xr.Dataset":
    """Return a cached product as a lazy dataset.

    Rows and columns get coordinates in px. Beside ``cost``, the log-odds of a mismatch, a cost volume
    offers its ``probability``. Each figure of ``metrics`` and ``ranking`` is an array of its own.

    Its ``attrs`` say what made it, in types that every file format for arrays takes: ``key``, ``digest``, ``stage`` and
    ``created`` are texts, ``seconds`` is a number, and ``label``, ``params``, ``inputs``, ``code``, ``environment``,
    ``extras``, ``size`` and ``version`` are JSON texts, which ``recorded`` reads.

    It can be read after a fork, too: in a ``multiprocessing`` child or a worker of torch's ``DataLoader``.

    Raises:
        CacheError: if the entry is missing or damaged.
    """
    dataset = store.open(key)
    dataset.attrs = {name: _attribute(value) for name, value in dataset.attrs.items()}
    for dim in ("y", "x"):
        if dim in dataset.sizes:
            dataset = dataset.assign_coords({dim: (dim, range(dataset.sizes[dim]), {"units": "px"})})
    if "cost" in dataset:
        cost = dataset["cost"].astype("float32")
        probability = 1 / (1 + math.e ** (-cost))
        dataset["probability"] = probability.assign_attrs(units="1", long_name="probability of a mismatch")
    return _with_named_figures(dataset) if "figures" in dataset else dataset


def _attribute(value: object) -> str | float:
    return value if isinstance(value, (str, float)) else json.dumps(value)


def recorded(dataset: "xr.Dataset", part: str) -> dict[str, Any]:
    """Return a part of what an opened product's attributes say, such as ``params``; empty if they do not say it.

    Raises:
        UsageError: if the part is a plain text or number, which ``attrs`` itself gives.

    >>> import xarray as xr
    >>> recorded(xr.Dataset(attrs={"params": '{"R": 0.9}'}), "params")
    {'R': 0.9}
    """
    if part in _PLAIN:
        raise UsageError(f"{part} is no JSON text; read it as dataset.attrs[{part!r}]")
    found: dict[str, Any] = json.loads(dataset.attrs.get(part, "{}"))
    return found


def _with_named_figures(dataset: "xr.Dataset") -> "xr.Dataset":
    """Return the product ``metrics`` or ``ranking`` with an array (mask, threshold) for each figure."""
    from semidense.stages.metrics.errors import MASKS, THRESHOLDS
    from semidense.stages.metrics.ranking import RANKED
    from semidense.stages.metrics.stage import FIGURES as NAMES
    from semidense.stages.metrics.stage import by_name

    names = RANKED if dataset.attrs["stage"] == "ranking" else NAMES
    named = {
        name: (("mask", "threshold"), values, {"units": FIGURES[name].unit, "long_name": FIGURES[name].meaning})
        for name, values in by_name(dataset["figures"].values, names).items()
    }
    return (
        dataset.drop_vars("figures")
        .assign(named)
        .assign_coords(mask=list(MASKS), threshold=("threshold", list(THRESHOLDS), {"units": "px"}))
    )
