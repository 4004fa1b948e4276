"""Semi-dense stereo matching with two CNNs, every stage cached.

The verbs of the command line as functions; products come back as lazy xarray objects:

    import pipeline
    run = pipeline.run("motorcycle")
    costs = run.open("costvolume", "Motorcycle")     # dims y, x, d; attrs tell where it comes from
"""

from importlib import import_module
from typing import Any

__all__ = ["Config", "Result", "Task", "compare", "explain", "export", "run", "status", "sweep"]

_HOMES = {"Config": "pipeline.config", "compare": "pipeline.comparison", "export": "pipeline.exporter"}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a verb when it is first used: ``import pipeline`` stays light."""
    if name in __all__:
        return getattr(import_module(_HOMES.get(name, "pipeline.api")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
