import numpy as np
import pytest
import torch

from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import (
    EVIDENCE_NET,
    REACH,
    EvidenceNetParams,
    EvidenceSamplesParams,
)
from semidense.stages.evaluation.evidence.features import NAMES, of_whole_map
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.evidence.samples import compute_evidence_samples
from semidense.stages.evaluation.evidence.train import train_evidence_net
from semidense.stages.learning.parameters import initialise
from tests.stages.evaluation.evidence.test_confidence import products
from tests.stages.monitors import InterruptedTrainingError, Memory

PARAMS = EvidenceNetParams(steps=60, batch=2, height=16, width=16, checkpoint_steps=20)


def training(count: int = 2) -> dict[str, object]:
    """Samples of scenes of which a disparity is right where the aggregated margin is large, and only there."""
    params = EvidenceSamplesParams(precision="float32")
    return {"evidence_samples": [compute_evidence_samples(params, scene) for scene in evident_scenes(count)]}


def evident_scenes(count: int = 2) -> list[dict[str, dict]]:
    scenes = [products(height=20, width=24) for _ in range(count)]
    for number, given in enumerate(scenes):
        margin = np.random.default_rng(number).uniform(0, 30, (20, 24)).astype(np.float16)
        given["disparity"]["evidence"][FEATURES.index("aggregated_margin")] = margin
        given["truth"] = {"disparity": given["disparity"]["disparity"] + np.where(margin > 8, 0, 5).astype(np.float32)}
        given["truth"]["disparity"][:3] = np.nan
    return scenes


def test_makes_what_it_declares_and_one_seed_makes_it_again() -> None:
    one, other = (train_evidence_net(PARAMS, training()) for _ in range(2))
    assert list(one) == [output.name for output in EVIDENCE_NET.outputs]
    assert all(np.array_equal(one[name], other[name]) and one[name].dtype == np.float32 for name in one)
    assert not np.array_equal(
        one["loss"], train_evidence_net(PARAMS.model_copy(update={"seed": 1}), training())["loss"]
    )


def test_it_learns_which_evidence_tells_right_from_wrong() -> None:
    made = train_evidence_net(PARAMS.model_copy(update={"steps": 300}), training())
    scene = evident_scenes()[0]
    known = of_whole_map(scene["images"], scene["disparity"], scene["evaluation_net"], "float32", REACH)
    right = scene["disparity"]["evidence"][FEATURES.index("aggregated_margin")] > 8
    odds = weigh(made["parameters"], known)
    assert np.mean((odds > 0) == right) > 0.95


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    memory = Memory(stop_after=50)
    with pytest.raises(InterruptedTrainingError):
        train_evidence_net(PARAMS, training(), memory)
    resumed = Memory(states=memory.states)
    again = train_evidence_net(PARAMS, training(), resumed)
    assert resumed.steps[0] == 41
    assert all(np.array_equal(again[name], array) for name, array in train_evidence_net(PARAMS, training()).items())


def test_a_number_that_never_varied_in_training_does_not_count_later() -> None:
    net, rng = EvidenceNet(len(NAMES)), np.random.default_rng(0)
    initialise(net, 0)
    known = torch.from_numpy(rng.normal(size=(1, len(NAMES), 4 + 2 * REACH, 5)).astype(np.float32))
    mean, deviation = known.mean(dim=(0, 2, 3)), known.std(dim=(0, 2, 3))
    deviation[1] = 0
    net.keep(mean, deviation)
    with torch.inference_mode():
        before = net(known)
        known[:, 1] = torch.from_numpy(rng.normal(size=known.shape[2:]))
        assert torch.allclose(net(known), before, atol=1e-5)
        known[:, 0] += 1
        assert not torch.allclose(net(known), before, atol=1e-2)


def test_a_pixel_depends_on_no_row_beyond_the_reach() -> None:
    net, rng = EvidenceNet(len(NAMES)), np.random.default_rng(0)
    initialise(net, 0)
    known = torch.from_numpy(rng.normal(size=(1, len(NAMES), 40 + 2 * REACH, 7)).astype(np.float32))
    other = known.clone()
    other[:, :, : REACH + 2] += 1
    with torch.inference_mode():
        before, after = net(known)[0], net(other)[0]
    assert before.shape == (40, 7)
    changed = torch.nonzero((before != after).any(dim=1)).flatten()
    assert REACH - 2 <= changed.max() <= REACH + 2
