"""Close the ranges of disparities that nobody gave: by the product ``survey``, which looks at the images.

A pair whose range is open is planned in two rounds: up to ``survey`` first, and the rest once that is there.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from semidense.cache import Store
from semidense.datasets import Dataset, DisparityRange, SceneSource
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Planned, make_plan
from semidense.pipeline.plan.steps import Request, needs_range

Make = Callable[[Request], Mapping[str, Made]]
"""Makes what is requested."""


def close_ranges(request: Request, store: Store, make: Make | None = None) -> Request:
    """Return the request with the ranges of its scenes as their surveys estimate them.

    Args:
        request: what is to be made.
        store: the cache.
        make: makes surveys that are not cached; None leaves their scenes open.

    Raises:
        UsageError: if a survey finds no range.
        StageRefused: if an image cannot be read.
    """
    unknown = tuple(scene for scene in request.dataset.scenes if scene.open_ends)
    if not unknown or not needs_range(request.upto):
        return request
    surveys = replace(request, dataset=Dataset(request.dataset.spec, unknown), upto="survey")
    plan = make_plan(surveys, store)
    keys = {planned.step.scene: planned.key for planned in plan.steps if planned.state == "hit" and _is_survey(planned)}
    if make and plan.todo():
        keys = {made.step.scene: made.key for made in make(surveys).values() if _is_survey(made)}
    closed = {scene.name: _closed(scene, store, key) for scene in unknown if (key := keys.get(scene.name))}
    notes = tuple(f"{scene.name}: disparities {_told(scene)}, estimated from the images" for scene in closed.values())
    scenes = tuple(closed.get(scene.name, scene) for scene in request.dataset.scenes)
    return replace(request, dataset=Dataset(request.dataset.spec, scenes), notes=(*request.notes, *notes))


def _is_survey(each: Planned | Made) -> bool:
    return each.step.product == "survey"


def _told(scene: SceneSource) -> str:
    return f"{scene.disparities.minimum} to {scene.disparities.maximum} px"


def _closed(scene: SceneSource, store: Store, key: str) -> SceneSource:
    """Return the scene with its open ends as its survey estimates them."""
    low, high = np.asarray(store.arrays(key)["range"][...]).tolist()
    if np.isnan(low):
        raise UsageError(
            f"{scene.name}: too little in the two images agrees to estimate the range of disparities; give it, as in "
            "--min-disp 0 --max-disp 127 (match) or pair:...,d_min=0,d_max=127"
        )
    edge, known = scene.size[1] - 1, scene.disparities
    # What has no texture is not seen by the survey: it may widen a range that is half known, never take 0 out of it.
    least = int(low) if "maximum" in scene.open_ends else min(0, int(low))
    first = max(-edge, least) if "minimum" in scene.open_ends else known.minimum
    last = min(edge, int(high)) if "maximum" in scene.open_ends else known.maximum
    if first > last:
        raise UsageError(
            f"{scene.name}: disparities look like {low:g} to {high:g} px, which leaves nothing of the range that was "
            f"given; give both its ends"
        )
    return replace(scene, disparities=DisparityRange(first, last), open_ends=())
