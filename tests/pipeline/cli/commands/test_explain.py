from collections.abc import Callable

import pytest

from semidense.cache import Store
from semidense.pipeline.api import Task, explain
from semidense.pipeline.cli.commands.explain import explanation, print_explanation
from semidense.pipeline.plan.plan import Plan
from semidense.pipeline.results.result import Result
from tests.pipeline.toy import chain


def test_a_hit_is_explained_by_its_entry(trained: Result, trained_task: Task) -> None:
    found = explanation(explain(trained_task, "semidense"), trained.store)
    assert found["state"] == "hit"
    settings = {"R": 0.9, "density": None, "max_error": None, "calibrated": False}
    assert found["recipe"]["params"] == settings | {"tiles": "whole"}
    assert found["digest"] == trained.find("semidense").digest
    assert found["bytes"] > 0
    assert "numpy" in found["extras"]["versions"]


def test_a_step_whose_inputs_are_not_there_is_explained_by_its_own_part(
    toy_plan: Callable[..., Plan], store: Store
) -> None:
    found = explanation(toy_plan(chain(offset=3)).steps[1], store)
    assert (found["state"], found["key"]) == ("missing", None)
    assert found["recipe"]["inputs"] == {"ramp": "open"}
    assert found["recipe"]["params"]["offset"] == 3
    assert "digest" not in found


def test_a_stale_step_says_what_changed(
    toy_plan: Callable[..., Plan],
    toy_run: Callable[..., object],
    store: Store,
    capsys: pytest.CaptureFixture[str],
) -> None:
    toy_run(chain(offset=1))
    found = explanation(toy_plan(chain(offset=2)).steps[1], store)
    assert found["changed"] == [{"field": "params.offset", "old": 1, "new": 2}]
    print_explanation(found)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "blurred of Toy: stale"
    assert "changed params.offset: 1 -> 2" in lines
    assert "  offset = 2" in lines


def test_long_hashes_are_cut_and_many_are_counted(
    trained: Result, trained_task: Task, capsys: pytest.CaptureFixture[str]
) -> None:
    found = explanation(explain(trained_task, "costvolume"), trained.store)
    print_explanation(found | {"recipe": found["recipe"] | {"inputs": {"images": ["ab" * 32] * 29}}})
    lines = capsys.readouterr().out.splitlines()
    assert "  images = abababababab and 28 more" in lines
    own = lines[: lines.index("made from")]
    assert max(len(line) for line in own if "key " not in line and "digest" not in line) < 100


def test_the_preset_is_told_with_its_settings(
    trained: Result, trained_task: Task, capsys: pytest.CaptureFixture[str]
) -> None:
    found = explanation(explain(trained_task, "disparity"), trained.store)
    print_explanation(found | {"preset": {"name": "robust", "settings": ["a.b=1", "c.d=2"]}})
    assert "preset  robust: a.b=1 c.d=2" in capsys.readouterr().out.splitlines()
