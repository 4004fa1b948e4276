"""What changes a result's bits besides code, settings and inputs: the versions of packages."""

from functools import cache
from importlib import metadata

from semidense.cache import Entry
from semidense.cache.keys.code import source_text
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.stage import Stage

FORMER = ("pipeline", "stages", "datasets", "cache")
"""Top-level packages of this distribution up to version 0.1."""


@cache
def version(distribution: str) -> str:
    """Return the version of an installed distribution; its files are read once a process."""
    return metadata.version(distribution)


def environment(stage: Stage) -> dict[str, str]:
    """Return major versions of the core packages, the format of the arrays, and the versions of what a stage needs.

    Raises:
        UsageError: if a package that the stage needs is not installed.
    """
    core = {"torch": version("torch").split(".")[0], "numpy": version("numpy").split(".")[0], "zarr_format": "3"}
    if missing := missing_packages(stage):
        raise UsageError(
            f"{stage.product} needs {' and '.join(missing)}: pip install 'semidense-stereo[baselines]' brings it"
        )
    return core | {name: version(name) for name in stage.needs}


def former_version(entry: Entry) -> str | None:
    """Return the version that made an entry which this one can never use again; None for all others.

    Keys hold the names of modules: an entry whose code lies in a module of ours that is gone is of another version.
    """
    ours = [name for name in entry.recipe.code if name.partition(".")[0] in ("semidense", *FORMER)]
    if all(name.startswith("semidense") and source_text(name) is not None for name in ours):
        return None
    return str(entry.extras.get("versions", {}).get("semidense-stereo", "unknown"))


def missing_packages(stage: Stage) -> tuple[str, ...]:
    """Return the distributions that a stage needs and that are not installed."""
    return tuple(name for name in stage.needs if not _installed(name))


def _installed(distribution: str) -> bool:
    try:
        version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True
