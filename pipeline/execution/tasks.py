"""The tasks that Dask runs: begin a product, make its tiles, publish it.

Between tasks travel keys and descriptions, never arrays: a task reads what it needs from the cache and
writes what it makes into its draft, in whichever process it runs. Each can be run again at any time, by
another worker too: it finds the draft that was begun, the tile that was written, the product that was published.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from semidense.cache import (
    DamagedEntry,
    Draft,
    Entry,
    EntryNotFound,
    IncompleteDraft,
    Recipe,
    require_imported_as_hashed,
)
from semidense.pipeline.execution.checkpoints import Checkpoints
from semidense.pipeline.execution.jobs import Context, Job, Span, Unread, explained, flat
from semidense.pipeline.execution.returned import require_declared, require_lengths
from semidense.pipeline.execution.tiles import Labelled, Rows, read_block, trim
from semidense.pipeline.plan.environment import cpu_name, version
from semidense.pipeline.plan.errors import StageFailed
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step
from semidense.stages.stage import Array, Arrays, Output

VERSIONS = ("semidense-stereo", "dask", "numpy", "torch", "xarray", "zarr")


def begin(context: Context, step: Step, inputs: Sequence[Made | Sequence[Made]], forced: bool, tiles: int) -> Job:
    """Return the job of a step whose inputs are there; of a step whose result is there, a finished job."""
    recipe, keys = ingredients(step, flat(inputs))
    with explained(step):
        context.admit(step)
        if made := there_or_claimed(context, step, recipe, forced):
            return Job(step, keys, None, made)
        try:
            with context.claims.opening():
                draft = context.store.begin(recipe, step.label, context.claims.lease, step.id)
                context.watch.begun(step, tiles)
        except BaseException:
            context.claims.release(recipe.key)
            raise
    return Job(step, keys, draft, None)


def ingredients(step: Step, inputs: Iterable[Made]) -> tuple[Recipe, dict[str, tuple[str, ...]]]:
    """Return the recipe of a step whose inputs are there, and by product the keys of those."""
    by_id = {made.step.id: made for made in inputs}
    recipe = step.recipe({step_id: made.digest for step_id, made in by_id.items()})
    return recipe, {product: tuple(by_id[each].key for each in ids) for product, ids in step.inputs.items()}


def there_or_claimed(context: Context, step: Step, recipe: Recipe, forced: bool) -> Made | None:
    """Return a step's result if it is there, made by somebody else perhaps who was waited for; else claim its key."""
    if not forced and (made := find(context, step, recipe)):
        context.claims.lease.add([recipe.key])
        return made
    context.claims.take(recipe.key, lambda holder: context.watch.waiting(step, holder))
    try:
        made = find(context, step, recipe)
    except BaseException:
        context.claims.release(recipe.key)
        raise
    if made is None or forced:
        return None
    context.claims.release(recipe.key)
    return made


def find(context: Context, step: Step, recipe: Recipe) -> Made | None:
    """Return a step's result if it is there and sound; this very run may have made it. A damaged one is set aside."""
    run = context.claims.lease.name
    entry, damage = context.store.look(recipe.key)
    if damage:  # a new one is not to be taken for a second writer's
        with suppress(DamagedEntry, EntryNotFound):
            context.store.require(recipe.key)
    if entry is None or damage:
        return None
    reused = run is None or entry.extras.get("run") != run
    return Made(step, entry.key, entry.digest, entry.seconds, reused)


def make_tile(context: Context, job: Job, rows: Rows) -> Span | None:
    """Compute one tile of a product and write it into the draft; return when, None if that was done before."""
    if job.draft is None:
        return None
    begun, step = time.time(), job.step
    with explained(step, str(rows)), context.room(step):
        context.admit(step)
        if job.draft.published() or _holds_tile(job.draft, step.stage.outputs, rows):
            return None
        opened = {product: context.recent.open(context.store, keys[0]) for product, keys in job.inputs.items()}
        made = compute_tile(step, opened, rows)
        require_lengths(step.stage, made, step.lengths | {"y": rows.stop - rows.start})
        for output in step.stage.outputs:
            _write_tile(job.draft, output, made[output.name], rows)
    context.watch.advanced(step, 1, step.tiles, "")
    return begun, time.time()


def compute_tile(step: Step, inputs: Mapping[str, Mapping[str, Labelled]], rows: Rows) -> Arrays:
    """Return a tile's own rows of a product, given all that it is made from."""
    made = call(step, {name: read_block(arrays, rows, step.stage, step.params) for name, arrays in inputs.items()})
    if step.stage.border != "cut":
        return made
    dims = {output.name: output.dims for output in step.stage.outputs}
    return trim(made, dims, rows, step.stage.halo(step.params))


def call(step: Step, *arguments: object) -> Arrays:
    """Call a stage's function, and see that what it imported is what the step's key names."""
    function = step.stage.function()
    require_imported_as_hashed(step.code)
    made = function(step.argument, *arguments)
    require_imported_as_hashed(step.code)  # it may have imported more
    return require_declared(step.stage, made)


def _holds_tile(draft: Draft, outputs: Iterable[Output], rows: Rows) -> bool:
    """Return whether another worker wrote this tile."""
    return all(draft.holds(output.name, region(output, rows)) for output in outputs if has_part(output, rows))


def create_arrays(job: Job) -> Job:
    """Create the arrays of a tiled product, whose sizes are known beforehand."""
    if job.draft is None or job.step.size is None:
        return job
    stage, sizes = job.step.stage, job.step.lengths
    with explained(job.step):
        if job.draft.published():
            return job
        for output in stage.outputs:
            shape = [sizes[dim] for dim in output.dims]
            _create(job.draft, output, shape, str(output.dtype), stage.tile_rows)
    return job


def make_whole(context: Context, job: Job) -> Span | None:
    """Compute a product that is not tiled and write it into the draft; return when, None if that was done before."""
    if job.draft is None:
        return None
    begun, step = time.time(), job.step
    with explained(step), context.room(step):
        context.admit(step)
        if job.draft.published() or all(job.draft.holds(output.name) for output in step.stage.outputs):
            return None
        inputs = {product: read_whole(context, step, product, keys) for product, keys in job.inputs.items()}
        made = call(step, inputs, *_monitor(context, job.draft, step))
        require_lengths(step.stage, made, step.lengths)
        for output in step.stage.outputs:
            array = made[output.name].astype(output.dtype or made[output.name].dtype, copy=False)
            _create(job.draft, output, array.shape, str(array.dtype), None)
            job.draft.write(output.name, tuple(slice(0, length) for length in array.shape), array)
    context.watch.advanced(step, 1, 1, "")
    return begun, time.time()


def _monitor(context: Context, draft: Draft, step: Step) -> tuple[Checkpoints, ...]:
    """Return the monitor of a monitored stage; other stages are given none."""

    def report(done: int, total: int, note: str) -> None:
        context.watch.advanced(step, done, total, note)

    return (Checkpoints(context.store.checkpoint(draft.recipe.key), report),) if step.stage.monitored else ()


def publish(context: Context, job: Job, spans: Sequence[Span | None]) -> Made:
    """Publish a product all of whose tiles are written."""
    if job.draft is None:
        if job.made is None:
            raise StageFailed(f"{job.step.name}: a job without draft and result")
        made = job.made
    else:
        seconds = covered(span for span in spans if span)
        with explained(job.step):
            try:
                context.admit(job.step)
                entry = _publish(job.draft, seconds, extras(context, job.step))
                if job.step.stage.monitored:
                    context.store.checkpoint(entry.key).remove()
            finally:
                context.claims.release(job.draft.recipe.key)
        made = Made(job.step, entry.key, entry.digest, seconds, reused=False)
    context.watch.published(made)
    return made


def _publish(draft: Draft, seconds: float, extras: Mapping[str, Any]) -> Entry:
    """Publish a draft, or find what it became: its publisher may have been killed at any point."""
    try:
        return draft.published() or draft.publish(seconds, extras)
    except IncompleteDraft:
        # A writer that was given up brought a part of the folder back, after the draft was published.
        if entry := draft.published():
            return entry
        raise


def extras(context: Context, step: Step) -> dict[str, Any]:
    """Return what is stored beside a result: what the run gives to all, and what belongs to this one."""
    own: dict[str, Any] = {"cpu": cpu_name(), "configuration": step.configuration}
    own |= {"image_size": list(step.size)} if step.size else {}
    return {**context.extras, **own, **({"run": run} if (run := context.claims.lease.name) else {})}


def covered(spans: Iterable[Span]) -> float:
    """Return for how many seconds at least one of some spans lasted.

    >>> covered([(0.0, 2.0), (1.0, 3.0), (5.0, 6.0)])
    4.0
    """
    total, end = 0.0, float("-inf")
    for first, last in sorted(spans):
        total += max(0.0, last - max(first, end))
        end = max(end, last)
    return total


def provenance(command: Sequence[str]) -> dict[str, Any]:
    """Return what is stored beside every result of a run: versions and the command line."""
    return {"versions": {name: version(name) for name in VERSIONS}, "command": list(command)}


def read_whole(context: Context, step: Step, product: str, keys: Sequence[str]) -> Mapping[str, Any] | Sequence[Arrays]:
    """Return a product's arrays, unread if the stage asks for it; where a split step takes one a scene, unread ones."""
    if step.takes_list(product):
        return [Unread(context.store, key) for key in keys]
    return context.store.arrays(keys[0]) if product in step.stage.lazy else context.recent.read(context.store, keys[0])


def _create(draft: Draft, output: Output, shape: Sequence[int], dtype: str, tile_rows: int | None) -> None:
    """Create one array, chunked so that a tile writes whole chunks, unless it is there."""
    if not draft.has_array(output.name):
        draft.create_array(output.name, shape, dtype, *layout(output, shape, tile_rows))


def layout(
    output: Output, shape: Sequence[int], tile_rows: int | None
) -> tuple[list[int], tuple[str, ...], dict[str, str]]:
    """Return chunks, dims and attrs of an array."""
    chunks = [
        tile_rows if dim == "y" and tile_rows else output.chunks.get(dim, length)
        for dim, length in zip(output.dims, shape, strict=True)
    ]
    return [max(1, chunk) for chunk in chunks], output.dims, {"units": output.units, "long_name": output.about}


def _write_tile(draft: Draft, output: Output, array: Array, rows: Rows) -> None:
    """Write a tile's part of one array."""
    if has_part(output, rows):
        draft.write(output.name, region(output, rows), array.astype(output.dtype, copy=False))


def has_part(output: Output, rows: Rows) -> bool:
    """Return whether a tile writes a part of an array: what has no rows is written by the first tile alone."""
    return "y" in output.dims or rows.start == 0


def region(output: Output, rows: Rows) -> tuple[slice, ...]:
    """Return the part of an array that is a tile's."""
    return tuple(slice(rows.start, rows.stop) if dim == "y" else slice(None) for dim in output.dims)
