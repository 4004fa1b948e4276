"""The planner on toy steps, and on the real ones where it matters what depends on what."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from semidense.cache import Store
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.plan import steps
from semidense.pipeline.plan.causes import PENDING
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.results.result import Result
from tests.pipeline.toy import CALLS, chain, changes, states
from tests.tiny import PATH

ToyPlan = Callable[..., Plan]
ToyRun = Callable[..., dict[str, Made]]


def test_an_empty_cache_misses_everything_and_planning_changes_nothing(toy_plan: ToyPlan, store: Store) -> None:
    plan = toy_plan(chain())
    assert states(plan) == dict.fromkeys(("ramp", "blurred", "sum"), "missing")
    assert plan.todo() == plan.steps
    assert not store.root.exists()
    assert CALLS == []


def test_a_key_is_open_until_its_inputs_are_there(toy_plan: ToyPlan) -> None:
    ramp, blurred, total = toy_plan(chain()).steps
    assert ramp.key is not None
    assert (blurred.key, total.key) == (None, None)
    assert [change.new for change in blurred.changed] == [PENDING]


def test_all_is_a_hit_after_a_run(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    made = toy_run(chain())
    plan = toy_plan(chain())
    assert states(plan) == dict.fromkeys(("ramp", "blurred", "sum"), "hit")
    assert {each.step.product: (each.key, each.digest) for each in plan.steps} == {
        product: (each.key, each.digest) for product, each in made.items()
    }
    assert plan.todo() == ()


def test_a_changed_setting_is_named_old_and_new(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain(offset=1))
    ramp, blurred, total = toy_plan(chain(offset=2)).steps
    assert (ramp.state, blurred.state, total.state) == ("hit", "stale", "stale")
    assert changes(blurred) == ["params.offset: 1 -> 2"]
    assert changes(total) == [f"inputs.blurred: (absent) -> {PENDING}"]


def test_of_several_earlier_results_the_nearest_is_compared_with(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain(offset=1, reach=1))
    toy_run(chain(offset=5, reach=0))
    assert changes(toy_plan(chain(offset=2, reach=1)).steps[1]) == ["params.offset: 1 -> 2"]


def test_own_changes_of_a_step_whose_inputs_are_open_are_named_too(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain(start=0, offset=1))
    blurred = toy_plan(chain(start=7, offset=2)).steps[1]
    assert changes(blurred) == ["params.offset: 1 -> 2", f"inputs.ramp: (absent) -> {PENDING}"]


def test_changed_code_is_named_by_its_module(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain(code="1f"))
    ramp, blurred, _ = toy_plan(chain(code="2e")).steps
    assert ramp.state == "hit"
    assert changes(blurred) == ["code.make_blurred: 1f -> 2e"]


def test_an_earlier_result_of_another_scene_is_no_reason(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain(offset=1))
    graph = chain(offset=2)
    for name, each in graph.steps.items():
        graph.steps[name] = replace(each, scene="Other")
    assert toy_plan(graph).steps[1].state == "missing"


def test_a_forced_product_alone_is_stale_although_it_is_there(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(chain())
    plan = toy_plan(chain(), "blurred")
    assert states(plan) == {"ramp": "hit", "blurred": "stale", "sum": "hit"}
    assert changes(plan.steps[1]) == ["forced: (absent) -> blurred"]


def test_a_product_that_cannot_be_forced_is_refused(toy_plan: ToyPlan) -> None:
    with pytest.raises(UsageError, match=r"no product 'blured' to force; did you mean blurred\?"):
        toy_plan(chain(), "blured")


@pytest.mark.parametrize("verify", ["full", "size"])
def test_a_damaged_entry_is_told_apart_and_left_alone(
    verify: str, toy_plan: ToyPlan, toy_run: ToyRun, store: Store
) -> None:
    key = toy_run(chain())["blurred"].key
    chunk = next(path for path in sorted(store.layout.entry(key).rglob("c/*/*")) if path.is_file())
    chunk.parent.chmod(0o700)
    chunk.unlink()
    object.__setattr__(store, "verify", verify)
    _, blurred, below = toy_plan(chain()).steps
    assert blurred.state == "stale"
    assert blurred.damage is not None
    assert re.fullmatch(r"data\.zarr\S+ is missing", blurred.damage)
    assert blurred.causes == below.causes == (f"blurred is damaged: {blurred.damage}",)
    assert store.layout.entry(key).is_dir(), "looking at it does not move it"


def test_a_damaged_record_is_a_missing_entry(toy_plan: ToyPlan, toy_run: ToyRun, store: Store) -> None:
    record = store.layout.record(toy_run(chain())["sum"].key)
    record.chmod(0o600)
    record.write_bytes(record.read_bytes()[:-5])
    assert states(toy_plan(chain())) == {"ramp": "hit", "blurred": "hit", "sum": "missing"}


# What depends on what, with the real stages and a whole run in the cache.

ABOVE_CHANNELS = {"images", "truth", "matching_samples", "distinctiveness"}
BELOW_DISPARITY = {"confidence", "semidense", "ranking", "metrics"}
ALL = PATH


def not_hit(plan: Plan) -> set[str]:
    return {planned.step.product for planned in plan.todo()}


def test_the_run_s_own_plan_is_all_hits(trained_task: Task) -> None:
    assert not_hit(api.status(trained_task)) == set()


@pytest.mark.parametrize(
    ("setting", "stale", "change"),
    [
        ("channels.rank_window=15", ALL - ABOVE_CHANNELS, "params.rank_window: 31 -> 15"),
        ("channels.companion_rays=4", ALL - ABOVE_CHANNELS, "params.companion_rays: 8 -> 4"),
        ("matching_samples.seed=1", ALL - {"images", "truth", "channels", "distinctiveness"}, "params.seed: 0 -> 1"),
        ("matching_net.steps=3", ALL - ABOVE_CHANNELS - {"channels"}, "params.steps: 2 -> 3"),
        ("costvolume.d_max=7", ALL - ABOVE_CHANNELS - {"channels", "matching_net"}, "params.d_max: 8 -> 7"),
        (
            "disparity.subpixel=true",
            {"disparity", "evaluation_samples", "evaluation_net"} | BELOW_DISPARITY,
            "params.subpixel: false -> true",
        ),
        (
            "evaluation_samples.seed=1",
            {"evaluation_samples", "evaluation_net"} | BELOW_DISPARITY,
            "params.seed: 0 -> 1",
        ),
        ("evaluation_net.clip=2", {"evaluation_net"} | BELOW_DISPARITY, "params.clip: 1.0 -> 2.0"),
        ("semidense.R=0.5", {"semidense", "metrics"}, "params.R: 0.9 -> 0.5"),
        ("matching_net.checkpoint_steps=1", set(), None),
        ("semidense.R=0.9", set(), None),
        ("costvolume.d_max=8", set(), None),
    ],
    ids=lambda value: value if isinstance(value, str) and "=" in value else "",
)
def test_a_setting_makes_stale_exactly_what_depends_on_it(
    trained_task: Task, setting: str, stale: set[str], change: str | None
) -> None:
    plan = api.status(replace(trained_task, settings=(*trained_task.settings, setting)))
    assert not_hit(plan) == stale
    first = setting.partition(".")[0]
    told = {str(each) for planned in plan.steps if planned.step.product == first for each in planned.changed}
    assert told - {text for text in told if PENDING in text} == ({change} if change else set())
    assert {planned.state for planned in plan.todo()} <= {"stale"}


@pytest.mark.parametrize(
    ("module", "stale"),
    [
        ("semidense.stages.transforms.rank", ALL - ABOVE_CHANNELS),
        ("semidense.stages.matching.train", ALL - ABOVE_CHANNELS - {"channels"}),
        ("semidense.stages.matching.cost_volume", ALL - ABOVE_CHANNELS - {"channels", "matching_net"}),
        (
            "semidense.stages.disparity.winner_takes_all",
            {"disparity", "right_disparity", "evaluation_samples", "evaluation_net"} | BELOW_DISPARITY,
        ),
        ("semidense.stages.evaluation.filtering", {"semidense", "metrics"}),
        ("semidense.stages.metrics.stage", {"metrics"}),
        ("semidense.stages.metrics.confidence", {"ranking", "metrics"}),
        ("semidense.datasets.synthetic.scenes", ALL),
        ("semidense.pipeline.cli.console", set()),
        ("semidense.pipeline.execution.scheduler", set()),
        ("semidense.cache.entries.publish", set()),
    ],
)
def test_an_edit_makes_stale_exactly_what_runs_that_code(
    trained_task: Task, monkeypatch: pytest.MonkeyPatch, module: str, stale: set[str]
) -> None:
    real = steps.code_parts

    def edited(name: str, packages: tuple[str, ...]) -> dict[str, str]:
        return {part: "0" * 64 if part == module else value for part, value in real(name, packages).items()}

    monkeypatch.setattr(steps, "code_parts", edited)
    plan = api.status(trained_task)
    assert not_hit(plan) == stale
    named = {change.field for planned in plan.steps for change in planned.changed if change.new != PENDING}
    assert named == ({f"code.{module}"} if stale else set())


def test_no_product_depends_on_the_runner(trained: Result) -> None:
    for made in trained.made.values():
        runner = {name for name in made.step.code if name.startswith(("semidense.pipeline", "semidense.cache"))}
        own = (
            {"semidense.pipeline", "semidense.pipeline.plan", made.step.stage.module}
            if made.step.product in ("images", "truth")
            else set()
        )
        assert runner <= own


def test_a_source_file_that_changes_makes_its_scene_stale(
    weights: Path, tmp_path: Path, make_pair: Callable[[Path], Path]
) -> None:
    folder = make_pair(tmp_path / "pair")
    task = Task(f"middlebury:{folder}", cache=tmp_path / "cache")
    api.run(task, "channels")
    before = (folder / "im1.png").stat()
    os.utime(folder / "im1.png", (0, 0))
    assert not_hit(api.status(task, "channels")) == set(), "a time is no content"
    (folder / "im1.png").write_bytes((folder / "im0.png").read_bytes())
    os.utime(folder / "im1.png", ns=(before.st_atime_ns, before.st_mtime_ns))
    plan = api.status(task, "channels")
    assert not_hit(plan) == {"images", "channels"}
    assert [change.field for change in plan.steps[0].changed] == ["params.files.right"]


def test_an_unknown_product_is_refused(trained_task: Task) -> None:
    request: Request = trained_task.request("metrics")
    with pytest.raises(UsageError, match=r"no product 'disparities'; did you mean disparity\?"):
        Request(request.dataset, request.configs, "disparities")
