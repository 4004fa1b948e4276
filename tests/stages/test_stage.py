import dataclasses

import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.baselines.declaration import CheckedParams, SgmParams, WindowParams
from semidense.stages.evaluation.silence.declaration import DistinctivenessParams
from semidense.stages.matching.declaration import CostVolumeParams
from semidense.stages.stage import (
    NoParams,
    Output,
    Params,
    RangeParams,
    Silent,
    Stage,
    StageError,
    by_scene,
    require_shape,
)

OUTPUT = Output("total", ("y", "x"), "float32", "1", "a sum")
STAGE = Stage("total", ("images",), (OUTPUT,), "json.decoder:JSONDecoder")


class Section(Params):
    width: int = 3


def test_the_function_is_imported_by_its_name() -> None:
    from json.decoder import JSONDecoder

    assert STAGE.module == "json.decoder"
    assert STAGE.function() is JSONDecoder


def test_a_function_that_is_not_there_is_named() -> None:
    with pytest.raises(AttributeError, match="no_such_function"):
        dataclasses.replace(STAGE, compute="json:no_such_function").function()


def test_the_defaults_are_those_of_a_plain_stage_of_a_scene() -> None:
    assert (STAGE.params, STAGE.scope, STAGE.tile_rows, STAGE.border, STAGE.monitored) == (
        NoParams,
        "scene",
        None,
        "cut",
        False,
    )
    assert STAGE.halo(NoParams()) == 0 and STAGE.sizes(NoParams()) == {} and OUTPUT.chunks == {}


def test_declarations_and_sections_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        STAGE.product = "other"  # type: ignore[misc]
    with pytest.raises(ValidationError, match="frozen"):
        Section().width = 4  # type: ignore[misc]


def test_a_section_refuses_what_it_does_not_know() -> None:
    with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
        Section.model_validate({"height": 4})


@pytest.mark.parametrize("section", [CheckedParams, CostVolumeParams, DistinctivenessParams, SgmParams, WindowParams])
def test_a_range_is_the_right_way_round(section: type[RangeParams]) -> None:
    assert section(d_min=-2, d_max=-2).disparities == range(-2, -1)
    with pytest.raises(ValidationError, match="d_max 2 lies below d_min 9"):
        section(d_min=9, d_max=2)
    assert list(section.model_fields)[:2] == ["d_min", "d_max"]


@pytest.mark.parametrize("ends", [{}, {"d_min": 0}, {"d_max": 9}])
def test_an_open_range_has_no_disparities(ends: dict[str, int]) -> None:
    with pytest.raises(StageError, match="disparity range has an open end: give d_min and d_max"):
        assert RangeParams(**ends).disparities


def test_by_scene() -> None:
    scenes = [{"left": np.zeros(1)}]
    assert by_scene(scenes, "images") is scenes
    with pytest.raises(StageError, match="no training scene has 'images': name a dataset with a training split"):
        by_scene([], "images")


@pytest.mark.parametrize("shape", [(), (3,), (3, 4, 5)])
def test_require_shape(shape: tuple[int, ...]) -> None:
    require_shape("costs", np.zeros((3, 4)), 2)
    with pytest.raises(StageError, match=r"costs has shape \(.*\), expected 2 dimensions"):
        require_shape("costs", np.zeros(shape), 2)


def test_an_error_is_one_that_a_caller_would_catch() -> None:
    assert issubclass(StageError, ValueError)


def test_the_silent_monitor_keeps_nothing() -> None:
    monitor = Silent()
    monitor.progress(1, 2, "loss")
    monitor.save(b"state")
    assert monitor.load() is None
