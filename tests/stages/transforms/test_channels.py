from typing import get_args

import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.stage import StageError
from semidense.stages.transforms.channels import channels
from semidense.stages.transforms.companion import companion
from semidense.stages.transforms.declaration import CHANNELS, ChannelsParams
from semidense.stages.transforms.gray import gray_moments, to_gray
from semidense.stages.transforms.rank import rank
from tests.stages.tiling import same, tiled, whole

DIMS = {"images": {"left": ("y", "x", "band"), "right": ("y", "x", "band"), "moments": ("view", "moment")}}


def images(
    height: int = 47, width: int = 23, band: int = 3, dtype: type = np.uint8
) -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng(5)
    top = np.iinfo(dtype).max
    left, right = (rng.integers(0, top, (height, width, band), endpoint=True).astype(dtype) for _ in range(2))
    moments = np.array([gray_moments(to_gray(view)) for view in (left, right)])
    return {"images": {"left": left, "right": right, "moments": moments}}


def test_order_shape_and_dtype() -> None:
    given = images()["images"]
    made = channels(given["left"], given["right"])
    assert made.shape == (2, 3, 47, 23) and made.dtype == np.float32
    for view, name in enumerate(("left", "right")):
        gray = to_gray(given[name])
        mean, std = gray_moments(gray)
        assert np.array_equal(made[view, 0], ((gray - mean) / std).astype(np.float32))
        assert np.array_equal(made[view, 1], rank(gray, 31))
        assert np.array_equal(made[view, 2], companion(gray, 61, 8))


def test_gray_by_hand() -> None:
    view = np.array([[0, 10], [0, 10]], np.uint8)
    assert channels(view, view, ChannelsParams(use=("gray",)))[1, 0].tolist() == [[-1, 1], [-1, 1]]
    raw = channels(view, view, ChannelsParams(use=("gray",), gray="raw"))
    assert np.array_equal(raw[0, 0], np.float32([[0, 10 / 255], [0, 10 / 255]]))


def test_each_view_has_its_own_moments() -> None:
    dark, bright = np.array([[10, 20]], np.uint8), np.array([[110, 130]], np.uint8)
    made = channels(dark, bright, ChannelsParams(use=("gray",)))
    assert np.array_equal(made[0], made[1])


def test_a_constant_view_is_zero_in_gray_not_nan() -> None:
    flat = np.full((5, 6), 77, np.uint8)
    made = channels(flat, flat)
    assert not made[:, 0].any() and not made[:, 1].any() and (made[:, 2] == 1).all()


@pytest.mark.parametrize(
    ("use", "kept"),
    [
        pytest.param(("gray",), [0], id="gray only"),
        pytest.param(("gray", "rank"), [0, 1], id="without companion"),
        pytest.param(("companion", "gray"), [0, 2], id="without rank, given in another order"),
        pytest.param(("rank", "rank"), [1], id="named twice"),
    ],
)
def test_a_subset_keeps_the_order(use: tuple[str, ...], kept: list[int]) -> None:
    given = images()["images"]
    some = channels(given["left"], given["right"], ChannelsParams(use=use))
    assert np.array_equal(some, channels(given["left"], given["right"])[:, kept])


@pytest.mark.parametrize(
    ("params", "halo"),
    [
        pytest.param(ChannelsParams(), 30, id="the companion's radius"),
        pytest.param(ChannelsParams(use=("gray", "rank")), 15, id="the rank's radius"),
        pytest.param(ChannelsParams(rank_window=101), 50, id="the larger window counts"),
        pytest.param(ChannelsParams(use=("gray",)), 0, id="gray looks at one pixel"),
    ],
)
def test_halo(params: ChannelsParams, halo: int) -> None:
    assert CHANNELS.halo(params) == halo


@pytest.mark.parametrize("rows", [1, 16, 46])
@pytest.mark.parametrize(
    "params",
    [
        pytest.param(ChannelsParams(), id="the paper's, halo larger than a tile"),
        pytest.param(ChannelsParams(rank_window=5, companion_window=9, companion_rays=16), id="small halo, 16 rays"),
        pytest.param(ChannelsParams(use=("gray",)), id="no halo"),
    ],
)
def test_tiles_equal_the_whole(params: ChannelsParams, rows: int) -> None:
    given = images()
    assert same(tiled(CHANNELS, params, given, DIMS, rows), whole(CHANNELS, params, given, DIMS))


@pytest.mark.parametrize(("band", "dtype"), [(1, np.uint8), (3, np.uint16), (1, np.uint16)])
def test_other_kinds_of_image(band: int, dtype: type) -> None:
    given = images(9, 8, band, dtype)
    made = whole(CHANNELS, ChannelsParams(), given, DIMS)["channels"]
    assert made.shape == (2, 3, 9, 8)
    assert np.array_equal(made[0, 1], rank(to_gray(given["images"]["left"])))


def test_the_stage_declares_what_it_makes() -> None:
    made = CHANNELS.function()(ChannelsParams(), images())
    (output,) = CHANNELS.outputs
    assert list(made) == [output.name]
    assert made[output.name].dtype == output.dtype and made[output.name].ndim == len(output.dims)


def test_is_deterministic() -> None:
    assert same(*(CHANNELS.function()(ChannelsParams(), images()) for _ in range(2)))


def test_refuses_views_of_different_sizes() -> None:
    with pytest.raises(StageError, match=r"the left view is \(4, 4\) \(y, x\), the right \(4, 5\)"):
        channels(np.zeros((4, 4), np.uint8), np.zeros((4, 5), np.uint8))


def test_refuses_moments_of_another_shape() -> None:
    view = np.zeros((4, 4), np.uint8)
    with pytest.raises(StageError, match=r"moments has shape \(2,\)"):
        channels(view, view, moments=np.zeros(2))


@pytest.mark.parametrize(
    ("field", "message"),
    [
        pytest.param({"rank_window": 30}, "window is 30 px, expected an odd number", id="even window"),
        pytest.param({"companion_window": 1}, "greater than or equal to 3", id="tiny window"),
        pytest.param({"companion_rays": 6}, "rays is 6, expected one of 4, 8, 16", id="undefined rays"),
        pytest.param({"use": ()}, "at least 1 item", id="no channel"),
        pytest.param({"use": ("census",)}, "'gray', 'rank' or 'companion'", id="unknown channel"),
        pytest.param({"gray": "linear"}, "'standardized' or 'raw'", id="unknown gray"),
        pytest.param({"rank": 31}, "Extra inputs are not permitted", id="unknown field"),
    ],
)
def test_refuses_parameters(field: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ChannelsParams.model_validate(field)


def test_the_description_of_gray_names_its_values() -> None:
    gray = ChannelsParams.model_fields["gray"]
    assert all(f"{value}: " in str(gray.description) for value in get_args(gray.annotation))
