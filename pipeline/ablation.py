"""What the transforms are worth: matching-Nets that see different channels, trained alike from nothing."""

from collections.abc import Iterable

from datasets import Dataset, SceneSource
from pipeline.api import Task
from pipeline.config import Config
from pipeline.steps import Request

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
        method: Config.load(task.config, [*task.settings, f"channels.use={_as_list(channels)}"])
        for method, channels in ABLATION.items()
    }
    return Request(dataset, configs, "disparity", train=True, training=training, also=("truth",))


def _as_list(channels: Iterable[str]) -> str:
    return "[" + ", ".join(f'"{channel}"' for channel in channels) + "]"
