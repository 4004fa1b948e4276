from dataclasses import replace

import numpy as np
import pytest
import torch

from semidense.stages.disparity.aggregation.levels import SCALE, levels_of
from semidense.stages.matching.declaration import MatchingSamplesParams
from semidense.stages.matching.descriptors.declaration import DescriptorNetParams
from semidense.stages.matching.descriptors.summed import crop_costs, cut_wide_crop, summed_loss, wide_scenes
from semidense.stages.matching.descriptors.training import train_descriptor_net
from semidense.stages.matching.descriptors.volume import fast_cost_volume
from semidense.stages.matching.samples import draw_samples
from semidense.stages.stage import StageError
from tests.stages.matching.descriptors.test_volume import random_descriptor_net
from tests.stages.matching.reference import shifted_scene
from tests.stages.monitors import InterruptedTrainingError, Memory


def inputs(scene: dict[str, dict], **settings: object) -> dict[str, object]:
    """Return what is learnt from: views without edges, so that every penalty is the plain one."""
    params = MatchingSamplesParams(**({"samples": 24, "height": 5, "width": 8, "slots": 4} | settings))
    flat = np.full((*scene["truth"]["disparity"].shape, 1), 100, np.uint8)
    return {
        "channels": [scene["channels"]],
        "matching_samples": draw_samples(params, {"truth": [scene["truth"]]}),
        "images": [{"left": flat, "right": flat}],
        "truth": [scene["truth"]],
    }


def channels(given: dict[str, object]) -> list[np.ndarray]:
    return [scene["channels"] for scene in given["channels"]]


def settings(**changes: object) -> DescriptorNetParams:
    plain = {"steps": 2, "batch": 2, "precision": "float32", "relight": 0.0, "summed_steps": 3}
    return DescriptorNetParams.model_validate(plain | {"summed_height": 24, "summed_width": 40} | changes)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("least", [-2, 4])
def test_a_crop_as_large_as_the_image_has_the_costs_of_its_map(mirrored: bool, least: int) -> None:
    """With a range above 0 the first columns have no cell at all."""
    scene, net = shifted_scene(height=30, width=70), random_descriptor_net()
    scene["truth"]["range"] = np.array([least, 13], np.int32)
    given = inputs(scene)
    given["matching_samples"]["mirrored"][:] = mirrored
    params = settings(summed_height=30, summed_width=70)
    crop = cut_wide_crop(
        params, given["matching_samples"], channels(given), wide_scenes(given), np.random.default_rng(0)
    )
    views = scene["channels"]["channels"]
    views = np.ascontiguousarray(views[::-1, :, :, ::-1]) if mirrored else views
    low, high = (int(end) for end in scene["truth"]["range"])
    volume = fast_cost_volume(net, views, range(low, high + 1))
    above = levels_of(volume, low).above / SCALE
    made = crop_costs(net, crop, "float32").detach().numpy()
    assert made.shape == above.shape
    assert np.abs(made - above).max() < 0.3, "a quarter is the step of the levels, and float16 rounds"
    truth = scene["truth"]["right_disparity"][:, ::-1] if mirrored else scene["truth"]["disparity"]
    known = np.isfinite(crop.truth.numpy())
    assert known.any() and np.array_equal(crop.truth.numpy()[known] + low, truth[known])


def test_the_loss_of_costs_that_say_nothing_is_that_of_a_guess() -> None:
    """Of a guess among the valid disparities; one at the very edge of a window counts half."""
    given = inputs(shifted_scene())
    crop = cut_wide_crop(
        settings(), given["matching_samples"], channels(given), wide_scenes(given), np.random.default_rng(0)
    )
    net = random_descriptor_net()
    with torch.no_grad():
        net.log_scale.fill_(-20)  # every cost is the same
    depth = crop.outside.shape[1]
    known = torch.isfinite(crop.truth)
    inside = ~crop.outside
    expected = []
    for y, x in torch.nonzero(known).tolist():
        index, valid = int(crop.truth[y, x]), inside[x].float()
        near = [
            sum(float(valid[d]) * min(max(window + 0.5 - abs(d - index), 0), 1) for d in range(depth))
            / float(valid.sum())
            for window in (1, 3)
        ]
        expected.append(-np.log(0.01 + 0.99 * near[0]) - 0.5 * np.log(0.01 + 0.99 * near[1]))
    assert float(summed_loss(net, crop)) == pytest.approx(np.mean(expected), rel=1e-3)


def test_a_crop_without_a_known_truth_teaches_nothing() -> None:
    given = inputs(shifted_scene())
    crop = cut_wide_crop(
        settings(), given["matching_samples"], channels(given), wide_scenes(given), np.random.default_rng(0)
    )
    nothing = replace(crop, truth=torch.full_like(crop.truth, torch.nan))
    net = random_descriptor_net().requires_grad_(True)
    value = summed_loss(net, nothing)
    assert float(value) == 0
    assert all(not each.any() for each in torch.autograd.grad(value, list(net.parameters())))


def test_pixels_without_any_cell_teach_nothing_and_spoil_nothing() -> None:
    """A truth of 5 px, where only 20 px and more are searched: the first 20 columns have no cell."""
    given = inputs(shifted_scene(height=30, width=64))
    given["truth"][0]["range"] = np.array([20, 30], np.int32)
    params = settings(summed_height=30, summed_width=64)
    crop = cut_wide_crop(
        params, given["matching_samples"], channels(given), wide_scenes(given), np.random.default_rng(0)
    )
    assert crop.outside[:20].all() and torch.isfinite(crop.truth[:, 10:20]).any()
    net = random_descriptor_net().requires_grad_(True)
    value = summed_loss(net, crop)
    assert torch.isfinite(value)
    assert all(each.isfinite().all() for each in torch.autograd.grad(value, list(net.parameters())))


def test_the_further_steps_begin_where_a_training_without_them_ends() -> None:
    given = inputs(shifted_scene())
    alone = train_descriptor_net(settings(summed_steps=0), given)
    both = train_descriptor_net(settings(), given)
    assert len(both["loss"]) == 5 and np.array_equal(both["loss"][:2], alone["loss"])
    assert not np.array_equal(both["parameters"], alone["parameters"])


@pytest.mark.parametrize("killed_after", [1, 2, 3, 4])
def test_a_training_that_was_killed_ends_as_an_undisturbed_one(killed_after: int) -> None:
    given, params = inputs(shifted_scene()), settings(checkpoint_steps=1, relight=1.0)
    expected = train_descriptor_net(params, given)
    memory = Memory(stop_after=killed_after)
    with pytest.raises(InterruptedTrainingError):
        train_descriptor_net(params, given, memory)
    made = train_descriptor_net(params, given, Memory(states=memory.states))
    assert all(np.array_equal(made[name], expected[name]) for name in expected)


def test_in_both_precisions_every_parameter_but_the_bias_learns() -> None:
    """Sums are compared with one another, so what is added to every cost changes nothing."""
    given = inputs(shifted_scene())
    crop = cut_wide_crop(
        settings(), given["matching_samples"], channels(given), wide_scenes(given), np.random.default_rng(0)
    )
    for precision in ("float32", "bfloat16"):
        net = random_descriptor_net().requires_grad_(True)
        value = summed_loss(net, crop, precision)
        gradients = dict(
            zip(
                (name for name, _ in net.named_parameters()),
                torch.autograd.grad(value, list(net.parameters())),
                strict=True,
            )
        )
        assert float(gradients.pop("bias").abs()) < 1e-4
        assert all(each.abs().max() > 0 for each in gradients.values()), precision


def test_it_learns_through_the_sums() -> None:
    given = inputs(shifted_scene(height=40, width=96), samples=64, height=8, width=12)
    losses = train_descriptor_net(settings(steps=1, summed_steps=24, summed_rate=0.005), given)["loss"][1:]
    assert losses[-6:].mean() < 0.7 * losses[:6].mean()


def test_refuses_to_sum_costs_without_images_or_truth() -> None:
    given = inputs(shifted_scene())
    for missing in ("images", "truth"):
        with pytest.raises(StageError, match="needs the images and the truth"):
            train_descriptor_net(settings(), {name: each for name, each in given.items() if name != missing})


def test_takes_images_and_truth_only_if_costs_are_summed() -> None:
    assert settings(summed_steps=0).inputs == ("matching_samples", "channels")
    assert settings().inputs == ("matching_samples", "channels", "images", "truth")
    assert settings(steps=9, summed_steps=5).shortened(0.5).summed_steps == 2
