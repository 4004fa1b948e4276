"""Find the scenes that a specification such as ``middlebury:DIR`` names."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Protocol, cast

from semidense.datasets.errors import DatasetError, SceneNotFound, UnknownDatasetError
from semidense.datasets.scene import SceneSource


@dataclass(frozen=True)
class Dataset:
    """Hold the scenes that a specification names, in a fixed order.

    Attributes:
        spec: What the user asked for, such as ``middlebury:DIR``.
        scenes: Where each scene comes from; names are unique.

    Raises:
        DatasetError: If two scenes have one name.
    """

    spec: str
    scenes: tuple[SceneSource, ...]

    def __post_init__(self) -> None:
        twice = [name for name, count in Counter(scene.name for scene in self.scenes).items() if count > 1]
        if twice:
            raise DatasetError(f"{self.spec}: several scenes are named {', '.join(twice)}; names must be unique")

    def select(self, names: Iterable[str]) -> "Dataset":
        """Keep the scenes named, in the order of this data set.

        A name is a scene's full name, or the end of it after a slash where that fits one scene only: ``Cones`` finds
        ``2003/Cones``.

        Raises:
            SceneNotFound: If a name fits no scene (the nearest names are given) or several.
        """
        chosen = {self._find(name).name for name in names}
        return Dataset(self.spec, tuple(scene for scene in self.scenes if scene.name in chosen))

    def _find(self, name: str) -> SceneSource:
        exact = [scene for scene in self.scenes if scene.name == name]
        fits = exact or [scene for scene in self.scenes if scene.name.endswith(f"/{name}")]
        if len(fits) == 1:
            return fits[0]
        if fits:
            raise SceneNotFound(
                f"{self.spec}: {name!r} fits {', '.join(scene.name for scene in fits)}; give one of them"
            )
        raise SceneNotFound(f"{self.spec}: no scene {name!r}; {self._hint(name)}")

    def _hint(self, name: str) -> str:
        short = {scene.name.rsplit("/", 1)[-1].lower(): scene.name for scene in self.scenes}
        full = {scene.name.lower(): scene.name for scene in self.scenes}
        near = difflib.get_close_matches(name.lower(), [*full, *short], n=3, cutoff=0.5)
        if near:
            return f"did you mean {' or '.join(dict.fromkeys((full | short)[key] for key in near))}?"
        return f"it has {_join([scene.name for scene in self.scenes])}"


class _Lister(Protocol):
    def list_scenes(self, argument: str) -> tuple[SceneSource, ...]:
        """List the scenes that the text after the colon stands for."""


@dataclass(frozen=True)
class Kind:
    """A kind of dataset that a specification can name.

    Attributes:
        pattern: how its specifications are written, such as ``eth3d:DIR``; the name stands before the colon.
        description: one line for people.
        module: dotted name of the module whose ``list_scenes(argument)`` gives the `SceneSource` of each scene. It is
            imported when it is asked for: listing the names must stay cheap.
    """

    pattern: str
    description: str
    module: str

    @property
    def name(self) -> str:
        """What stands before the colon."""
        return re.split(r"[:\[]", self.pattern)[0]


_HERE = __name__.rpartition(".")[0]
_KINDS = (
    Kind("motorcycle", "the Middlebury 2014 Motorcycle pair that scikit-image ships", f"{_HERE}.benchmarks.motorcycle"),
    Kind(
        "middlebury:DIR",
        "Middlebury MiddEval3 or 2001 to 2021: a scene, a collection or a root of several; ,right=E other exposures",
        f"{_HERE}.benchmarks.middlebury",
    ),
    Kind("kitti2012:DIR", "KITTI Stereo 2012: its root or its training folder", f"{_HERE}.benchmarks.kitti2012"),
    Kind("kitti2015:DIR", "KITTI Stereo 2015: its root or its training folder", f"{_HERE}.benchmarks.kitti2015"),
    Kind("eth3d:DIR", "ETH3D two-view: a scene, two_view_training or its parent", f"{_HERE}.benchmarks.eth3d"),
    Kind(
        "synthetic[:KEY=VALUE,...]",
        "rendered planes with exact truth; see semidense.datasets.synthetic.scenes for the keys",
        f"{_HERE}.synthetic.scenes",
    ),
    Kind(
        "pair:LEFT,RIGHT[,KEY=VALUE,...]",
        "your own: two files, folders or patterns, or pair:LIST.csv; see `match`",
        f"{_HERE}.pairs.pair",
    ),
    Kind("map:PATTERN[,KEY=VALUE,...]@DATASET", "a dataset with the maps of another matcher", f"{_HERE}.pairs.maps"),
    Kind("toml:FILE", "a data set of your own that a small TOML file describes", f"{_HERE}.pairs.described"),
)
GROUP = "semidense.datasets"
"""Entry points of this group name the `Kind` of a dataset that another package reads."""
_registered: dict[str, Kind] = {}


def register_dataset(kind: Kind) -> None:
    """Add a kind of dataset from outside this package.

    Raises:
        DatasetError: If its name is taken by another kind.
    """
    if kinds().get(kind.name, kind) != kind:
        raise DatasetError(f"data set {kind.name!r} ({kind.module}): the name is taken; choose another")
    _registered[kind.name] = kind


def kinds() -> dict[str, Kind]:
    """Return every kind of dataset by its name: our own, those of installed packages, those that were registered.

    Raises:
        DatasetError: If an installed package's entry point cannot be loaded.
    """
    return {kind.name: kind for kind in (*_registered.values(), *_installed(), *_KINDS)}


@cache
def _installed() -> tuple[Kind, ...]:
    return tuple(_load(point) for point in entry_points(group=GROUP))


def _load(point: EntryPoint) -> Kind:
    try:
        return cast(Kind, point.load())
    except Exception as error:
        raise DatasetError(f"the plug-in {point.name} = {point.value} cannot be loaded: {error}") from error


def open_dataset(spec: str) -> Dataset:
    """List the scenes that a specification names; no pixel is decoded unless a range must be read from the truth.

    Args:
        spec: such as ``motorcycle``, ``middlebury:DIR`` or ``pair:LEFT,RIGHT[,KEY=VALUE,...]``; `describe` lists all.
            A folder alone is taken for the benchmark whose layout it has. Several are joined by ``+``; where they share
            a scene's name, the kind of data set is put before it.

    Raises:
        UnknownDatasetError: If the name before the colon is not known; the nearest one is given.
        DatasetError: If the folder does not follow the layout, or a file in it is not valid.
    """
    known = kinds()
    if len(parts := re.split(rf"\+(?=(?:{'|'.join(map(re.escape, known))})(?:[:+]|$))", spec)) > 1:
        return _joined(spec, [open_dataset(part) for part in parts])
    name, _, argument = spec.partition(":")
    if name not in known and spec and Path(spec).is_dir():
        return open_dataset(folder_spec(Path(spec)))
    if name not in known:
        near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.4)
        hint = f"did you mean {known[near[0]].pattern}?" if near else f"known are {', '.join(_patterns())}"
        raise UnknownDatasetError(f"no data set {name!r}; {hint}")
    return Dataset(spec, _listed(spec, known[name].module, argument))


def _listed(spec: str, module: str, argument: str) -> tuple[SceneSource, ...]:
    """Return the scenes that a kind's module lists; whatever fails in one from outside is told in one line."""
    try:
        scenes = tuple(cast(_Lister, import_module(module)).list_scenes(argument))
    except DatasetError:
        raise
    except Exception as error:
        raise DatasetError(f"data set {spec}: {module} failed: {type(error).__name__}: {error}") from error
    if odd := [scene for scene in scenes if not isinstance(scene, SceneSource)]:
        raise DatasetError(f"data set {spec}: {module} listed {odd[0]!r}; a scene is a SceneSource")
    return scenes


def _joined(spec: str, parts: list[Dataset]) -> Dataset:
    count = Counter(scene.name for part in parts for scene in part.scenes)
    named = [
        replace(scene, name=f"{part.spec.partition(':')[0]}/{scene.name}") if count[scene.name] > 1 else scene
        for part in parts
        for scene in part.scenes
    ]
    return Dataset(spec, tuple(named))


def folder_spec(folder: Path) -> str:
    """Return the specification of a folder in a benchmark's layout: KITTI's and ETH3D's by their folders' names.

    >>> folder_spec(Path("data/eth3d/two_view_training"))
    'eth3d:data/eth3d/two_view_training'
    """
    inside = {path.name for path in folder.glob("*")} | {path.name for path in folder.glob("training/*")}
    around = set(folder.absolute().parts)
    if "image_2" in inside:
        return f"kitti2015:{folder}"
    if inside & {"image_0", "colored_0"}:
        return f"kitti2012:{folder}"
    return f"eth3d:{folder}" if "two_view_training" in inside | around else f"middlebury:{folder}"


def describe() -> list[tuple[str, str]]:
    """Give each specification's pattern and what it stands for."""
    return [(kind.pattern, kind.description) for kind in kinds().values()]


def _patterns() -> list[str]:
    return [pattern for pattern, _ in describe()]


def _join(names: list[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
