"""The tasks that Dask runs: begin a product, make its tiles, publish it.

Between tasks travel keys and descriptions, never arrays: a task reads what it needs from the cache and
writes what it makes into its draft, in whichever process it runs.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from semidense.cache import DamagedEntry, Draft, Entry, EntryNotFound, Recipe, Store
from semidense.pipeline.execution.checkpoints import Checkpoints
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.recent_inputs import Recent
from semidense.pipeline.execution.tiles import Rows, read_block, trim
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.environment import version
from semidense.pipeline.plan.errors import DISK_ERRNOS, USER_ERRORS, StageFailed, StageRefused
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step
from semidense.stages.stage import Array, Arrays, Output

VERSIONS = ("semidense-stereo", "dask", "numpy", "torch", "xarray", "zarr")


@dataclass(frozen=True)
class Context:
    """What every task is given: cache, watch, what is stored beside results, who makes what, what was read last."""

    store: Store
    watch: Watch
    extras: Mapping[str, Any]
    claims: Claims
    recent: Recent = field(default_factory=Recent)


@dataclass(frozen=True)
class Job:
    """A product in the making.

    Attributes:
        step: what is made.
        inputs: keys of the entries it is made from, by product.
        draft: where it is written; None if an equal result was there already.
        made: the result that was there already, else None.
    """

    step: Step
    inputs: Mapping[str, tuple[str, ...]]
    draft: Draft | None
    made: Made | None


def begin(context: Context, step: Step, inputs: Sequence[Made], forced: bool, tiles: int) -> Job:
    """Return the job of a step whose inputs are there; of a step whose result is there, a finished job."""
    by_id = {made.step.id: made for made in inputs}
    recipe = step.recipe({step_id: made.digest for step_id, made in by_id.items()})
    keys = {product: tuple(by_id[each].key for each in ids) for product, ids in step.inputs.items()}
    with explained(step):
        if not forced and (made := _find(context.store, step, recipe)):
            context.claims.lease.add([recipe.key])
            return Job(step, keys, None, made)
        context.claims.take(recipe.key, lambda holder: context.watch.waiting(step, holder))
        try:
            return _begin_claimed(context, step, recipe, keys, forced, tiles)
        except BaseException:
            context.claims.release(recipe.key)
            raise


def _begin_claimed(
    context: Context, step: Step, recipe: Recipe, keys: Mapping[str, tuple[str, ...]], forced: bool, tiles: int
) -> Job:
    """Look again, now that nobody else makes the product, and begin a draft."""
    if not forced and (made := _find(context.store, step, recipe)):
        context.claims.release(recipe.key)
        return Job(step, keys, None, made)
    _set_damaged_aside(context.store, recipe.key)
    with context.claims.opening():
        draft = context.store.begin(recipe, step.label)
        context.watch.begun(step, draft, tiles)
    return Job(step, keys, draft, None)


def _find(store: Store, step: Step, recipe: Recipe) -> Made | None:
    """Return a step's result if it is there and sound."""
    if store.find(recipe.key) is None or store.check(recipe.key) is not None:
        return None
    try:
        return _made(step, store.require(recipe.key), reused=True)
    except (EntryNotFound, DamagedEntry):  # it went between two looks
        return None


def _set_damaged_aside(store: Store, key: str) -> None:
    """Move a damaged entry out of the way, so that the new one is not taken for a second writer's."""
    if store.find(key) and store.check(key):
        with suppress(DamagedEntry, EntryNotFound):
            store.require(key)


def make_tile(context: Context, job: Job, rows: Rows) -> None:
    """Compute one tile of a product and write it into the draft."""
    if job.draft is None:
        return
    step = job.step
    with explained(step, str(rows)):
        inputs = {
            product: read_block(context.store.arrays(keys[0]), rows, step.stage, step.params)
            for product, keys in job.inputs.items()
        }
        made = step.stage.function()(step.argument, inputs)
        if step.stage.border == "cut":
            dims = {output.name: output.dims for output in step.stage.outputs}
            made = trim(made, dims, rows, step.stage.halo(step.params))
        for output in step.stage.outputs:
            _write_tile(job.draft, output, made[output.name], rows)
    context.watch.advanced(step, 1, len_tiles(step), "")


def len_tiles(step: Step) -> int:
    """Return how many tiles a step is made in."""
    if step.stage.tile_rows is None or step.size is None:
        return 1
    return -(-step.size[0] // step.stage.tile_rows)


def create_arrays(job: Job) -> Job:
    """Create the arrays of a tiled product, whose sizes are known beforehand."""
    if job.draft is None or job.step.size is None:
        return job
    stage, params = job.step.stage, job.step.params
    sizes = {"y": job.step.size[0], "x": job.step.size[1], **stage.sizes(params)}
    with explained(job.step):
        for output in stage.outputs:
            shape = [sizes[dim] for dim in output.dims]
            _create(job.draft, output, shape, str(output.dtype), stage.tile_rows)
    return job


def make_whole(context: Context, job: Job) -> None:
    """Compute a product that is not tiled and write it into the draft."""
    if job.draft is None:
        return
    step = job.step
    with explained(step):
        inputs = {product: _read_whole(context, step, product, keys) for product, keys in job.inputs.items()}
        made = step.stage.function()(step.argument, inputs, *_monitor(context, job.draft, step))
        for output in step.stage.outputs:
            array = made[output.name].astype(output.dtype or made[output.name].dtype, copy=False)
            _create(job.draft, output, array.shape, str(array.dtype), None)
            job.draft.write(output.name, tuple(slice(0, length) for length in array.shape), array)
    context.watch.advanced(step, 1, 1, "")


def _monitor(context: Context, draft: Draft, step: Step) -> tuple[Checkpoints, ...]:
    """Return the monitor of a monitored stage; other stages are given none."""

    def report(done: int, total: int, note: str) -> None:
        context.watch.advanced(step, done, total, note)

    return (Checkpoints(context.store.root, draft.recipe.key, report),) if step.stage.monitored else ()


def publish(context: Context, job: Job, _: Sequence[None]) -> Made:
    """Publish a product all of whose tiles are written."""
    if job.draft is None:
        if job.made is None:
            raise StageFailed(f"{job.step.name}: a job without draft and result")
        made = job.made
    else:
        with explained(job.step):
            try:
                entry = job.draft.publish(time.time() - job.draft.started, context.extras)
                Checkpoints(context.store.root, entry.key).remove()
            finally:
                context.claims.release(job.draft.recipe.key)
        made = _made(job.step, entry, reused=False)
    context.watch.published(made)
    return made


def provenance(command: Sequence[str], configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is stored beside every result: versions, the command line, the whole configuration."""
    versions = {name: version(name) for name in VERSIONS}
    return {"versions": versions, "command": list(command), "configuration": configuration}


def _made(step: Step, entry: Entry, reused: bool) -> Made:
    return Made(step, entry.key, entry.digest, entry.seconds, reused)


def _read_whole(
    context: Context, step: Step, product: str, keys: Sequence[str]
) -> Mapping[str, Any] | Sequence[Arrays]:
    """Return a product's arrays, unread if the stage asks for it; where a split step takes one a scene, a list."""
    if product in step.stage.lazy:
        return context.store.arrays(keys[0])
    arrays = [context.recent.read(context.store, key) for key in keys]
    return arrays if step.takes_list(product) else arrays[0]


def _create(draft: Draft, output: Output, shape: Sequence[int], dtype: str, tile_rows: int | None) -> None:
    """Create one array, chunked so that a tile writes whole chunks."""
    chunks = [
        tile_rows if dim == "y" and tile_rows else output.chunks.get(dim, length)
        for dim, length in zip(output.dims, shape, strict=True)
    ]
    attrs = {"units": output.units, "long_name": output.about}
    draft.create_array(output.name, shape, dtype, [max(1, chunk) for chunk in chunks], output.dims, attrs)


def _write_tile(draft: Draft, output: Output, array: Array, rows: Rows) -> None:
    """Write a tile's part of one array; what has no rows is written by the first tile alone."""
    if "y" not in output.dims and rows.start > 0:
        return
    region = tuple(
        slice(rows.start, rows.stop) if dim == "y" else slice(0, length)
        for dim, length in zip(output.dims, array.shape, strict=True)
    )
    draft.write(output.name, region, array.astype(output.dtype, copy=False))


@contextmanager
def explained(step: Step, where: str = "") -> Iterator[None]:
    """Name product, scene and tile in whatever goes wrong."""
    try:
        yield
    except (StageFailed, StageRefused):
        raise
    except Exception as error:
        place = f"{step.name}, {where}" if where else step.name
        message = f"{place}: {error}" if str(error) else f"{place}: {type(error).__name__}"
        disk = isinstance(error, OSError) and error.errno in DISK_ERRNOS
        raise (StageRefused if disk or isinstance(error, USER_ERRORS) else StageFailed)(message) from error
