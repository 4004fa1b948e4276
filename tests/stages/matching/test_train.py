import numpy as np
import pytest
import torch

from semidense.stages.matching.cost_volume import cost_volume
from semidense.stages.matching.crops import IGNORED, Crop, cut_crop, label_cells, ranking_loss
from semidense.stages.matching.declaration import MATCHING_NET, MatchingNetParams, MatchingSamplesParams
from semidense.stages.matching.net import net_from_parameters
from semidense.stages.matching.samples import draw_samples
from semidense.stages.matching.train import crops_loss, train_matching_net
from tests.stages.matching.reference import literal_logits, patches, random_net, shifted_scene
from tests.stages.monitors import InterruptedTrainingError, Memory

N = np.nan
TINY = {"samples": 24, "height": 5, "width": 8, "slots": 3}


def inputs(scene: dict[str, dict] | None = None, **settings: object) -> dict[str, object]:
    scene = scene or shifted_scene()
    samples = draw_samples(MatchingSamplesParams(**(TINY | settings)), {"truth": [scene["truth"]]})
    return {"channels": [scene["channels"]], "matching_samples": samples}


def crops(given: dict[str, object], count: int) -> list[Crop]:
    views = [scene["channels"] for scene in given["channels"]]
    return [cut_crop(given["matching_samples"], index, views, 0.0, np.random.default_rng(0)) for index in range(count)]


@pytest.mark.parametrize(
    ("truth", "disparity", "label"),
    [
        pytest.param(4.0, 4, 0, id="the truth"),
        pytest.param(4.5, 4, 0, id="half a pixel: a match"),
        pytest.param(4.625, 4, IGNORED, id="more: nothing"),
        pytest.param(5.0, 4, IGNORED, id="one pixel: still nothing"),
        pytest.param(5.125, 4, 1, id="more than one: a mismatch"),
        pytest.param(2.5, 4, 1, id="on the other side too"),
        pytest.param(N, 4, IGNORED, id="no truth"),
        pytest.param(40.0, 9, IGNORED, id="the right pixel, 8 - 9, is outside"),
        pytest.param(40.0, 8, 1, id="the first column of the right view is inside"),
        pytest.param(40.0, -4, IGNORED, id="nor is 8 + 4 inside 12 columns"),
        pytest.param(40.0, -3, 1, id="the last column is"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_labels_by_hand(truth: float, disparity: int, label: int) -> None:
    assert label_cells(np.float32([[truth]]), np.int32([disparity]), 8, 12).tolist() == [[[label]]]


def test_labels_have_a_row_a_slot() -> None:
    made = label_cells(np.float32([[1, 2, 3], [4, N, 6]]), np.int32([2, 5]), 5, 40)
    I = IGNORED  # noqa: E741
    assert made.tolist() == [[[I, 0, I], [1, I, 1]], [[1, 1, 1], [I, I, I]]]


def test_the_loss_is_that_of_the_patches() -> None:
    """Every labelled cell of crops at the image's border and inside, against the literal network on its two patches."""
    scene, net = shifted_scene(height=14, width=30), random_net()
    given = inputs(scene, samples=6, mirror=False)
    left, right = (patches(view) for view in scene["channels"]["channels"])
    samples, logits, labels = given["matching_samples"], [], []
    for index, crop in enumerate(crops(given, 6)):
        for slot, row, column in np.argwhere(crop.labels.numpy() != IGNORED):
            y, x = samples["y"][index] + row, samples["x"][index] + column
            logits.append(
                literal_logits(net, left[y, x][None], right[y, x - samples["disparities"][index][slot]][None])
            )
            labels.append(int(crop.labels[slot, row, column]))
    losses = torch.nn.functional.cross_entropy(torch.cat(logits), torch.tensor(labels), reduction="none").numpy()
    means = [losses[np.array(labels) == label].mean() for label in (0, 1)]
    assert crops_loss(net, crops(given, 6), 0.0).item() == pytest.approx(np.mean(means), abs=1e-4)


def test_a_dense_crop_of_one_pixel_teaches_what_a_patch_does() -> None:
    given, net = inputs(form="patch", samples=9), random_net()
    wide = {name: values.copy() for name, values in given["matching_samples"].items()}
    wide["disparities"] = wide["disparities"][:, [0, 1, 1]]  # a third slot, compared to nothing
    views = [scene["channels"] for scene in given["channels"]]
    dense = [cut_crop(wide, index, views, 0.0, np.random.default_rng(0)) for index in range(9)]
    for crop in dense:
        crop.labels[2] = IGNORED
    losses = [crops_loss(net, many, 0.0) for many in (crops(given, 9), dense)]
    gradients = [torch.autograd.grad(loss, list(net.parameters())) for loss in losses]
    assert losses[0].item() == pytest.approx(losses[1].item(), abs=1e-6)
    for one, other in zip(*gradients, strict=True):
        assert (one - other).abs().max() <= 1e-4 * max(1.0, float(one.abs().max()))


def test_the_gradients_are_those_of_plain_windows() -> None:
    """Windows of a strip that overlap add their gradients up."""
    net, (crop, *_) = random_net(), crops(inputs(height=4, width=6), 1)
    width = crop.left.shape[3]
    pieces = [crop.strip[..., start : start + width] for start in crop.starts.tolist()]
    logits = torch.cat([net(crop.left, piece) for piece in pieces]).permute(1, 0, 2, 3).reshape(2, -1)
    labels = crop.labels.reshape(-1)
    weight = 0.5 / torch.stack([(labels == label).sum() for label in (0, 1)]).clamp(min=1)
    plain = torch.nn.functional.cross_entropy(logits.T, labels, weight, ignore_index=IGNORED, reduction="sum")
    made = crops_loss(net, [crop], 0.0)
    assert made.item() == pytest.approx(plain.item(), abs=1e-5)
    for one, other in zip(*(torch.autograd.grad(loss, list(net.parameters())) for loss in (made, plain)), strict=True):
        assert (one - other).abs().max() <= 1e-4 * max(1.0, float(other.abs().max()))


def test_the_ranking_loss_by_hand() -> None:
    """Odds of a match 2, 1, 0 and 3 at four disparities; the match is the first, the last teaches nothing."""
    logits = torch.zeros(4, 2, 1, 3)
    logits[:, 0] = torch.tensor([2.0, 1.0, 0.0, 3.0])[:, None, None]
    labels = torch.tensor([0, 1, 1, IGNORED])[:, None, None].repeat(1, 1, 3)
    labels[:, 0, 1] = torch.tensor([1, 1, 1, 1])  # no match
    labels[:, 0, 2] = torch.tensor([0, 0, IGNORED, IGNORED])  # no mismatch
    expected = np.log(np.exp(2) + np.exp(1) + np.exp(0)) - 2
    assert ranking_loss([logits], [labels]).item() == pytest.approx(expected, abs=1e-6)
    other = logits.clone()
    other[:, 0] = torch.tensor([0.0, 0.0, 2.0, 0.0])[:, None, None]
    both = ranking_loss([logits, other], [labels, labels]).item()
    assert both == pytest.approx((expected + np.log(2 + np.exp(2))) / 2, abs=1e-6), "a mean over pixels, not over crops"


def test_nothing_to_rank_is_no_loss() -> None:
    logits = torch.zeros(2, 2, 1, 1, requires_grad=True)
    loss = ranking_loss([logits], [torch.full((2, 1, 1), IGNORED)])
    assert loss.item() == 0
    assert torch.equal(torch.autograd.grad(loss, logits)[0], torch.zeros_like(logits))


def test_the_ranking_loss_is_added_by_its_weight() -> None:
    net, some = random_net(), crops(inputs(), 4)
    none, one, three = (crops_loss(net, some, weight).item() for weight in (0.0, 1.0, 3.0))
    assert one > none
    assert three - none == pytest.approx(3 * (one - none), rel=1e-4)


@pytest.mark.parametrize("size", [pytest.param((8, 12), id="whole tiles"), pytest.param((5, 7), id="parts of tiles")])
def test_the_gradients_do_not_depend_on_the_way_of_computing(size: tuple[int, int]) -> None:
    """Transformed and direct convolutions; biases keep every ReLU open, since a cut may fall on either side of 0."""
    net, some = random_net(), crops(inputs(height=size[0], width=size[1], slots=5), 2)
    with torch.no_grad():
        for layer in (net.conv1, net.conv2_left, net.conv3, net.hidden[0]):
            layer.weight *= 0.1
            layer.bias += 1.0
        net.out.weight *= 0.1
    losses = [crops_loss(net, some, 1.0), crops_loss(net, some, 1.0, "bfloat16")]  # no autocast: float32, but direct
    assert losses[0].item() == pytest.approx(losses[1].item(), rel=1e-5)
    for one, other in zip(*(torch.autograd.grad(loss, list(net.parameters())) for loss in losses), strict=True):
        assert (one - other).abs().max() <= 1e-4 * float(other.abs().max())


def test_transformed_gradients_are_cut_where_direct_ones_are() -> None:
    """With ReLUs at work: a few fall on the other side of 0, which no one can tell apart."""
    net, some = random_net(), crops(inputs(height=8, width=12, slots=5), 2)
    gradients = [
        torch.autograd.grad(crops_loss(net, some, 1.0, how), list(net.parameters())) for how in ("float32", "bfloat16")
    ]
    for one, other in zip(*gradients, strict=True):
        assert (one - other).norm() <= 0.01 * other.norm()


def test_beyond_the_image_comes_its_nearest_pixel() -> None:
    scene = shifted_scene()
    samples = {
        "scene": np.array([0]),
        "mirrored": np.array([False]),
        "y": np.array([0]),
        "x": np.array([0]),
        "disparities": np.array([[70]]),
        "truth": np.zeros((1, 1, 1), np.float32),
    }
    views = scene["channels"]["channels"]
    crop = cut_crop(samples, 0, [views], 0.0, np.random.default_rng(0))
    assert np.array_equal(crop.left[0, :, :6, :6], np.broadcast_to(views[0, :, :1, :1], (3, 6, 6)))
    assert np.array_equal(crop.strip[0, :, 5], np.broadcast_to(views[1, :, 0, :1], (3, 11)))
    assert (crop.labels == IGNORED).all()


def test_light_changes_the_gray_of_each_view_on_its_own() -> None:
    given = inputs()
    views = [scene["channels"] for scene in given["channels"]]
    (plain,) = crops(given, 1)
    lit = cut_crop(given["matching_samples"], 0, views, 1.0, np.random.default_rng(5))
    for one, other in ((plain.left, lit.left), (plain.strip, lit.strip)):
        assert not torch.equal(one[:, 0], other[:, 0])
        assert torch.equal(one[:, 1:], other[:, 1:])
    assert torch.equal(plain.labels, lit.labels)


def settings(**changes: object) -> MatchingNetParams:
    return MatchingNetParams.model_validate({"steps": 4, "batch": 2, "precision": "float32"} | changes)


def test_makes_what_it_declares_and_one_seed_makes_it_again() -> None:
    given = inputs()
    one, again, other = (train_matching_net(settings(seed=seed), given) for seed in (1, 1, 2))
    assert list(one) == [output.name for output in MATCHING_NET.outputs]
    for output in MATCHING_NET.outputs:
        assert one[output.name].dtype == output.dtype and one[output.name].ndim == 1
        assert np.array_equal(one[output.name], again[output.name])
        assert not np.array_equal(one[output.name], other[output.name])
    assert len(one["loss"]) == 4


def test_the_first_loss_is_that_of_a_coin() -> None:
    made = train_matching_net(settings(steps=1, ranking=0.0), inputs())
    assert made["loss"][0] == pytest.approx(np.log(2), abs=0.1)


def test_the_net_knows_the_scales_of_the_training_channels() -> None:
    scene = shifted_scene()
    scene["channels"]["channels"] = scene["channels"]["channels"] * np.float32([3, 0, 0.5])[:, None, None] + np.float32(
        7
    )
    made = train_matching_net(settings(steps=1), inputs(scene))["parameters"]
    net = net_from_parameters(made, 3)
    views = scene["channels"]["channels"]
    assert net.input_mean.numpy() == pytest.approx(views.mean((0, 2, 3)), rel=1e-4)
    assert net.input_std.numpy() == pytest.approx(np.maximum(views.std((0, 2, 3)), 1e-4), rel=1e-3)


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    given, params = inputs(), settings(steps=5, checkpoint_steps=2)
    expected = train_matching_net(params, given)
    memory = Memory(stop_after=3)
    with pytest.raises(InterruptedTrainingError):
        train_matching_net(params, given, memory)
    resumed = Memory(states=memory.states)
    made = train_matching_net(params, given, resumed)
    assert resumed.steps == [3, 4, 5], "from the checkpoint after the second step"
    for name in expected:
        assert np.array_equal(made[name], expected[name])


def test_it_learns_to_match_a_random_texture() -> None:
    scene = shifted_scene(height=20, width=48)
    views = scene["channels"]["channels"][:, :1]
    scene["channels"]["channels"] = views
    given = inputs(scene, samples=64, height=8, width=12, slots=4)
    made = train_matching_net(settings(steps=20, relight=0.0), given)
    assert made["loss"][-5:].mean() < 0.7 * made["loss"][:3].mean()
    costs = cost_volume(net_from_parameters(made["parameters"], 1), views, range(12))
    inside = np.s_[2:18, 14:40]
    right = np.nanargmin(costs[inside], 2) == scene["truth"]["disparity"][inside]
    assert right.mean() > 0.6, "chance is 0.08"
