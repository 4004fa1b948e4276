from typing import Literal

import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.evaluation.agreement import agreement
from semidense.stages.evaluation.confidence import confidence, padded_log_odds, sigmoid, weigh_in
from semidense.stages.evaluation.declaration import CONFIDENCE, ConfidenceParams
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.learning.parameters import to_vector
from semidense.stages.stage import StageError
from tests.stages.evaluation.reference import literal_log_odds, random_layers, random_net, scene
from tests.stages.tiling import tiled, whole

DIMS = {
    "images": {"left": ("y", "x", "band"), "moments": ("view", "moment")},
    "disparity": {"disparity": ("y", "x")},
    "evaluation_net": {"parameters": ("parameter",)},
    "distinctiveness": {"left": ("y", "x"), "right": ("y", "x")},
    "cost_margin": {"margin": ("y", "x")},
}


def products(height: int = 11, width: int = 8) -> dict[str, dict[str, np.ndarray]]:
    given = scene(height=height, width=width)
    return {
        "images": {name: given["images"][name] for name in ("left", "moments")},
        "disparity": given["disparity"],
        "evaluation_net": {"parameters": to_vector(random_net())},
        "distinctiveness": {view: np.full((height, width), 9, np.float32) for view in ("left", "right")},
        "cost_margin": {"margin": np.full((height, width), 5, np.float32)},
    }


def test_equals_the_patches_with_the_edge_repeated() -> None:
    """Every pixel of an image smaller than a patch: each sees all four borders."""
    net, layers = random_net(), random_layers(5, 8)
    padded = np.pad(layers, ((0, 0), (50, 50), (50, 50)), mode="edge")
    corners = np.argwhere(np.ones((5, 8)))
    expected = 1 / (1 + np.exp(-literal_log_odds(net, padded, corners).reshape(5, 8)))
    made = confidence(net, layers)
    assert made.shape == (5, 8) and made.dtype == np.float32
    assert np.abs(made - expected).max() <= 1e-4
    assert np.array_equal(sigmoid(padded_log_odds(net, padded)), made)


def test_is_a_probability_and_deterministic() -> None:
    one, other = (confidence(random_net(), random_layers(5, 7)) for _ in range(2))
    assert np.array_equal(one, other)
    assert 0 <= one.min() < one.max() <= 1


def test_a_constant_scene_is_trusted_alike_everywhere() -> None:
    made = confidence(random_net(), np.full((2, 6, 7), 0.5, np.float32))
    assert made.max() - made.min() <= 1e-5


def test_bfloat16_is_close_to_float32() -> None:
    """Probabilities within 0.05 anywhere, 0.01 on average; the outputs of this net are of size one."""
    net, layers = random_net(), random_layers(5, 6)
    exact, rough = confidence(net, layers), confidence(net, layers, "bfloat16")
    assert rough.dtype == np.float32
    assert 0 < np.abs(rough - exact).max() <= 0.05
    assert np.abs(rough - exact).mean() <= 0.01


@pytest.mark.parametrize("step", [2, 4])
def test_pixels_between_two_answers_are_interpolated(step: Literal[2, 4]) -> None:
    net = random_net()
    padded = np.pad(random_layers(6, 9), ((0, 0), (50, 50), (50, 50)), mode="edge")
    every, few = padded_log_odds(net, padded), padded_log_odds(net, padded, step=step)
    assert few.shape == (6, 9) and few.dtype == np.float32
    assert np.abs(few[::step, ::step] - every[::step, ::step]).max() <= 1e-4
    middle = step // 2
    assert np.abs(few[middle, 0] - (few[0, 0] + few[step, 0]) / 2) <= 1e-5
    assert np.abs(few[0, middle] - (few[0, 0] + few[0, step]) / 2) <= 1e-5
    assert np.abs(few[0, step + 1] - every[0, step] - (few[0, 2 * step] - few[0, step]) / step) <= 1e-4


def test_every_fourth_pixel_upside_down_is_refused() -> None:
    with pytest.raises(StageError, match="exclude each other"):
        padded_log_odds(random_net(), random_layers(105, 109), flipped=True, step=4)


def test_looking_upside_down_too_is_the_mean_of_the_log_odds() -> None:
    net, layers = random_net(), random_layers(5, 7)
    one, other = confidence(net, layers), confidence(net, layers[:, ::-1])[::-1]
    odds = (np.log(one / (1 - one)) + np.log(other / (1 - other))) / 2
    made = confidence(net, layers, flipped=True)
    assert np.abs(made - 1 / (1 + np.exp(-odds))).max() <= 1e-5
    assert np.abs(made - one).max() > 1e-3
    assert np.abs(made - confidence(net, layers[:, ::-1], flipped=True)[::-1]).max() <= 1e-6, "there is no up"


@pytest.mark.parametrize(
    ("rows", "flipped"),
    [
        pytest.param(1, False, id="one row"),
        pytest.param(4, False, id="parts"),
        pytest.param(4, True, id="upside down too"),
        pytest.param(10, False, id="nearly all"),
    ],
)
def test_tiles_equal_the_whole(rows: int, flipped: bool) -> None:
    """Up to the order of the sums in a convolution, which may depend on the size of its input."""
    params, given = ConfidenceParams(precision="float32", flipped=flipped), products(height=11 if rows > 1 else 4)
    one, other = tiled(CONFIDENCE, params, given, DIMS, rows), whole(CONFIDENCE, params, given, DIMS)
    for name in ("confidence", "network"):
        assert one[name].dtype == other[name].dtype == np.float32
        assert np.abs(one[name] - other[name]).max() <= 1e-5
        assert np.ptp(other[name]) > 0.01
    assert np.array_equal(one["agreement"], other["agreement"])


def test_the_stage_is_the_network_on_the_layers_of_the_left_view() -> None:
    given = products()
    left, moments = given["images"]["left"], given["images"]["moments"]
    layers = evaluation_layers(left, moments[0], given["disparity"]["disparity"])
    made = whole(CONFIDENCE, ConfidenceParams(precision="float32"), given, DIMS)
    assert list(made) == [output.name for output in CONFIDENCE.outputs]
    assert np.abs(made["network"] - confidence(random_net(), layers)).max() <= 1e-5
    assert np.array_equal(made["agreement"], agreement(given["disparity"]["disparity"], ConfidenceParams().window))


def test_agreement_weighs_in_by_its_power_and_not_at_all_in_the_paper_s_form() -> None:
    plain, weighed = (
        whole(
            CONFIDENCE, ConfidenceParams(precision="float32", agreement=weight, typical=0.9, window=3), products(), DIMS
        )
        for weight in (0.0, 2.0)
    )
    assert np.array_equal(plain["confidence"], plain["network"])
    odds = plain["network"] / (1 - plain["network"]) * (plain["agreement"] / np.float64(0.9)) ** 2
    assert np.abs(weighed["confidence"] - odds / (1 + odds)).max() <= 1e-5
    less = weighed["agreement"] < 0.9
    assert less.any() and not less.all()
    assert np.array_equal(weighed["confidence"] < weighed["network"], less)


def vetoing() -> dict[str, dict[str, np.ndarray]]:
    """Products of which the left view says nothing at (2, 3), the costs nothing at (8, 1)."""
    given = products()
    given["distinctiveness"]["left"][2, 3] = 0.5
    given["cost_margin"]["margin"][8, 1] = 0
    return given


def test_no_confidence_where_views_or_costs_say_nothing() -> None:
    plain, vetoed = (
        whole(CONFIDENCE, ConfidenceParams(precision="float32", veto=veto), vetoing(), DIMS) for veto in (False, True)
    )
    assert plain["confidence"].min() > 0, "the veto can be turned off"
    changed = vetoed["confidence"] != plain["confidence"]
    assert changed[2, 3] and changed[8, 1] and vetoed["confidence"][2, 3] == vetoed["confidence"][8, 1] == 0
    assert changed.sum() == 2
    assert np.array_equal(plain["network"], vetoed["network"]), "what the network said stays to be seen"


def test_the_veto_takes_only_what_it_needs() -> None:
    assert ConfidenceParams().inputs == CONFIDENCE.inputs
    assert ConfidenceParams(veto=False).inputs == ("images", "disparity", "evaluation_net")


def test_tiles_veto_as_the_whole_does() -> None:
    params = ConfidenceParams(precision="float32")
    one, other = tiled(CONFIDENCE, params, vetoing(), DIMS, 4), whole(CONFIDENCE, params, vetoing(), DIMS)
    assert np.array_equal(one["confidence"] == 0, other["confidence"] == 0)


def test_without_any_agreement_little_confidence_is_left() -> None:
    assert weigh_in(np.float32([20.0]), np.float32([1 / 289]), 6.0, 0.8)[0] < 1e-5


@pytest.mark.parametrize("window", [pytest.param(16, id="even"), pytest.param(103, id="beyond the patch")])
def test_the_window_has_a_middle_and_fits_the_patch(window: int) -> None:
    with pytest.raises(ValidationError, match=r"window"):
        ConfidenceParams(window=window)


def test_refuses_layers_without_an_axis_of_layers() -> None:
    with pytest.raises(StageError, match=r"layers has shape \(5, 6\), expected 3 dimensions"):
        confidence(random_net(), np.zeros((5, 6), np.float32))


def test_refuses_parameters_of_another_network() -> None:
    given = products() | {"evaluation_net": {"parameters": np.zeros(7, np.float32)}}
    with pytest.raises(StageError, match="EvaluationNet has 433410 parameters, the weights hold 7"):
        CONFIDENCE.function()(ConfidenceParams(), given)
