"""Maps of other matchers, read from files, beside ours."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from semidense.datasets import Dataset
from semidense.datasets.pairs.maps import with_maps
from semidense.pipeline.api import Task
from semidense.pipeline.comparison.rows import Judged, Row, auc_rows, density_rows, equal_density, raw_rows
from semidense.pipeline.plan.presets import FOREIGN
from semidense.pipeline.plan.steps import Request
from semidense.stages.stage import Arrays


def map_requests(
    task: Task, dataset: Dataset, maps: Mapping[str, str], also: tuple[str, ...]
) -> Iterator[tuple[str, Request]]:
    """Yield the name of each set of maps, and the request that scores them.

    Args:
        task: gives the cache and the settings, over those of the preset ``foreign``.
        dataset: the scenes; those without a map are left out.
        maps: what `with_maps` takes, by name.
        also: further products of each scene.

    Raises:
        DatasetError: if a map is not valid, or no scene has one.
    """
    for name, pattern in maps.items():
        scenes = dataclasses.replace(dataset, scenes=with_maps(dataset.scenes, pattern))
        request = dataclasses.replace(task, dataset=scenes, scenes=(), preset=FOREIGN).request("semidense")
        yield name, dataclasses.replace(request, also=also)


def map_rows(
    name: str,
    judged: Judged,
    products: Mapping[str, Arrays],
    ours: Mapping[str, NDArray[np.float32]],
    experiments: Sequence[str],
) -> Iterator[Row]:
    """Yield the rows of one map: its error, what our score keeps of it, and how well the score orders its pixels.

    Args:
        name: of the matcher.
        judged: the scene.
        products: the map's ``disparity``, ``confidence`` and ``semidense``.
        ours: ``disparity`` and ``confidence`` of our own map, for its error at the same density.
        experiments: of ``EXPERIMENTS``.
    """
    disparity, kept = products["disparity"]["disparity"], products["semidense"]["disparity"]
    if "raw" in experiments:
        yield from raw_rows(judged, name, disparity)
    if "density" in experiments:
        for method, reported in ((name, disparity), (f"{name}, filtered by our score", kept)):
            yield from equal_density(density_rows(judged, method, reported), judged, ours)
    if "auc" in experiments:
        yield from auc_rows(judged, f"our score of {name}", products["confidence"]["confidence"], disparity)
