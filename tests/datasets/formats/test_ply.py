from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData

from semidense.datasets import DatasetError
from semidense.datasets.formats.ply import write_ply


@pytest.mark.parametrize("count", [0, 1, 5])
def test_an_independent_reader_gets_the_same_points(tmp_path: Path, count: int) -> None:
    random = np.random.default_rng(0)
    points, colours = random.normal(size=(count, 3)).astype(np.float32), random.integers(0, 256, (count, 3), np.uint8)
    write_ply(tmp_path / "a.ply", points, colours, ["metres"])
    read = PlyData.read(tmp_path / "a.ply")
    vertex = read["vertex"]
    assert np.array_equal(np.stack([vertex[axis] for axis in "xyz"], axis=1), points)
    assert np.array_equal(np.stack([vertex[band] for band in ("red", "green", "blue")], axis=1), colours)
    assert read.comments == ["metres"]


def test_what_does_not_fit_together_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"points of \(2, 3\) and colours of \(1, 3\)"):
        write_ply(tmp_path / "a.ply", np.zeros((2, 3)), np.zeros((1, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []
