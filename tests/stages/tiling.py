"""Run a stage as the runner does: in tiles of rows, with its halo, exactly as stages/stage.py documents it."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import Params, Stage

Array = NDArray[Any]
Dims = Mapping[str, Mapping[str, Sequence[str]]]
"""Dimension names of each input array: product -> array -> names. An array without y and x comes whole."""
Products = Mapping[str, Mapping[str, Array]]


def whole(stage: Stage, params: Params, inputs: Products, dims: Dims) -> dict[str, Array]:
    """Compute the image in one tile."""
    return tiled(stage, params, inputs, dims, _rows(inputs, dims))


def tiled(stage: Stage, params: Params, inputs: Products, dims: Dims, rows: int) -> dict[str, Array]:
    """Compute the image in tiles of so many rows, and put them together."""
    height, halo = _rows(inputs, dims), stage.halo(params)
    tiles = [
        _tile(stage, params, inputs, dims, (top, min(top + rows, height)), height, halo)
        for top in range(0, height, rows)
    ]
    return {output.name: _joined([tile[output.name] for tile in tiles], output.dims) for output in stage.outputs}


def same(one: Mapping[str, Array], other: Mapping[str, Array]) -> bool:
    """Say whether two products are bit for bit the same, NaN being equal to NaN."""
    return one.keys() == other.keys() and all(
        one[name].dtype == other[name].dtype and np.array_equal(one[name], other[name], equal_nan=True) for name in one
    )


def _tile(
    stage: Stage, params: Params, inputs: Products, dims: Dims, span: tuple[int, int], height: int, halo: int
) -> dict[str, Array]:
    top, bottom = span
    reach = max(0, top - halo), min(height, bottom + halo)
    block: dict[str, dict[str, Array]] = {}
    for product, arrays in inputs.items():
        block[product] = {}
        for name, array in arrays.items():
            axes = dict(zip(dims[product][name], range(array.ndim), strict=True))
            cut = _edge if stage.border == "edge" else _cut
            block[product][name] = cut(array, axes, span, reach, halo)
    made = dict(stage.function()(params, block))
    _require_sizes(stage, params, made)
    if stage.border == "edge":
        return made
    for output in stage.outputs:
        if "y" in output.dims:
            axis = output.dims.index("y")
            assert made[output.name].shape[axis] == reach[1] - reach[0], "a cut block's output has the block's size"
            made[output.name] = np.take(made[output.name], range(top - reach[0], bottom - reach[0]), axis)
    return made


def _require_sizes(stage: Stage, params: Params, made: Mapping[str, Array]) -> None:
    sizes = stage.sizes(params)
    for output in stage.outputs:
        named = {dim: made[output.name].shape[axis] for axis, dim in enumerate(output.dims) if dim not in ("y", "x")}
        assert named == {dim: sizes[dim] for dim in named}, "the declared sizes are those of the arrays"


def _cut(array: Array, axes: Mapping[str, int], span: tuple[int, int], reach: tuple[int, int], halo: int) -> Array:
    return np.take(array, range(*reach), axes["y"]) if "y" in axes else array


def _edge(array: Array, axes: Mapping[str, int], span: tuple[int, int], reach: tuple[int, int], halo: int) -> Array:
    if "y" not in axes:
        return array
    widths = [(halo, halo) if axis in (axes["y"], axes.get("x")) else (0, 0) for axis in range(array.ndim)]
    return np.take(np.pad(array, widths, mode="edge"), range(span[0], span[1] + 2 * halo), axes["y"])


def _rows(inputs: Products, dims: Dims) -> int:
    (height,) = {array.shape[tuple(dims[product][name]).index("y")] for product, name, array in _images(inputs, dims)}
    return int(height)


def _images(inputs: Products, dims: Dims) -> Iterator[tuple[str, str, Array]]:
    for product, arrays in inputs.items():
        for name, array in arrays.items():
            if "y" in dims[product][name]:
                yield product, name, array


def _joined(parts: Sequence[Array], dims: Sequence[str]) -> Array:
    if "y" in dims:
        return np.concatenate(parts, axis=list(dims).index("y"))
    assert all(np.array_equal(part, parts[0]) for part in parts), "what has no rows must be the same in every tile"
    return parts[0]
