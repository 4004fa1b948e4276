"""List what can be fetched, and whether it is here: the ``PUBLICATIONS`` of the modules of all kinds of dataset."""

import difflib
from importlib import import_module
from pathlib import Path
from typing import Literal

from semidense.datasets.benchmarks.copies.publication import Publication
from semidense.datasets.errors import UnknownDatasetError
from semidense.datasets.registry import kinds

State = Literal["yes", "in part", "no"]


def publications() -> dict[str, Publication]:
    """Return all that publishers offer, by the name that is typed."""
    modules = [import_module(kind.module) for kind in kinds().values()]
    return {each.name: each for module in modules for each in getattr(module, "PUBLICATIONS", ())}


def publication(name: str) -> Publication:
    """Return what a name stands for.

    Raises:
        UnknownDatasetError: If nothing has that name; the nearest one is given.
    """
    known = publications()
    if name not in known:
        near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}?" if near else "`pipeline data list` names all"
        raise UnknownDatasetError(f"nothing named {name!r} can be fetched; {hint}")
    return known[name]


def state(each: Publication, data: Path) -> State:
    """Tell whether a copy is in a folder of data; it is there in part while the archives of an earlier fetch are."""
    if any(path.is_file() for path in archives_of(each, data).rglob("*")):
        return "in part"
    return "yes" if each.folder(data).is_dir() else "no"


def archives_of(each: Publication, data: Path) -> Path:
    """Return the folder that keeps the archives until the last of them is unpacked."""
    return data / ".archives" / each.name
