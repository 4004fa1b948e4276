import numpy as np
import pytest

from semidense.stages.matching.crops import cut_crop
from semidense.stages.matching.declaration import REACH, MatchingSamplesParams
from semidense.stages.matching.descriptors.declaration import DESCRIPTOR_NET, DescriptorNetParams
from semidense.stages.matching.descriptors.net import descriptor_net_from_parameters
from semidense.stages.matching.descriptors.training import crops_logits, train_descriptor_net
from semidense.stages.matching.descriptors.volume import fast_cost_volume
from semidense.stages.matching.samples import draw_samples
from tests.stages.matching.descriptors.test_volume import random_descriptor_net
from tests.stages.matching.reference import shifted_scene
from tests.stages.monitors import InterruptedTrainingError, Memory


def inputs(scene: dict[str, dict], **settings: object) -> dict[str, object]:
    params = {"samples": 24, "height": 5, "width": 8, "slots": 4} | settings
    samples = draw_samples(MatchingSamplesParams(**params), {"truth": [scene["truth"]]})
    return {"channels": [scene["channels"]], "matching_samples": samples}


def settings(**changes: object) -> DescriptorNetParams:
    return DescriptorNetParams.model_validate({"steps": 4, "batch": 2, "precision": "float32"} | changes)


def test_a_crop_gives_the_cells_of_the_volume() -> None:
    scene, net = shifted_scene(height=30, width=70), random_descriptor_net()
    views = scene["channels"]["channels"]
    samples = {
        "scene": [0], "mirrored": [False], "y": [12], "x": [30], "disparities": [[3]],
        "truth": np.full((1, 4, 6), 3, np.float32),
    }  # fmt: skip
    slots = np.arange(-2, 6, dtype=np.int32)
    crop = cut_crop(samples, 0, [views], 0.0, np.random.default_rng(0), slots, REACH)
    (logits,) = crops_logits(net, [crop])
    costs = fast_cost_volume(net, views, range(-2, 6))[12:16, 30:36]
    assert logits.shape == (8, 2, 4, 6)
    assert np.allclose((logits[:, 1] - logits[:, 0]).permute(1, 2, 0), costs, atol=1e-4)
    assert (crop.labels == 0).sum() == 24, "one match a pixel: disparity 3"


def test_every_disparity_of_the_scene_is_met(monkeypatch: pytest.MonkeyPatch) -> None:
    met = []
    monkeypatch.setattr(
        "semidense.stages.matching.descriptors.training.crops_logits",
        lambda net, crops, precision: met.extend(len(crop.starts) for crop in crops) or crops_logits(net, crops),
    )
    scene = shifted_scene()
    train_descriptor_net(settings(steps=1), inputs(scene, samples=60))
    low, high = scene["truth"]["range"]
    assert met == [high - low + 1] * 2


def test_makes_what_it_declares_and_one_seed_makes_it_again() -> None:
    given = inputs(shifted_scene())
    one, again, other = (train_descriptor_net(settings(seed=seed), given) for seed in (1, 1, 2))
    assert list(one) == [output.name for output in DESCRIPTOR_NET.outputs]
    for output in DESCRIPTOR_NET.outputs:
        assert one[output.name].dtype == output.dtype and one[output.name].ndim == 1
        assert np.array_equal(one[output.name], again[output.name])
        assert not np.array_equal(one[output.name], other[output.name])
    assert len(one["loss"]) == 4


def test_more_filters_make_a_larger_network_that_the_volume_takes() -> None:
    scene = inputs(shifted_scene())
    made = train_descriptor_net(settings(width=96), scene)
    net = descriptor_net_from_parameters(made["parameters"], 3)
    assert net.width == 96
    assert fast_cost_volume(net, shifted_scene()["channels"]["channels"], range(4)).shape[2] == 4


def of_two_scenes(samples: int) -> dict[str, object]:
    both = [shifted_scene(seed=seed) for seed in (0, 1)]
    params = MatchingSamplesParams(samples=samples, height=5, width=8, slots=4)
    drawn = draw_samples(params, {"truth": [scene["truth"] for scene in both]})
    return {"channels": [scene["channels"] for scene in both], "matching_samples": drawn}


def test_a_scene_without_a_sample_is_not_needed() -> None:
    given = of_two_scenes(samples=1)
    assert len(np.unique(given["matching_samples"]["scene"])) == 1
    assert np.isfinite(train_descriptor_net(settings(steps=1), given)["parameters"]).all()


def test_scenes_for_which_there_is_no_room_are_read_again_and_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    given = of_two_scenes(samples=8)
    roomy = train_descriptor_net(settings(steps=3), given)
    monkeypatch.setattr("semidense.stages.learning.scenes.MOST_BYTES", 0)
    narrow = train_descriptor_net(settings(steps=3), given)
    assert all(np.array_equal(roomy[name], narrow[name]) for name in roomy)


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    given, params = inputs(shifted_scene()), settings(steps=5, checkpoint_steps=2)
    expected = train_descriptor_net(params, given)
    memory = Memory(stop_after=3)
    with pytest.raises(InterruptedTrainingError):
        train_descriptor_net(params, given, memory)
    made = train_descriptor_net(params, given, Memory(states=memory.states))
    assert all(np.array_equal(made[name], expected[name]) for name in expected)


def test_it_learns_to_match_a_random_texture() -> None:
    """Judged on another texture than it learnt from, among twelve disparities."""
    given = inputs(shifted_scene(height=40, width=96), samples=64, height=8, width=12)
    made = train_descriptor_net(settings(steps=20, relight=0.0), given)
    assert made["loss"][-5:].mean() < 0.7 * made["loss"][:3].mean()
    other = shifted_scene(seed=1, height=40, width=96)
    costs = fast_cost_volume(
        descriptor_net_from_parameters(made["parameters"], 3), other["channels"]["channels"], range(12)
    )
    inside = np.s_[:, 20:80]
    assert (np.nanargmin(costs[inside], 2) == other["truth"]["disparity"][inside]).mean() > 0.6, "chance is 0.08"


def test_bfloat16_has_a_gradient_for_every_parameter() -> None:
    made = train_descriptor_net(settings(steps=2, precision="bfloat16"), inputs(shifted_scene()))
    start = train_descriptor_net(settings(steps=1, precision="bfloat16"), inputs(shifted_scene()))
    assert np.isfinite(made["parameters"]).all()
    assert (made["parameters"] != start["parameters"]).mean() > 0.9
