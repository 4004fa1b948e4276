import pickle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.cache.document import canonical, parse
from semidense.cache.errors import InvalidRecipe
from semidense.cache.keys.recipe import ABSENT, Change, Recipe, differences

BASE: dict[str, Any] = {
    "stage": "rank",
    "code": {"stages.rank": "1f", "stages.gray": "2f"},
    "params": {"rank_window": 31, "rays": [4, 8], "nested": {"a": 1.0}},
    "inputs": {"images": "aa", "truth": {"Teddy": "bb"}, "nets": ["cc", "dd"]},
    "environment": {"torch": "2"},
}
texts = st.dictionaries(st.text(max_size=3), st.text(max_size=3), max_size=3)
recipes = st.builds(Recipe, st.text(min_size=1, max_size=3), texts, texts, texts, texts)


def recipe(**changed: object) -> Recipe:
    return Recipe(**{**BASE, **changed})


def test_key_is_pinned() -> None:
    # the canonical JSON of [version, stage, code, params, inputs, environment], through sha256sum
    simple = Recipe("rank", {"m": "1f"}, {"w": 31}, {"images": "ab"}, {"torch": "2"})
    assert canonical(simple.to_dict()) == (
        '{"code":{"m":"1f"},"environment":{"torch":"2"},"inputs":{"images":"ab"},'
        '"params":{"w":31},"stage":"rank","version":1}'
    )
    assert simple.key == "6b5e42294803a2287456580bbbce6b413a02f40aaf5b05871fb5ad99b80c6a7c"


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param({"stage": "rank2"}, id="stage"),
        pytest.param({"code": {**BASE["code"], "stages.gray": "3f"}}, id="code of a helper"),
        pytest.param({"code": {"stages.rank": "1f"}}, id="a module less"),
        pytest.param({"params": {**BASE["params"], "rank_window": 31.0}}, id="a parameter's type"),
        pytest.param({"params": {**BASE["params"], "rays": [8, 4]}}, id="order in a list"),
        pytest.param({"inputs": {**BASE["inputs"], "images": "ab"}}, id="an input's digest"),
        pytest.param({"inputs": {**BASE["inputs"], "truth": {"Cones": "bb"}}}, id="an input's scene"),
        pytest.param({"environment": {"torch": "3"}}, id="environment"),
        pytest.param({"version": 2}, id="format version"),
    ],
)
def test_each_ingredient_changes_the_key(changed: dict[str, Any]) -> None:
    assert recipe(**changed).key != recipe().key
    assert differences(recipe(), recipe(**changed))


def test_order_and_tuples_do_not_change_the_key() -> None:
    params = {"nested": {"a": 1.0}, "rays": (4, 8), "rank_window": 31}
    assert recipe(params=params) == recipe()
    assert recipe(params=params).key == recipe().key


def test_a_recipe_does_not_follow_its_arguments() -> None:
    params: dict[str, Any] = {"window": [1]}
    made = recipe(params=params)
    params["window"].append(2)
    assert made.params == {"window": [1]}


@settings(max_examples=40, deadline=None)
@given(recipes)
def test_json_round_trips(made: Recipe) -> None:
    again = Recipe.from_dict(parse(canonical(made.to_dict())))
    assert (again, again.key) == (made, made.key)


@settings(max_examples=40, deadline=None)
@given(recipes, recipes)
def test_no_differences_means_the_same_key(first: Recipe, second: Recipe) -> None:
    assert (differences(first, second) == []) == (first.key == second.key)


def test_pickles() -> None:
    made = recipe()
    assert pickle.loads(pickle.dumps(made)).key == made.key


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param({"stage": ""}, id="no name"),
        pytest.param({"stage": None}, id="name of another type"),
        pytest.param({"code": {"m": 1}}, id="a hash that is not text"),
        pytest.param({"code": "1f"}, id="code not a mapping"),
        pytest.param({"params": {"a": float("nan")}}, id="NaN"),
        pytest.param({"params": {"a": {1}}}, id="a set"),
        pytest.param({"inputs": {"images": 3}}, id="a digest that is not text"),
        pytest.param({"inputs": {"images": [["a"]]}}, id="digests nested too deep"),
        pytest.param({"environment": {"torch": 2}}, id="environment not text"),
        pytest.param({"version": "1"}, id="version not a number"),
    ],
)
def test_refuses(changed: dict[str, Any]) -> None:
    with pytest.raises(InvalidRecipe, match=r"^[^\n]+$"):
        recipe(**changed)


@pytest.mark.parametrize(
    "fields",
    [
        pytest.param({}, id="no fields"),
        pytest.param({name: value for name, value in recipe().to_dict().items() if name != "version"}, id="no version"),
        pytest.param({**recipe().to_dict(), "more": 1}, id="unknown field"),
    ],
)
def test_from_dict_refuses(fields: dict[str, Any]) -> None:
    with pytest.raises(InvalidRecipe, match="not a recipe"):
        Recipe.from_dict(fields)


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        pytest.param(
            {"params": {**BASE["params"], "rank_window": 15}}, Change("params.rank_window", 31, 15), id="parameter"
        ),
        pytest.param(
            {"params": {**BASE["params"], "nested": {"a": 2.0}}}, Change("params.nested.a", 1.0, 2.0), id="nested"
        ),
        pytest.param(
            {"code": {**BASE["code"], "stages.rank": "9f"}}, Change("code.stages.rank", "1f", "9f"), id="module"
        ),
        pytest.param({"code": {"stages.rank": "1f"}}, Change("code.stages.gray", "2f", ABSENT), id="module gone"),
        pytest.param(
            {"inputs": {**BASE["inputs"], "nets": ["cc"]}}, Change("inputs.nets", ["cc", "dd"], ["cc"]), id="list"
        ),
        pytest.param(
            {"inputs": {**BASE["inputs"], "truth": {"Teddy": "b2"}}},
            Change("inputs.truth.Teddy", "bb", "b2"),
            id="scene",
        ),
        pytest.param({"environment": {"torch": "3"}}, Change("environment.torch", "2", "3"), id="environment"),
        pytest.param({"stage": "other"}, Change("stage", "rank", "other"), id="stage"),
    ],
)
def test_differences_name_the_field(changed: dict[str, Any], expected: Change) -> None:
    assert differences(recipe(), recipe(**changed)) == [expected]


def test_a_change_reads_well() -> None:
    assert str(Change("params.window", 31, 15)) == "params.window: 31 -> 15"
    assert str(Change("inputs.images", "ab" * 32, "cd" * 32)) == "inputs.images: abababababab -> cdcdcdcdcdcd"
