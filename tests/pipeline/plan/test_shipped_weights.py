import hashlib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.plan import shipped_weights as shipped
from semidense.pipeline.plan.config import Config
from semidense.pipeline.results.result import Result
from semidense.stages.stage import StageError
from tests.tiny import NETS, TEST_ONLY


def test_missing_weights_say_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(resources, "files", lambda _: tmp_path)
    with pytest.raises(
        StageError, match="no weights for matching_net come with this installation: train them with --train"
    ):
        shipped.weights_file("matching_net")


def test_a_calibration_is_of_one_confidence_alone() -> None:
    with pytest.raises(StageError, match=r"evidence_confidence and fast comes .* give R or a density instead"):
        shipped.shipped_weights("calibration", "fast", "evidence_confidence")


@pytest.mark.parametrize(
    ("settings", "known"),
    [
        pytest.param({"preset": "robust", "sets": ["calibration.tolerance=0.5"]}, "1, 2 or 3", id="robust"),
        pytest.param({"preset": "paper", "sets": ["calibration.tolerance=3"]}, "1", id="paper"),
    ],
)
def test_an_error_without_a_calibration_names_those_with_one(settings: dict[str, Any], known: str) -> None:
    with pytest.raises(StageError, match=rf"set calibration.tolerance \(--within\) to {known}, or give a calibration"):
        shipped.weights_of(Config.load(None, settings["sets"], settings["preset"]), "calibration")


def test_maps_without_any_calibration_are_told_so_for_every_error() -> None:
    with pytest.raises(StageError, match=r"evidence_confidence and fast comes .* give R or a density instead"):
        shipped.shipped_weights("calibration", "fast", "evidence_confidence", tolerance=2)


def test_weights_are_found_in_the_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "weights").mkdir()
    (tmp_path / "weights" / "matching_net.safetensors").write_bytes(b"w")
    monkeypatch.setattr(resources, "files", lambda _: tmp_path)
    assert shipped.weights_file("matching_net").read_bytes() == b"w"


def test_the_digest_is_that_of_the_file(weights: Path) -> None:
    data = (weights / "matching_net.safetensors").read_bytes()
    assert shipped.weights_digest("matching_net") == hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize("product", NETS)
def test_what_comes_back_is_what_was_trained(weights: Path, trained: Result, product: str) -> None:
    arrays = shipped.read_network(shipped.shipped_weights(product, "exact"), {})
    assert all(np.array_equal(arrays[name], trained.open(product)[name].values) for name in ("parameters", "loss"))


def test_a_run_with_shipped_weights_gives_what_the_training_run_gave(
    weights: Path, trained: Result, tmp_path: Path
) -> None:
    made = api.run(Task(TEST_ONLY, cache=tmp_path / "cache"))
    for product in ("costvolume", "disparity", "confidence", "semidense", "metrics"):
        assert made.find(product).digest == trained.find(product, "test-0").digest
    assert made.metrics == trained.metrics


def test_what_the_training_run_made_is_found_again(weights: Path, trained: Result, own_cache: Path) -> None:
    """Shipped weights are what was trained, to the byte: volumes made while training need not be made for them."""
    plan = api.status(Task(TEST_ONLY, cache=own_cache))
    assert {planned.step.product for planned in plan.todo()} >= set(NETS)
    made = api.run(Task(TEST_ONLY, cache=own_cache))
    assert {each.step.product for each in made.made.values() if not each.reused} == set(NETS)


def test_other_weights_make_stale_what_is_made_with_them(weights: Path, tmp_path: Path) -> None:
    from semidense.stages.weights import read_weights, save_weights

    task = Task(TEST_ONLY, cache=tmp_path / "cache")
    api.run(task, "costvolume")
    file = weights / "matching_net.safetensors"
    arrays = read_weights("matching_net", file.read_bytes())
    arrays["parameters"] *= 2
    file.write_bytes(save_weights("matching_net", arrays, {}))
    shipped.weights_digest.cache_clear()
    plan = api.status(task, "costvolume")
    assert [planned.step.product for planned in plan.todo()] == ["matching_net", "costvolume"]
    assert [change.field for change in plan.todo()[0].changed] == ["params.shipped"]
