"""Fill in what a configuration leaves open, and refuse what does not go together."""

from typing import Any

from pydantic import ValidationError

from semidense.datasets import SceneSource
from semidense.pipeline.plan.config import Config, one_line
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.compute.precision import resolve
from semidense.stages.stage import Params
from semidense.stages.transforms.declaration import ChannelsParams


def resolved(params: Params, scene: SceneSource | None) -> Params:
    """Return the settings with what was left open filled in: the scene's range, this CPU's precision."""
    update: dict[str, Any] = {}
    if scene:
        _require_within(params, scene)
    if hasattr(params, "precision"):
        update["precision"] = resolve(params.precision, transformed=getattr(params, "transformed", False))
    if scene and getattr(params, "d_min", 0) is None:
        update["d_min"] = max(scene.disparities.minimum, 1 - scene.size[1])
    if scene and getattr(params, "d_max", 0) is None:
        update["d_max"] = min(scene.disparities.maximum, scene.size[1] - 1)  # a file may claim any number
    try:
        return type(params).model_validate(dict(params) | update)
    except ValidationError as error:
        raise UsageError(f"{scene.name if scene else 'training split'}: {one_line(error)}") from None


def _require_within(params: Params, scene: SceneSource) -> None:
    """Refuse a range that no pixel of the image can have: it would only fill memory and disk."""
    width = scene.size[1]
    for name in ("d_min", "d_max"):
        value = getattr(params, name, None)
        if value is not None and abs(value) >= width:
            raise UsageError(f"{scene.name}: {name} is {value} px, but the image is only {width} px wide")


def require_trainable(config: Config, product: str) -> None:
    """Refuse to train with another light on the gray channel where there is none: it would fall on another channel.

    Raises:
        UsageError: if the product's ``relight`` is on and ``channels.use`` leaves gray out.
    """
    if getattr(config.section(product), "relight", 0) and "gray" not in config.of("channels", ChannelsParams).use:
        raise UsageError(
            f"{product}.relight changes the light of the gray channel, which channels.use leaves out: "
            f"set {product}.relight=0"
        )
