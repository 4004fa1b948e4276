"""Make small products of a scene in one task: one after the other, in memory, and published together."""

import time
from collections.abc import Container, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from semidense.cache import Encoded, InvalidArray, Recipe, Values, encode
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import RunStopped
from semidense.pipeline.execution.jobs import Context, explained, explained_at, flat
from semidense.pipeline.execution.tiles import Labelled, Rows, cut_rows, own
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step
from semidense.stages.stage import Array, Arrays, Output

MOST_BYTES = 8 << 20
"""So much is made before it is published, though more is to come: a sweep has many products a scene."""


def make_all(
    context: Context, steps: Sequence[Step], inputs: Sequence[Made | Sequence[Made]], forced: Container[str]
) -> list[Made]:
    """Make small products of a scene and return them in order; where one fails, those before it are kept.

    Run again after its worker died, this finds what was published by then, and makes the rest.

    Raises:
        RunStopped: if the run ended meanwhile.
    """
    if not context.claims.lease.is_seen():
        raise RunStopped("the run ended before this was begun")
    batch = _Batch(context, {made.step.id: made for made in flat(inputs)})
    try:
        for step in steps:
            batch.add(step, step.product in forced)
        batch.publish()
    except RunStopped:
        raise
    except Exception:
        with suppress(Exception):  # the first error is the one to tell
            batch.publish()
        raise
    finally:
        batch.release()
    return [batch.made[step.id] for step in steps]


class _Batch:
    """What a task has made so far. No other task has a part in it: one that runs again makes it anew.

    The claim of the first product stands for all: who is to make the same scene waits for that one.

    Attributes:
        made: by step, what it takes and what it made.
    """

    def __init__(self, context: Context, made: dict[str, Made]) -> None:
        self.made = made
        self._context = context
        self._claimed: str | None = None
        self._results: dict[str, Encoded] = {}
        self._arrays: dict[str, dict[str, Labelled]] = {}

    def add(self, step: Step, forced: bool) -> None:
        """Make a product whose inputs are there, unless it is there, too."""
        with self._context.claims.opening():
            pass  # raises if the run was stopped
        recipe, keys = tasks.ingredients(step, [self.made[each] for ids in step.inputs.values() for each in ids])
        with explained(step):
            self._context.admit(step)
            if recipe.key not in self._results and (made := self._there(step, recipe, forced)):
                self._context.watch.published(made)
            else:
                made = self._make(step, recipe, keys)
            self.made[step.id] = made
        if sum(array.values.nbytes for arrays in self._arrays.values() for array in arrays.values()) > MOST_BYTES:
            self.publish()

    def _there(self, step: Step, recipe: Recipe, forced: bool) -> Made | None:
        """Return the product if it is in the cache; else see that this task has a claim."""
        if self._claimed is None:
            made = tasks.there_or_claimed(self._context, step, recipe, forced)
            self._claimed = None if made else recipe.key
            return made
        if made := None if forced else tasks.find(self._context, step, recipe):
            self._context.claims.lease.add([made.key])
        return made

    def _make(self, step: Step, recipe: Recipe, keys: Mapping[str, tuple[str, ...]]) -> Made:
        """Make a product, unless an equal step of the batch made it."""
        if recipe.key not in self._results:
            self._context.watch.begun(step, step.tiles)
            begun = time.time()
            arrays = self._tiled(step, keys) if step.stage.tile_rows else self._whole(step, keys)
            seconds, extras = time.time() - begun, tasks.extras(self._context, step)
            values = {
                output.name: _values(output, arrays[output.name], step.stage.tile_rows) for output in step.stage.outputs
            }
            self._results[recipe.key] = encode(recipe, step.label, values, seconds, extras, step.id)
            self._arrays[recipe.key] = {
                output.name: Labelled(arrays[output.name], output.dims) for output in step.stage.outputs
            }
        result = self._results[recipe.key]
        return Made(step, recipe.key, result.digest, result.seconds, reused=False)

    def _whole(self, step: Step, keys: Mapping[str, tuple[str, ...]]) -> Arrays:
        inputs = {product: self._read(step, product, ids) for product, ids in keys.items()}
        with self._context.room(step):
            made = tasks.call(step, inputs)
        self._context.watch.advanced(step, 1, 1, "")
        return {each.name: np.array(made[each.name], each.dtype, order="C") for each in step.stage.outputs}

    def _read(self, step: Step, product: str, keys: Sequence[str]) -> Any:  # noqa: ANN401
        if keys[0] in self._arrays:
            return {name: own(array.values) for name, array in self._arrays[keys[0]].items()}
        return tasks.read_whole(self._context, step, product, keys)

    def _tiled(self, step: Step, keys: Mapping[str, tuple[str, ...]]) -> Arrays:
        """Make a product in the tiles that it would have elsewhere: its bytes do not depend on who makes it."""
        height, width = step.size or (0, 0)
        sizes = {"y": height, "x": width, **step.stage.sizes(step.params)}
        made = {each.name: np.empty([sizes[dim] for dim in each.dims], each.dtype) for each in step.stage.outputs}
        for rows in cut_rows(height, step.tile_rows or height):
            with explained(step, str(rows)), self._context.room(step):
                opened = {product: self._open(ids[0]) for product, ids in keys.items()}
                part = tasks.compute_tile(step, opened, rows)
                for output in step.stage.outputs:
                    _put(made[output.name], output, part[output.name], rows)
            self._context.watch.advanced(step, 1, step.tiles, "")
        return made

    def _open(self, key: str) -> Mapping[str, Labelled]:
        return self._arrays.get(key) or self._context.recent.open(self._context.store, key)

    def publish(self) -> None:
        """Publish all that was made since, and keep it at hand for what is made from it in another task."""
        results, arrays = self._results, self._arrays
        self._results, self._arrays = {}, {}
        if not results:
            return
        claims, made = self._context.claims, [each for each in self.made.values() if each.key in results]
        place = f"products of {made[0].step.scene}"
        with claims.opening(), explained_at(place):
            claims.lease.add(results)
        with explained_at(place):
            self._context.store.publish_all(list(results.values()), claims.lease)
        for key in results:
            self._context.recent.keep(key, arrays[key])
        for each in made:
            self._context.watch.published(each)

    def release(self) -> None:
        """Let others make what was not made."""
        if self._claimed:
            self._context.claims.release(self._claimed)


def _put(whole: Array, output: Output, part: Array, rows: Rows) -> None:
    """Write a tile's part of one array."""
    if tasks.has_part(output, rows):
        place = whole[tasks.region(output, rows)]
        if part.shape != place.shape:
            raise InvalidArray(f"array {output.name!r}: a tile has the shape {part.shape}, its place {place.shape}")
        place[...] = part


def _values(output: Output, array: Array, tile_rows: int | None) -> Values:
    return Values(array, *tasks.layout(output, array.shape, tile_rows))
