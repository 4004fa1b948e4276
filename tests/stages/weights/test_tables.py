import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save

from semidense.stages.evaluation.calibration.declaration import BINS
from semidense.stages.evaluation.calibration.table import EDGES
from semidense.stages.stage import StageError
from semidense.stages.weights.tables import LARGEST, read_table, save_table

Arrays = dict[str, np.ndarray]


def table() -> Arrays:
    counts = np.arange(2 * BINS, dtype=np.int64).reshape(2, BINS)
    return {
        "right": counts,
        "wrong": counts[:, ::-1],
        "score": np.array([0.3, 0.1, 0.2]),
        "log_odds": EDGES * 0.9,
        "tolerance": np.ones(2),
    }


def test_what_is_written_comes_back() -> None:
    data = save_table(table(), {"configuration": {"calibration": {"folds": 2}}})
    read = read_table(data)
    assert set(read) == set(table())
    for name, array in table().items():
        assert np.array_equal(read[name], array)
        assert read[name].dtype == array.dtype


def test_the_metadata_say_how_it_was_made(tmp_path: Path) -> None:
    file = tmp_path / "calibration.safetensors"
    file.write_bytes(save_table(table(), {"configuration": {"calibration": {"folds": 2}}}))
    with safe_open(file, "numpy") as opened:
        metadata = opened.metadata()
    assert metadata["product"] == "calibration"
    assert json.loads(metadata["configuration"]) == {"calibration": {"folds": 2}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param(lambda t: t.pop("wrong"), "other arrays than expected", id="an array is missing"),
        pytest.param(lambda t: t.update(more=EDGES), "other arrays than expected", id="an array too many"),
        pytest.param(
            lambda t: t.update(right=t["right"].astype(np.float32)), "right is float32", id="counts as floats"
        ),
        pytest.param(lambda t: t.update(wrong=t["wrong"][:1]), r"wrong is int64 \(1, 400\)", id="fewer scenes"),
        pytest.param(lambda t: t.update(right=t["right"][0]), r"right is int64 \(400,\)", id="one dimension"),
        pytest.param(lambda t: t.update(score=np.zeros(2)), "score is float64", id="a score too few"),
        pytest.param(lambda t: t.update(wrong=t["wrong"] - 500), "from 0 up", id="negative counts"),
        pytest.param(lambda t: t.update(log_odds=EDGES[::-1].copy()), "must be finite and rise", id="a falling map"),
        pytest.param(lambda t: t.update(log_odds=EDGES * np.nan), "must be finite and rise", id="NaN"),
        pytest.param(
            lambda t: t.update({name: t[name][:0] for name in ("right", "wrong", "tolerance")}),
            "a scene at least",
            id="no scene at all",
        ),
    ],
)
def test_other_arrays_are_refused_in_one_line(change: Callable[[Arrays], object], message: str) -> None:
    arrays = table()
    change(arrays)
    for refused in (lambda: save_table(arrays, {}), lambda: read_table(save(arrays_of(arrays)))):
        with pytest.raises(StageError, match=message) as error:
            refused()
        assert "\n" not in str(error.value)


def arrays_of(arrays: Arrays) -> Arrays:
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        pytest.param(b"", "no safetensors file", id="empty"),
        pytest.param(b"\x80\x04pickle", "no safetensors file", id="a pickle"),
        pytest.param(save_table(table(), {})[:-8], "no safetensors file", id="truncated"),
        pytest.param(bytes(LARGEST + 1), "at most", id="too large"),
    ],
)
def test_other_files_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(StageError, match=message):
        read_table(data)
