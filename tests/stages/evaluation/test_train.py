import numpy as np
import pytest
import torch

from semidense.stages.evaluation.confidence import confidence
from semidense.stages.evaluation.declaration import EVALUATION_NET, EvaluationNetParams, EvaluationSamplesParams
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.evaluation.samples import draw_samples
from semidense.stages.evaluation.train import cut_crop, train_evaluation_net, upright_logits
from semidense.stages.learning.parameters import from_vector
from tests.stages.evaluation.reference import random_net, scene
from tests.stages.monitors import InterruptedTrainingError, Memory


def inputs(**settings: object) -> dict[str, object]:
    given = scene()
    params = EvaluationSamplesParams(**({"samples": 20, "rows": 2, "columns": 3} | settings))
    lists = {name: [product] for name, product in given.items()}
    return lists | {"evaluation_samples": draw_samples(params, lists)}


def sides() -> tuple[np.ndarray, np.ndarray]:
    """The layers of the scene and of its mirrored pair."""
    given = scene()
    moments = given["images"]["moments"]
    left = evaluation_layers(given["images"]["left"], moments[0], given["disparity"]["disparity"])
    right = evaluation_layers(
        given["images"]["right"][:, ::-1], moments[1], given["right_disparity"]["disparity"][:, ::-1]
    )
    return left, right


def settings(**changes: object) -> EvaluationNetParams:
    return EvaluationNetParams.model_validate({"steps": 4, "batch": 2, "precision": "float32"} | changes)


@pytest.mark.parametrize("form", ["strided", "patch"])
def test_training_sees_what_inference_sees(form: str) -> None:
    """The answers of a training crop, at the image's border too, are the confidences of its grid's pixels."""
    net, samples = random_net(), inputs(form=form)["evaluation_samples"]
    dense = [confidence(net, layers) for layers in sides()]
    assert set(samples["mirrored"][:8].tolist()) == {False, True}
    for index in range(8):
        crop = cut_crop(settings(relight=0), samples, index, [sides()], np.random.default_rng(0))
        rows, columns = samples["labels"].shape[1:]
        assert crop.shape == (2, 101 + 16 * (rows - 1), 101 + 16 * (columns - 1))
        logits = net(torch.from_numpy(crop)[None]).detach()[0]
        y, x = samples["y"][index], samples["x"][index]
        expected = dense[int(samples["mirrored"][index])][y::16, x::16][:rows, :columns]
        made = torch.sigmoid(logits[1] - logits[0]).numpy()[: expected.shape[0], : expected.shape[1]]
        assert np.abs(made - expected).max() <= 1e-4


def test_upside_down_answers_come_in_the_upright_order() -> None:
    """Each answer of the flipped crop is that of its own patch, flipped."""
    net = random_net()
    crops = np.random.default_rng(1).normal(size=(2, 2, 101 + 16, 101)).astype(np.float32)
    made = upright_logits(net, crops, flipped=True).detach()
    for row in (0, 1):
        patch = torch.from_numpy(crops[:, :, 16 * row : 16 * row + 101].copy())
        assert (made[:, :, row] - net(patch.flip(2)).detach()[:, :, 0]).abs().max() <= 1e-4
    assert (upright_logits(net, crops, flipped=False) - net(torch.from_numpy(crops))).abs().max() <= 1e-4


def test_light_changes_the_gray_layer_only() -> None:
    samples = inputs()["evaluation_samples"]
    plain, lit = (cut_crop(settings(relight=r), samples, 0, [sides()], np.random.default_rng(0)) for r in (0, 1))
    assert not np.array_equal(plain[0], lit[0])
    assert np.array_equal(plain[1], lit[1])


def test_makes_what_it_declares_and_one_seed_makes_it_again() -> None:
    given = inputs(rows=1, columns=2)
    one, again, other = (train_evaluation_net(settings(steps=2, seed=seed), given) for seed in (1, 1, 2))
    assert list(one) == [output.name for output in EVALUATION_NET.outputs]
    for output in EVALUATION_NET.outputs:
        assert one[output.name].dtype == output.dtype and one[output.name].ndim == 1
        assert np.array_equal(one[output.name], again[output.name])
        assert not np.array_equal(one[output.name], other[output.name])
    assert len(one["loss"]) == 2


def test_the_balance_of_the_classes_is_undone_by_their_odds() -> None:
    given = inputs(rows=1, columns=2)
    labels = given["evaluation_samples"]["labels"]
    labels[:] = np.resize(np.int8([1, 1, 1, 0, -1]), labels.shape)
    right, wrong = (labels == 1).sum(), (labels == 0).sum()
    nets = EvaluationNet(), EvaluationNet()
    for net, prior in zip(nets, (True, False), strict=True):
        from_vector(net, train_evaluation_net(settings(steps=1, prior=prior), given)["parameters"])
    shifted, plain = (net.state_dict() for net in nets)
    moved = {name: (shifted[name] - plain[name]).numpy() for name in plain}
    assert moved.pop("out.bias") == pytest.approx([0, np.log(right / wrong)], abs=1e-6)
    assert not any(change.any() for change in moved.values())


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    given, params = inputs(rows=1, columns=2), settings(steps=3, checkpoint_steps=1)
    expected = train_evaluation_net(params, given)
    memory = Memory(stop_after=3)
    with pytest.raises(InterruptedTrainingError):
        train_evaluation_net(params, given, memory)
    resumed = Memory(states=memory.states)
    made = train_evaluation_net(params, given, resumed)
    assert resumed.steps == [3]
    for name in expected:
        assert np.array_equal(made[name], expected[name])


def test_it_learns_that_rough_disparities_are_wrong() -> None:
    given = inputs(samples=40, rows=2, columns=3, mirror=False)
    made = train_evaluation_net(settings(steps=20, relight=0.0), given)
    assert made["loss"][-5:].mean() < 0.8 * made["loss"][0]
    net = EvaluationNet()
    from_vector(net, made["parameters"])
    trusted = confidence(net, sides()[0])
    assert trusted[4:, :20].mean() > trusted[4:, 36:].mean() + 0.1
