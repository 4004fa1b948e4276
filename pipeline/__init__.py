"""Semi-dense stereo matching with two CNNs, every stage cached.

The verbs of the command line as functions; products come back as lazy xarray objects:

    from semidense import pipeline
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
    "Config": "semidense.pipeline.plan.config",
    "Match": "semidense.pipeline.pairs.match",
    "StereoMatcher": "semidense.pipeline.pairs.opencv",
    "compare": "semidense.pipeline.comparison.experiments",
    "export": "semidense.pipeline.files.run_files",
    "match": "semidense.pipeline.pairs.match",
    "report": "semidense.pipeline.pages.report",
    "view": "semidense.pipeline.pages.viewer",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a verb when it is first used: ``from semidense import pipeline`` stays light."""
    if name in __all__:
        return getattr(import_module(_HOMES.get(name, "semidense.pipeline.api")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
