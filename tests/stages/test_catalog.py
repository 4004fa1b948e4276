import inspect
import subprocess
import sys
from collections.abc import Sequence
from typing import get_args, get_origin, get_type_hints

import pytest

from semidense.stages.baselines.declaration import BASELINES, MATCHED
from semidense.stages.catalog import CATALOG, STAGES
from semidense.stages.stage import Stage

READ = {"images", "truth"}
"""Products that no stage makes."""
ALL = (*MATCHED, *CATALOG, *BASELINES)
stages = pytest.mark.parametrize("stage", ALL, ids=lambda stage: stage.product)


def test_every_product_comes_after_what_it_is_made_from() -> None:
    known = set(READ)
    for stage in ALL:
        assert set(stage.inputs) <= known, stage.product
        assert stage.product not in known, "no product twice"
        known.add(stage.product)
    assert list(STAGES) == [stage.product for stage in ALL]


@stages
def test_the_function_exists_and_takes_what_the_declaration_says(stage: Stage) -> None:
    parameters = list(inspect.signature(stage.function()).parameters)
    assert len(parameters) == (3 if stage.monitored else 2)
    assert ("monitor" in parameters) == stage.monitored


@stages
def test_the_section_has_defaults_and_every_field_a_description(stage: Stage) -> None:
    assert all(field.description and not field.is_required() for field in stage.params.model_fields.values())
    stage.params()  # raises if a default is outside its own limits


@stages
def test_the_outputs_are_declared_completely(stage: Stage) -> None:
    names = [output.name for output in stage.outputs]
    assert names and len(set(names)) == len(names)
    for output in stage.outputs:
        assert output.dims and output.units and output.about and set(output.chunks) <= set(output.dims)
    assert stage.tile_rows is None or (stage.tile_rows > 0 and stage.scope == "scene")


def test_declarations_load_neither_torch_nor_numba() -> None:
    """Planning and looking at the cache answer at once."""
    script = (
        "import sys, semidense.stages.catalog; sys.exit(', '.join({'torch', 'numba', 'scipy'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


@stages
def test_the_types_say_what_the_declaration_says(stage: Stage) -> None:
    """What a type checker sees of a stage's arrays, in and out, is what its declaration promises."""
    hints = get_type_hints(stage.function(), include_extras=True)
    assert set(get_type_hints(hints["inputs"])) == set(stage.inputs)
    if stage.compute.startswith("semidense."):
        assert list(get_type_hints(hints["return"])) and set(get_type_hints(hints["return"])) == {
            output.name for output in stage.outputs
        }


@stages
def test_the_inputs_are_typed_as_their_own_stages_make_them(stage: Stage) -> None:
    hints = get_type_hints(get_type_hints(stage.function())["inputs"])
    for product, kind in hints.items():
        arrays = get_type_hints(get_args(kind)[0] if get_origin(kind) is Sequence else kind)
        made = {output.name for output in STAGES[product].outputs} if product in STAGES else set(arrays)
        assert set(arrays) <= made, product
