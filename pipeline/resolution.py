"""Fill in what a configuration leaves open: a scene's range of disparities, this machine's precision."""

from typing import Any

from pydantic import ValidationError

from datasets import SceneSource
from pipeline.config import one_line
from pipeline.errors import UsageError
from stages.precision import resolve
from stages.stage import Params


def resolved(params: Params, scene: SceneSource | None) -> Params:
    """Return the settings with what was left open filled in: the scene's range, this CPU's precision."""
    update: dict[str, Any] = {}
    if scene:
        _require_within(params, scene)
    if hasattr(params, "precision"):
        update["precision"] = resolve(params.precision)
    if scene and getattr(params, "d_min", 0) is None:
        update["d_min"] = scene.disparities.minimum
    if scene and getattr(params, "d_max", 0) is None:
        update["d_max"] = scene.disparities.maximum
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
