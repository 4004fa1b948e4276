import pickle
from dataclasses import replace
from typing import Any

import cloudpickle
import numpy as np
import pytest

from semidense.cache import CacheUnavailable, Store
from semidense.cache.processes.lease import FolderLease
from semidense.datasets import DatasetError
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.checkpoints import Checkpoints
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.jobs import Context, Job, explained
from semidense.pipeline.execution.tiles import Rows
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.environment import cpu_name
from semidense.pipeline.plan.errors import StageFailed, StageRefused, UsageError
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step
from semidense.stages.stage import Output
from tests.pipeline import toy
from tests.pipeline.toy import BLURRED, RAMP, SUM, Offset, step


class Seen:
    """A watch that remembers."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []

    def begun(self, step: Step, tiles: int) -> None:
        self.told.append(("begun", step.product, tiles))

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        self.told.append(("advanced", step.product, done, total, note))

    def published(self, made: Made) -> None:
        self.told.append(("published", made.step.product, made.reused))


@pytest.fixture
def seen() -> Seen:
    return Seen()


@pytest.fixture
def context(store: Store, seen: Seen) -> Context:
    return Context(store, seen, {"by": "test"}, Claims(FolderLease(store.layout.root, None)))


def whole(context: Context, each: Step, *inputs: Made, forced: bool = False) -> Made:
    job = tasks.begin(context, each, inputs, forced, 1)
    tasks.make_whole(context, job)
    return tasks.publish(context, job, [])


def test_a_product_is_begun_made_and_published(context: Context, seen: Seen) -> None:
    made = whole(context, step(RAMP, 5))
    assert context.store.read(made.key)["values"][0].tolist() == [5, 6, 7, 8]
    assert seen.told == [("begun", "ramp", 1), ("advanced", "ramp", 1, 1, ""), ("published", "ramp", False)]
    entry = context.store.require(made.key)
    assert entry.label == {"product": "ramp", "dataset": "toys", "scene": "Toy"}
    assert dict(entry.extras) == {
        "by": "test", "cpu": cpu_name(), "configuration": {}, "image_size": [10, 4],
    }  # fmt: skip


def test_what_is_there_gives_a_finished_job(context: Context, seen: Seen) -> None:
    first = whole(context, step(RAMP, 5))
    toy.CALLS.clear()
    again = whole(context, step(RAMP, 5))
    assert (again.key, again.digest, again.reused) == (first.key, first.digest, True)
    assert toy.CALLS == []
    assert seen.told[-1] == ("published", "ramp", True)


def test_a_tiled_product_is_written_tile_by_tile(context: Context) -> None:
    ramp = whole(context, step(RAMP, 0))
    blurred = step(BLURRED, Offset(reach=1), ramp=ramp.step)
    job = tasks.create_arrays(tasks.begin(context, blurred, [ramp], False, 3))
    for rows in (Rows(8, 10, 10), Rows(0, 4, 10), Rows(4, 8, 10)):
        tasks.make_tile(context, job, rows)
    made = tasks.publish(context, job, [None] * 3)
    values = context.store.read(made.key)["values"]
    assert values[:3, 0].tolist() == [0 + 0 + 4, 0 + 4 + 8, 4 + 8 + 12]
    assert values[-1, 0] == 32 + 36 + 36


def test_arrays_have_dims_units_and_a_line_for_people(context: Context) -> None:
    made = whole(context, step(RAMP, 0))
    array = context.store.open(made.key)["values"]
    assert (array.dims, array.attrs) == (("y", "x"), {"units": "px", "long_name": "numbers"})


@pytest.mark.parametrize(("tile_rows", "count"), [(None, 1), (4, 3), (5, 2), (10, 1), (64, 1)])
def test_tiles_are_counted_as_they_are_cut(tile_rows: int | None, count: int) -> None:
    assert step(replace(BLURRED, tile_rows=tile_rows)).tiles == count


def test_a_step_of_the_split_is_one_tile() -> None:
    assert replace(step(BLURRED), size=None).tiles == 1


def test_a_dtype_is_stored_as_declared_or_else_as_computed(context: Context) -> None:
    narrow = replace(RAMP, outputs=(Output("values", ("y", "x"), "float16", "px", "numbers"),))
    open_ended = replace(RAMP, outputs=(Output("values", ("y", "x"), None, "px", "numbers"),))
    dtypes = [context.store.open(whole(context, step(each, 0, code)).key)["values"].dtype
              for each, code in ((narrow, "a1"), (open_ended, "b2"))]  # fmt: skip
    assert dtypes == [np.float16, np.float32]


def test_a_monitored_stage_reports_and_its_checkpoint_is_gone_at_the_end(context: Context, seen: Seen) -> None:
    trained = replace(SUM, inputs=(), compute="tests.pipeline.toy:train_toy", monitored=True)
    job = tasks.begin(context, step(trained), [], False, 1)
    assert job.draft is not None
    checkpoint = Checkpoints(context.store.checkpoint(job.draft.recipe.key))
    tasks.make_whole(context, job)
    assert checkpoint.load() == bytes([3])
    tasks.publish(context, job, [])
    assert checkpoint.load() is None
    assert [told[2:] for told in seen.told if told[0] == "advanced"][:3] == [(n, 3, "loss 0.5") for n in (1, 2, 3)]


@pytest.mark.parametrize(
    ("error", "kind", "text"),
    [
        pytest.param(RuntimeError("bang"), StageFailed, "ramp of Toy, rows 0-3: RuntimeError: bang", id="a fault"),
        pytest.param(KeyError(), StageFailed, "ramp of Toy, rows 0-3: KeyError", id="a fault without words"),
        pytest.param(DatasetError("bad file"), StageRefused, "ramp of Toy, rows 0-3: bad file", id="bad data"),
        pytest.param(UsageError("no"), StageRefused, "ramp of Toy, rows 0-3: no", id="a wrong request"),
        pytest.param(CacheUnavailable("full"), StageRefused, "ramp of Toy, rows 0-3: full", id="a full disk"),
        pytest.param(StageFailed("said before"), StageFailed, "said before", id="named already"),
        pytest.param(StageRefused("said before"), StageRefused, "said before", id="named and refused already"),
    ],
)
def test_what_goes_wrong_is_named(error: Exception, kind: type[Exception], text: str) -> None:
    with pytest.raises(kind) as caught, explained(step(RAMP, 0), str(Rows(0, 4, 10))):
        raise error
    assert type(caught.value) is kind
    assert str(caught.value) == text
    assert caught.value is error or caught.value.__cause__ is error


def test_an_interruption_is_not_explained() -> None:
    with pytest.raises(KeyboardInterrupt), explained(step(RAMP, 0)):
        raise KeyboardInterrupt


def test_a_job_without_draft_and_result_is_a_fault(context: Context) -> None:
    with pytest.raises(StageFailed, match="ramp of Toy: a job without draft and result"):
        tasks.publish(context, Job(step(RAMP, 0), {}, None, None), [])


def test_what_travels_between_tasks_can_be_pickled(context: Context) -> None:
    made = whole(context, step(RAMP, 0))
    job = Job(made.step, {"ramp": (made.key,)}, context.store.begin(made.step.recipe({}), made.step.label), made)
    for thing in (made, job, Context(context.store, Unwatched(), {}, context.claims)):
        assert type(pickle.loads(cloudpickle.dumps(thing))) is type(thing)


def test_an_unwatched_run_is_told_everything_and_says_nothing(store: Store, capsys: pytest.CaptureFixture[str]) -> None:
    whole(Context(store, Unwatched(), {}, Claims(FolderLease(store.layout.root, None))), step(RAMP, 0))
    assert capsys.readouterr() == ("", "")


def test_provenance_names_versions_and_command() -> None:
    found = tasks.provenance(["pipeline", "run"])
    assert found["command"] == ["pipeline", "run"]
    assert set(found["versions"]) == set(tasks.VERSIONS)
