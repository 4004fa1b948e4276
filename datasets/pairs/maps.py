"""Give scenes the disparity maps of another matcher: ``map:PATTERN[,scale=S][,none=V]@DATASET``.

The ``*`` of the pattern stands for the name of a scene; a scene without a file is left out::

    map:raft/*.pfm@middlebury:DIR/trainingQ
    map:sensor/*.png,scale=16,none=0@pair:left/,right/
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.errors import DatasetError, LayoutError
from semidense.datasets.pairs.map_files import Reading, disparities, recognised_scale, stored_map
from semidense.datasets.pairs.options import PairOptions, parse
from semidense.datasets.registry import open_dataset
from semidense.datasets.scene import DisparityRange, SceneSource

Source = TypeVar("Source", bound=SceneSource)
_PATTERN = "map:PATTERN[,scale=S][,none=V]@DATASET, such as map:maps/*.pfm@middlebury:DIR"


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes of a dataset that have a map, each with it.

    Raises:
        DatasetError: If the text cannot be understood, or a map is not valid.
    """
    maps, at, dataset = argument.partition("@")
    if not (at and dataset):
        raise DatasetError(f"map:{argument}: write {_PATTERN}")
    return with_maps(open_dataset(dataset).scenes, maps)


def with_maps(scenes: tuple[SceneSource, ...], maps: str) -> tuple[SceneSource, ...]:
    """Return those of the scenes that have a map, each with it.

    Args:
        scenes: The scenes.
        maps: ``PATTERN[,scale=S][,none=V]``: the path of the maps, with one ``*`` for the scene's name, or for its last
            part after a slash; the stored value of 1 px and of none, unless they are to be recognised.

    Raises:
        LayoutError: If the pattern has not one ``*``, or no scene has a map.
        DatasetError: If the text cannot be understood, or a map is not valid or of another size than its scene.
    """
    sides, options = parse(maps)
    pattern, scale, none = sides[0], options.scale, options.none
    if len(sides) != 1 or options != PairOptions(scale=scale, none=none):
        raise DatasetError(f"{maps}: write PATTERN[,scale=S][,none=V], such as maps/*.pfm")
    if pattern.count("*") != 1:
        raise LayoutError(f"{pattern}: give the path of the maps with one * for the name of the scene")
    found = [(scene, path) for scene in scenes if (path := _map_of(scene.name, pattern))]
    if not found:
        raise LayoutError(f"{pattern}: no scene has a map; the first would be {pattern.replace('*', scenes[0].name)}")
    return tuple(with_map(scene, path, scale, none) for scene, path in found)


def _map_of(scene: str, pattern: str) -> Path | None:
    names = (scene, scene.rsplit("/", 1)[-1])
    paths = (Path(pattern.replace("*", name)).expanduser() for name in names)
    return next((path for path in paths if path.is_file()), None)


def with_map(source: SceneSource, path: Path, scale: float | None, none: float | None) -> SceneSource:
    """Return the scene with a disparity map of its left view, which has been read once.

    Raises:
        DatasetError: If the map is not valid, or of another size than the views.
    """
    known = read_once(source, str(path), stored_map(path), scale, none)
    return replace(known, files={**source.files, "disparity": path})


def read_once(source: Source, what: str, stored: NDArray[Any], scale: float | None, none: float | None) -> Source:
    """Return the scene with what a map's numbers mean and, if its own range is open, with that of the map.

    Raises:
        DatasetError: If what they mean cannot be told, or the map is of another size than the views.
    """
    _require_size(what, stored.shape, source.size)
    reading = Reading(recognised_scale(what, stored) if scale is None else scale, none)
    found = disparities(what, stored, reading, signed=scale is not None)
    known = replace(source, map_reading={"scale": reading.scale, "none": reading.none})
    if not source.open_ends:
        return known
    low, high = int(np.floor(np.nanmin(found))), int(np.ceil(np.nanmax(found)))
    return replace(known, disparities=DisparityRange(low, high), open_ends=())


def _require_size(what: str, shape: tuple[int, ...], size: tuple[int, int]) -> None:
    if shape[:2] == size:
        return
    told = f"{what}: {' x '.join(map(str, shape[:2]))} pixels, but the left view has {size[0]} x {size[1]}"
    if shape[:2] == size[::-1]:
        raise DatasetError(f"{told}; rows and columns are exchanged: save the map as (rows, columns)")
    ratio = size[1] / shape[1] if len(shape) > 1 else 0
    if ratio and round(shape[0] * ratio) == size[0]:
        raise DatasetError(f"{told}; enlarge the map by {ratio:.4g} and multiply its disparities by the same")
    raise DatasetError(f"{told}; give the map of this view")
