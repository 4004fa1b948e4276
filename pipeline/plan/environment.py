"""What changes a result's bits besides code, settings and inputs: the versions of packages."""

from functools import cache
from importlib import metadata

from semidense.pipeline.plan.errors import UsageError
from semidense.stages.stage import Stage


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


def missing_packages(stage: Stage) -> tuple[str, ...]:
    """Return the distributions that a stage needs and that are not installed."""
    return tuple(name for name in stage.needs if not _installed(name))


def _installed(distribution: str) -> bool:
    try:
        version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True
