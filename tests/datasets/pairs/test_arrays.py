from pathlib import Path

import numpy as np
import pytest
import torch

from semidense.datasets import DatasetError
from semidense.datasets.pairs.arrays import array_pair
from semidense.datasets.pairs.options import PairOptions


def test_arrays_are_known_by_their_content() -> None:
    left, right = (np.full((4, 5), value, np.uint8) for value in (1, 2))
    (one,), (other,), (deep,) = (
        array_pair(left, last, PairOptions()).scenes for last in (right, right + 1, right.astype(np.uint16))
    )
    digests = [scene.image_identity()["files"] for scene in (one, other, deep)]
    assert digests[0]["left"] == digests[1]["left"]
    assert len({each["right"] for each in digests}) == 3
    assert one.load_images()[0].tolist() == left.tolist()


@pytest.mark.parametrize(
    ("shape", "dtype", "message"),
    [
        pytest.param((4, 5), np.float64, "float64", id="floats"),
        pytest.param((4,), np.uint8, "uint8, 4", id="one axis"),
        pytest.param((4, 5, 2), np.uint8, "4 x 5 x 2", id="two bands"),
        pytest.param((0, 5), np.uint8, "empty", id="no pixel"),
        pytest.param((), np.uint8, "a scalar", id="a scalar"),
    ],
)
def test_what_is_no_image_is_refused(shape: tuple[int, ...], dtype: type, message: str) -> None:
    bad = np.zeros(shape, dtype)
    with pytest.raises(DatasetError, match=message):
        array_pair(bad, bad, PairOptions())


@pytest.mark.parametrize("bands", [1, 4])
def test_a_single_band_and_alpha_are_understood(bands: int) -> None:
    view = np.zeros((4, 5, bands), np.uint8)
    loaded = array_pair(view, view, PairOptions()).scenes[0].load_images()
    assert loaded[0].shape == ((4, 5) if bands == 1 else (4, 5, 3))


@pytest.mark.parametrize("dtype", [">u2", "<u2", np.int16, np.int32, np.int64, np.uint32])
def test_whole_numbers_of_any_kind_are_the_same_image(dtype: object) -> None:
    values = np.array([[0, 4095], [17, 300]])
    (scene,) = array_pair(values.astype(dtype), values.astype(np.uint16), PairOptions()).scenes
    left, right = scene.load_images()
    assert left.dtype.isnative
    assert left.tolist() == right.tolist() == np.rint(values * (65535 / 4095)).astype(int).tolist()


@pytest.mark.parametrize(
    ("array", "message"),
    [
        pytest.param(np.full((2, 2), 0.5), r"float64, 2 x 2; .* values are 0.5 to 0.5: scale both views", id="floats"),
        pytest.param(np.full((2, 2), np.nan), r"float64, 2 x 2; .*all values are NaN or infinite", id="nothing known"),
        pytest.param(
            np.array([[0.5, np.nan], [1, 0]]), "; 1 values are NaN or infinite: replace them; .* 0 to 1", id="a hole"
        ),
        pytest.param(np.full((2, 2), 70000), "values from 70000 to 70000 do not fit 16 bits", id="too large"),
        pytest.param(np.full((2, 2), -1), "values from -1 to -1 do not fit", id="negative"),
        pytest.param(np.ones((2, 2), bool), "left image is bool", id="a mask"),
    ],
)
def test_values_whose_range_is_not_known_are_refused(array: np.ndarray, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        array_pair(array, array, PairOptions())


VIEW = np.arange(80, dtype=np.uint8).reshape(4, 20)


@pytest.mark.parametrize(
    ("view", "message"),
    [
        pytest.param(None, "right image is None: was its file read", id="a file that was not read"),
        pytest.param("right.png", r"path 'right.png', no array: give all as arrays, or", id="a file"),
        pytest.param(Path("r.png"), r"path 'r.png', no array", id="a path"),
        pytest.param([[1, 2], [3]], "right image is no array: .*; give a NumPy array", id="rows of several lengths"),
        pytest.param(torch.zeros((4, 20), requires_grad=True), "is no array: .*detach", id="a tensor that is learnt"),
        pytest.param(torch.zeros((4, 20), dtype=torch.bfloat16), "is no array: .*BFloat16", id="bfloat16"),
        pytest.param(np.ma.masked_less(VIEW, 3), r"has masked pixels.*give array\.filled", id="masked"),
    ],
)
def test_what_is_no_array_is_refused_in_one_line(view: object, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as refused:
        array_pair(VIEW, view, PairOptions())
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("view", [torch.from_numpy(VIEW), np.ma.array(VIEW)], ids=["a tensor", "masked nowhere"])
def test_what_numpy_takes_is_an_image(view: object) -> None:
    (scene,) = array_pair(view, VIEW, PairOptions()).scenes
    assert scene.load_images()[0].tolist() == VIEW.tolist()


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(np.full((4, 20), 7 * 16, np.int16), id="OpenCV's numbers"),
        pytest.param(np.full((4, 20), 7 * 256, np.uint16), id="KITTI's numbers"),
        pytest.param(np.full((4, 20), 7, np.float64), id="pixels"),
    ],
)
def test_a_masked_disparity_is_none_whatever_lies_below(given: np.ndarray) -> None:
    mask = np.zeros(given.shape, bool)
    mask[0], given[0] = True, 30000
    masked, whole = (
        array_pair(VIEW, None, PairOptions(), disparity=each).scenes[0]
        for each in (np.ma.array(given, mask=mask), np.where(mask, given[1], given))
    )
    assert np.array_equal(masked.load_map(), np.where(mask, np.nan, np.float32(7)), equal_nan=True)
    assert (whole.load_map() == 7).all()
    more = np.ma.array(given, mask=mask | (np.arange(20) < 1))
    (other,) = array_pair(VIEW, None, PairOptions(), disparity=more).scenes
    assert other.identity() != masked.identity(), "the mask is part of the content"
