"""Semi-dense stereo matching with two CNNs, every stage cached.

The verbs of the command line as functions; products come back as lazy xarray objects:

    import pipeline
    run = pipeline.run("motorcycle")
    costs = run.open("costvolume", "Motorcycle")     # dims y, x, d; attrs tell where it comes from
    found = pipeline.match("left.png", "right.png")  # your own pair: found.disparity, found.confidence
"""

from importlib import import_module
from typing import Any

__all__ = [
    "Config",
    "Match",
    "Result",
    "StereoMatcher",
    "Task",
    "compare",
    "explain",
    "export",
    "match",
    "report",
    "run",
    "status",
    "sweep",
    "view",
]

_HOMES = {
    "Config": "pipeline.config",
    "Match": "pipeline.pairs",
    "StereoMatcher": "pipeline.stereo_matcher",
    "compare": "pipeline.comparison",
    "export": "pipeline.exporter",
    "match": "pipeline.pairs",
    "report": "pipeline.reporting",
    "view": "pipeline.viewer",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a verb when it is first used: ``import pipeline`` stays light."""
    if name in __all__:
        return getattr(import_module(_HOMES.get(name, "pipeline.api")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
