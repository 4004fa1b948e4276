"""Semi-dense stereo matching with two CNNs, every stage cached.

The verbs of the command line as functions; products come back as lazy xarray objects:

    from semidense import pipeline
    run = pipeline.run("motorcycle", settings={"costvolume.mode": "fast"})
    costs = run.open("costvolume")                   # dims y, x, d; attrs tell where it comes from
    found = pipeline.match("left.png", "right.png")  # your own pair: found.disparity, found.confidence
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semidense.datasets.registry import register_dataset
    from semidense.pipeline.api import Task, explain, open_store, run, status, sweep
    from semidense.pipeline.comparison.experiments import compare
    from semidense.pipeline.files.run_files import export
    from semidense.pipeline.pages.report import report
    from semidense.pipeline.pages.viewer import view
    from semidense.pipeline.pairs.match import Match, match
    from semidense.pipeline.pairs.opencv import StereoMatcher
    from semidense.pipeline.pairs.score import Score, score
    from semidense.pipeline.plan.config import Config
    from semidense.pipeline.results.opening import open_product, recorded
    from semidense.pipeline.results.result import Result
    from semidense.stages.catalog import register

_HOMES = {
    "Config": "plan.config",
    "Match": "pairs.match",
    "Result": "results.result",
    "Score": "pairs.score",
    "StereoMatcher": "pairs.opencv",
    "Task": "api",
    "compare": "comparison.experiments",
    "explain": "api",
    "export": "files.run_files",
    "match": "pairs.match",
    "open_product": "results.opening",
    "open_store": "api",
    "recorded": "results.opening",
    "register": "..stages.catalog",
    "register_dataset": "..datasets.registry",
    "report": "pages.report",
    "run": "api",
    "score": "pairs.score",
    "status": "api",
    "sweep": "api",
    "view": "pages.viewer",
}

__all__ = [
    "Config",
    "Match",
    "Result",
    "Score",
    "StereoMatcher",
    "Task",
    "compare",
    "explain",
    "export",
    "match",
    "open_product",
    "open_store",
    "recorded",
    "register",
    "register_dataset",
    "report",
    "run",
    "score",
    "status",
    "sweep",
    "view",
]


if not TYPE_CHECKING:
    # Hidden from type checkers, which would take it to mean that any name is there.
    def __getattr__(name: str) -> object:
        """Import a verb when it is first used: ``from semidense import pipeline`` stays light."""
        if name in _HOMES:
            home = _HOMES[name]
            module = import_module(home if home.startswith(".") else f".{home}", __name__)
            return getattr(module, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
