from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from semidense.cache import ABSENT, Change, Store
from semidense.pipeline.cli.console import why
from semidense.pipeline.plan.causes import Causes
from semidense.pipeline.plan.plan import Plan
from semidense.pipeline.plan.steps import Graph
from tests.pipeline.toy import BLURRED, RAMP, SUM, Offset, chain, graph, step

ToyPlan = Callable[..., Plan]
ToyRun = Callable[..., object]


def reasons(plan: Plan) -> list[str]:
    return [why(planned) for planned in plan.steps]


def test_every_product_below_names_the_same_cause(toy_run: ToyRun, toy_plan: ToyPlan) -> None:
    toy_run(chain(offset=1))
    assert reasons(toy_plan(chain(offset=2))) == ["", "blurred.offset: 1 -> 2", "blurred.offset: 1 -> 2"]


def test_an_input_that_is_there_is_followed_to_its_cause(toy_run: ToyRun, toy_plan: ToyPlan) -> None:
    toy_run(chain(start=1))
    toy_run(graph(step(RAMP, 2)))
    blurred = toy_plan(chain(start=2)).steps[1]
    assert blurred.changed[0].field == "inputs.ramp"
    assert why(blurred) == "ramp.argument: 1 -> 2"


def test_an_input_that_is_gone_is_named(toy_run: ToyRun, toy_plan: ToyPlan, store: Store) -> None:
    from semidense.cache.upkeep.gc import collect, survey
    from semidense.cache.upkeep.limits import Limits

    toy_run(chain())
    items = [
        item for item in survey(store, Limits(seconds=-1)).items if item.entry and item.entry.recipe.stage == "ramp"
    ]
    collect(store, items)
    assert reasons(toy_plan(chain())) == ["never made", *["ramp is not there any more"] * 2]


def test_forcing_is_a_cause(toy_run: ToyRun, toy_plan: ToyPlan) -> None:
    toy_run(chain())
    assert reasons(toy_plan(chain(), "ramp"))[0] == "asked for by --force"


def with_code(code: str) -> Graph:
    ramp = step(RAMP, 0)
    blurred = replace(step(BLURRED, Offset(), ramp=ramp), code={"semidense.cache.keys.recipe": code})
    return graph(ramp, blurred, step(SUM, blurred=blurred))


def test_a_change_of_code_names_file_function_and_lines(toy_run: ToyRun, toy_plan: ToyPlan, store: Store) -> None:
    from semidense.cache.keys.code import source_text
    from semidense.cache.keys.trees import source_hash

    text = source_text("semidense.cache.keys.recipe")
    assert text
    old = text.replace('return f"{self.field}: ', 'return f"{self.field} = ')
    toy_run(with_code(source_hash(old)))
    path = store.layout.source(source_hash(old))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(old)
    said = why(toy_plan(with_code(source_hash(text))).steps[1])
    assert said.startswith("code cache/keys/recipe.py Change.__str__() line ")
    assert "{self.field} = " in said.split(" -> ")[0]
    assert "\n" not in said


def test_without_the_old_text_the_module_is_named(toy_run: ToyRun, toy_plan: ToyPlan) -> None:
    toy_run(with_code("ab" * 32))
    assert reasons(toy_plan(with_code("cd" * 32)))[1] == "code cache/keys/recipe.py: abababababab -> cdcdcdcdcdcd"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (Change("params.files.left", "ab" * 32, "cd" * 32), "input file left /x/im0.png: abababababab -> cdcdcdcdcdcd"),
        (Change("params.shipped", "ab" * 32, "cd" * 32), "weights of ramp: abababababab -> cdcdcdcdcdcd"),
        (Change("params.precision", "float32", "bfloat16"), "ramp.precision: float32 -> bfloat16"),
        (Change("environment.torch", "2", "3"), "torch: 2 -> 3"),
        (Change("code.cache.none", "(absent)", "cd" * 32), "code of cache.none is now part of it"),
        (Change("code.cache.none", "cd" * 32, "(absent)"), "code of cache.none is no longer part of it"),
        (Change("inputs.images", ["a", "b"], ["a"]), "content of images: 2 scenes -> 1 scenes"),
    ],
)
def test_each_ingredient_is_named_as_the_user_knows_it(store: Store, change: Change, text: str) -> None:
    made = step(RAMP, SimpleNamespace(files={"left": Path("/x/im0.png")}))
    assert Causes(store, ()).of(made, [change], {}) == (text,)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        pytest.param("fast", ABSENT, "costvolume.mode: fast -> exact", id="back to the default"),
        pytest.param(ABSENT, "guided", "costvolume.mode: exact -> guided", id="away from it"),
    ],
)
def test_a_setting_that_a_recipe_leaves_out_is_told_by_its_default(store: Store, old: str, new: str, text: str) -> None:
    made = step(replace(RAMP, product="costvolume"), SimpleNamespace(files={}))
    assert Causes(store, ()).of(made, [Change("params.mode", old, new)], {}) == (text,)
