"""What a stage returned, held against its declaration before it is written: a product must be what it says."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from semidense.datasets.arrays import array_text
from semidense.stages.stage import Array, Arrays, Output, Stage, StageError


def require_declared(stage: Stage, made: object) -> Arrays:
    """Return what a stage's function gave, if it has the arrays of the declaration.

    Raises:
        StageError: if it is no mapping, an array is missing, is not declared or has other dimensions, or holds numbers
            that its declared type cannot.
    """
    if not isinstance(made, Mapping):
        raise StageError(f"{stage.compute} gave {type(made).__name__}; a stage gives a dict of its arrays")
    declared = {output.name for output in stage.outputs}
    if made.keys() != declared:
        given = ", ".join(sorted(map(str, made))) or "no array"
        raise StageError(f"{stage.compute} gave {given}; its declaration says {', '.join(sorted(declared))}")
    for output in stage.outputs:
        _require_array(stage, output, made[output.name])
    return made


def require_lengths(stage: Stage, made: Arrays, lengths: Mapping[str, int]) -> None:
    """Refuse an array whose dimensions are not as long as they must be.

    Args:
        stage: what made it.
        made: its arrays, with the dimensions of the declaration.
        lengths: by dimension; others may have any.

    Raises:
        StageError: naming the array.
    """
    for output in stage.outputs:
        array = made[output.name]
        for dim, length in zip(output.dims, array.shape, strict=True):
            if lengths.get(dim, length) != length:
                raise StageError(
                    f"{stage.compute} gave {array_text(array)} for {output.name} ({', '.join(output.dims)}); "
                    f"{dim} must be {lengths[dim]}"
                )


def _require_array(stage: Stage, output: Output, array: Any) -> None:  # noqa: ANN401 - whatever came
    if not isinstance(array, np.ndarray) or array.ndim != len(output.dims):
        found = array_text(array) if isinstance(array, np.ndarray) else type(array).__name__
        raise StageError(f"{stage.compute} gave {found} for {output.name}; expected ({', '.join(output.dims)})")
    if output.dtype is not None and not _fits(array, np.dtype(output.dtype)):
        raise StageError(
            f"{stage.compute} gave {array_text(array)} for {output.name}; its declaration says {output.dtype}, "
            "which cannot hold all of its numbers"
        )


def _fits(array: Array, dtype: "np.dtype[Any]") -> bool:
    """Return whether a type can hold an array's numbers, but for rounding."""
    if np.can_cast(array.dtype, dtype, "safe") or array.size == 0:
        return True
    if dtype.kind in "iu" and array.dtype.kind in "iu":
        bounds = np.iinfo(dtype)
        return bounds.min <= int(array.min()) and int(array.max()) <= bounds.max
    return np.can_cast(array.dtype, dtype, "same_kind")
