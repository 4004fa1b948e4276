"""Measure what each channel is worth: train matching-Nets on different channels, each from random weights."""

from collections.abc import Iterator

from semidense.datasets import Dataset, SceneSource
from semidense.pipeline.api import Task
from semidense.pipeline.comparison.rows import Judged, Row, raw_rows
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.results.result import Result

ABLATION = {
    "gray + rank + companion, trained alike": ("gray", "rank", "companion"),
    "gray + rank, trained alike": ("gray", "rank"),
    "gray + companion, trained alike": ("gray", "companion"),
    "gray only, trained alike": ("gray",),
}
"""matching-Nets that see different channels; the last is what MC-CNN sees."""


def ablation_request(task: Task, dataset: Dataset, training: tuple[SceneSource, ...]) -> Request:
    """Return the request for raw maps of matching-Nets that are trained alike, on different channels."""
    configs = {
        method: task.and_settings({"channels.use": channels}).configuration() for method, channels in ABLATION.items()
    }
    return Request(dataset, configs, "disparity", train=True, training=training, also=("truth",))


def ablation_rows(result: Result) -> Iterator[Row]:
    """Yield the rows of the raw maps of a run of ``ablation_request``."""
    targets = [(result.made[step_id], variant) for step_id, variant in result.plan.targets]
    truths = {made.step.scene: made.key for made, _ in targets if made.step.product == "truth"}
    for made, variant in targets:
        if made.step.product == "disparity":
            judged = Judged(made.step.scene, result.store.read(truths[made.step.scene]))
            yield from raw_rows(judged, variant, result.store.read(made.key)["disparity"])
