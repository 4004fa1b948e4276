"""What changes a result's bits besides code, settings and inputs: the versions of packages, and the kind of CPU."""

import itertools
import platform
from functools import cache
from importlib import metadata

from semidense.cache import Entry
from semidense.cache.keys.code import source_text
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.compute.precision import cpu_facts, cpu_flags
from semidense.stages.stage import Stage

FORMER = ("pipeline", "stages", "datasets", "cache")
"""Top-level packages of this distribution up to version 0.1."""
_INSTRUCTIONS = ("avx2", "fma", "avx512f", "avx512_vnni", "avx512_bf16", "amx_bf16", "asimd", "sve", "bf16")
"""Of what a CPU can do, what makes torch, its libraries and NumPy take other instructions, and round otherwise."""


@cache
def version(distribution: str) -> str:
    """Return the version of an installed distribution; its files are read once a process."""
    return metadata.version(distribution)


@cache
def cpu_kind() -> str:
    """Return what of this machine's CPU decides how results are rounded: its family, maker and instructions."""
    known = [name for name in _INSTRUCTIONS if name in cpu_flags()]
    return " ".join(
        [platform.machine() or "unknown", *([maker] if (maker := cpu_facts().get("vendor_id")) else []), *known]
    )


@cache
def cpu_name() -> str:
    """Return the name of this machine's CPU for people, and its kind."""
    name = cpu_facts().get("model name")
    return f"{name} ({cpu_kind()})" if name else cpu_kind()


def environment(stage: Stage) -> dict[str, str]:
    """Return what beside code, settings and inputs may change the results of a stage.

    Major versions of the core packages, the format of the arrays, the versions of what the stage needs, and the kind
    of CPU: results of one kind are the same to the bit, those of two kinds may differ by rounding.

    Raises:
        UsageError: if a package that the stage needs is not installed.
    """
    core = {
        "torch": version("torch").split(".")[0],
        "numpy": version("numpy").split(".")[0],
        "zarr_format": "3",
        "cpu": cpu_kind(),
    }
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
    if all(map(_is_there, ours)):
        return None
    made_by = str(entry.extras.get("versions", {}).get("semidense-stereo", "unknown"))
    return None if _numbers(made_by) > _numbers(version("semidense-stereo")) else made_by


def _numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of a version that begin it; nothing of one that is not known.

    >>> _numbers("0.10.0") > _numbers("0.9.1.dev3") > _numbers("unknown")
    True
    """
    return tuple(int(part) for part in itertools.takewhile(str.isdecimal, text.split(".")))


@cache
def _is_there(module: str) -> bool:
    """Return whether a module is one of this version; looked up once a process, for thousands of entries name it."""
    return module.startswith("semidense") and source_text(module) is not None


def missing_packages(stage: Stage) -> tuple[str, ...]:
    """Return the distributions that a stage needs and that are not installed."""
    return tuple(name for name in stage.needs if not _installed(name))


def _installed(distribution: str) -> bool:
    try:
        version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True
