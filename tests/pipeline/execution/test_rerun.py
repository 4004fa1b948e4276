"""Every task can be run again, at any time: Dask does so when a worker dies that held its result."""

from collections.abc import Iterator

import pytest

from semidense.cache import Store
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.jobs import Context, Job
from semidense.pipeline.execution.tiles import Rows
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.plan import Made
from tests.pipeline import toy
from tests.pipeline.toy import BLURRED, RAMP, Offset, step

TILES = (Rows(0, 4, 10), Rows(4, 8, 10), Rows(8, 10, 10))
RAMP_STEP = step(RAMP, 0)
BLURRED_STEP = step(BLURRED, Offset(reach=1), ramp=RAMP_STEP)


@pytest.fixture
def context(store: Store) -> Iterator[Context]:
    with store.lease() as lease:
        yield Context(store, Unwatched(), {}, Claims(lease))


@pytest.fixture
def ramp(context: Context) -> Made:
    job = tasks.begin(context, RAMP_STEP, [], False, 1)
    return tasks.publish(context, job, [tasks.make_whole(context, job)])


def begin(context: Context, ramp: Made, forced: bool = False) -> Job:
    return tasks.create_arrays(tasks.begin(context, BLURRED_STEP, [ramp], forced, len(TILES)))


def test_a_draft_that_was_begun_is_found_again_with_its_arrays_and_tiles(context: Context, ramp: Made) -> None:
    first = begin(context, ramp)
    tasks.make_tile(context, first, TILES[1])
    again = begin(context, ramp)
    assert again.draft is not None
    assert first.draft is not None
    assert again.draft.path == first.draft.path
    toy.CALLS.clear()
    spans = [tasks.make_tile(context, again, rows) for rows in TILES]
    assert [span is None for span in spans] == [False, True, False], "the tile that was written is not made again"
    assert toy.CALLS == ["blurred"] * 2
    made = tasks.publish(context, again, spans)
    assert context.store.read(made.key)["values"][-1, 0] == 32 + 36 + 36


def test_a_whole_product_that_was_written_is_not_made_again(context: Context) -> None:
    job = tasks.begin(context, RAMP_STEP, [], False, 1)
    assert tasks.make_whole(context, job) is not None
    assert tasks.make_whole(context, tasks.begin(context, RAMP_STEP, [], False, 1)) is None
    assert toy.CALLS == ["ramp"]


@pytest.mark.parametrize("forced", [False, True])
def test_after_publishing_every_task_finds_the_product(context: Context, ramp: Made, forced: bool) -> None:
    job = begin(context, ramp, forced)
    made = tasks.publish(context, job, [tasks.make_tile(context, job, rows) for rows in TILES])
    toy.CALLS.clear()
    assert tasks.create_arrays(job) is job
    spans = [tasks.make_tile(context, job, rows) for rows in TILES]
    again = tasks.publish(context, job, spans)
    assert (spans, toy.CALLS) == ([None] * 3, [])
    assert (again.key, again.digest, again.reused) == (made.key, made.digest, False)
    assert list(context.store.layout.drafts.iterdir()) == []


def test_what_this_run_made_is_not_called_reused_when_it_is_found_again(context: Context, ramp: Made) -> None:
    job = tasks.begin(context, RAMP_STEP, [], False, 1)
    assert job.made is not None
    assert (job.made.key, job.made.reused) == (ramp.key, False)
    with context.store.lease() as other:
        job = tasks.begin(Context(context.store, Unwatched(), {}, Claims(other)), RAMP_STEP, [], False, 1)
    assert job.made is not None
    assert job.made.reused


def test_a_part_of_a_published_draft_that_came_back_is_no_draft(context: Context, ramp: Made) -> None:
    """A worker that was given up may still have been writing."""
    job = begin(context, ramp)
    made = tasks.publish(context, job, [tasks.make_tile(context, job, rows) for rows in TILES])
    assert job.draft is not None
    (job.draft.path / "data.zarr/values/c/0").mkdir(parents=True)
    (job.draft.path / "data.zarr/values/c/0/0").write_bytes(b"x")
    assert tasks.publish(context, job, [None] * 3).digest == made.digest
    assert list(context.store.layout.drafts.iterdir()) == []


def test_two_steps_of_one_key_do_not_write_into_one_draft(context: Context) -> None:
    """Two scenes may have the same pixels."""
    one, other = step(RAMP, 0), step(RAMP, 0, scene="Twin")
    jobs = [tasks.begin(context, each, [], False, 1) for each in (one, other)]
    assert all(job.draft for job in jobs)
    assert len({job.draft.path for job in jobs if job.draft}) == 2
    made = [tasks.publish(context, job, [tasks.make_whole(context, job)]) for job in jobs]
    assert made[0].key == made[1].key
    assert made[0].digest == made[1].digest


def test_seconds_are_those_of_the_product_alone(context: Context, ramp: Made) -> None:
    job = begin(context, ramp)
    for rows in TILES:
        tasks.make_tile(context, job, rows)
    made = tasks.publish(context, job, [(0.0, 2.0), None, (1.0, 3.0), (10.0, 10.5)])
    assert made.seconds == 3.5
    assert context.store.require(made.key).seconds == 3.5
    forced = begin(context, ramp, True)
    for rows in TILES:
        tasks.make_tile(context, forced, rows)
    assert tasks.publish(context, forced, [(0.0, 7.0)]).seconds == 7.0, "what is made again tells its own time"
    assert context.store.require(made.key).seconds == 3.5
