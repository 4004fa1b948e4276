"""The bundled pair with the weights of the package, on a part of its disparities."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from pipeline import api
from pipeline.api import Task

SHIPPED = all(
    (resources.files("stages") / "weights" / f"{product}.safetensors").is_file()
    for product in ("matching_net", "evaluation_net")
)
RANGE = (16, 31)


@pytest.mark.slow
@pytest.mark.skipif(not SHIPPED, reason="stages/weights holds no weights yet: make train DATA=DIR")
def test_the_bundled_pair_is_matched_where_its_disparities_are_searched(tmp_path: Path) -> None:
    settings = [f"costvolume.d_min={RANGE[0]}", f"costvolume.d_max={RANGE[1]}"]
    task = Task("motorcycle", settings=settings, cache=tmp_path / "cache")
    result = api.run(task)
    disparity = result.open("disparity")["disparity"].values
    confidence = result.open("confidence")["confidence"].values
    truth = result.open("truth")
    seen = truth["nonocc"].values & (truth["disparity"].values > RANGE[0]) & (truth["disparity"].values < RANGE[1])
    right = np.abs(disparity - truth["disparity"].values) <= 1
    assert seen.mean() > 0.1
    assert right[seen].mean() > 0.7
    assert confidence[seen & right].mean() > confidence[seen & ~right].mean() + 0.2
    assert all(planned.state == "hit" for planned in api.status(task).steps)
