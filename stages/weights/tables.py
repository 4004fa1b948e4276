"""The calibration as a safetensors file: its arrays, with how they were made in the metadata."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from semidense.stages.evaluation.calibration.declaration import BINS, CALIBRATION, MAPS
from semidense.stages.stage import Array, Arrays, StageError

LARGEST = 2**22
"""Bytes; a larger file is refused before it is parsed."""
_LENGTHS = {"bin": BINS, "edge": BINS + 1, "map": len(MAPS)}


def save_table(calibration: Arrays, metadata: Mapping[str, Any]) -> bytes:
    """Return the product ``calibration`` as a safetensors file.

    Args:
        calibration: its arrays.
        metadata: JSON that says how they were made.

    Raises:
        StageError: if they are not those of the product.
    """
    _require_sound(calibration)
    arrays = {output.name: np.ascontiguousarray(calibration[output.name]) for output in CALIBRATION.outputs}
    texts = {"product": "calibration"} | {name: json.dumps(value, sort_keys=True) for name, value in metadata.items()}
    return save_arrays(arrays, metadata=texts)


def read_table(data: bytes) -> dict[str, Array]:
    """Return the product ``calibration`` from a file.

    Raises:
        StageError: if it is no such file, or its arrays are not those of the product.
    """
    if len(data) > LARGEST:
        raise StageError(f"the calibration has {len(data)} bytes, at most {LARGEST} are read")
    try:
        arrays: dict[str, Array] = load_arrays(data)
    except (SafetensorError, ValueError, KeyError) as error:
        words = "".join(letter if letter.isprintable() else " " for letter in str(error)[:120])
        raise StageError(f"the calibration is no safetensors file: {words}") from None
    _require_sound(arrays)
    return arrays


def _require_sound(arrays: Arrays) -> None:
    """Refuse arrays of other names, types, shapes or values than the product has."""
    if set(arrays) != {output.name for output in CALIBRATION.outputs}:
        raise StageError(f"the calibration holds other arrays than expected: {', '.join(sorted(arrays))[:120]}")
    scenes = arrays["right"].shape[:1]
    for output in CALIBRATION.outputs:
        array = arrays[output.name]
        shape = tuple(_LENGTHS.get(dim, *scenes) for dim in output.dims)
        if str(array.dtype) != output.dtype or array.shape != shape:
            raise StageError(
                f"the calibration's {output.name} is {array.dtype} {array.shape}, not {output.dtype} {shape}"
            )
    if not (np.isfinite(arrays["log_odds"]).all() and (np.diff(arrays["log_odds"]) > 0).all()):
        raise StageError("the calibration's log_odds must be finite and rise from edge to edge")
    if min(arrays["right"].min(initial=0), arrays["wrong"].min(initial=0)) < 0 or not scenes[0]:
        raise StageError("the calibration must count the pixels of a scene at least, from 0 up")
