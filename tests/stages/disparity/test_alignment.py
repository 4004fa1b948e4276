import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from skimage.data import stereo_motorcycle

from semidense.stages.disparity.alignment import LEAST_OFFSET, compute_alignment, offsets, plane
from semidense.stages.disparity.declaration import ALIGNMENT
from semidense.stages.disparity.survey import ENOUGH, compute_survey
from semidense.stages.stage import NoParams
from semidense.stages.transforms.declaration import LARGEST_OFFSET

SIZE = 120, 200
SURVEY = NoParams()


def images(
    level: float, across: float, down: float, size: tuple[int, int] = SIZE, gain: float = 1
) -> dict[str, object]:
    """A pair of noise with a disparity of 9 px, its right view lower by a plane."""
    height, width = size
    rng = np.random.default_rng(0)
    wide = gaussian_filter(rng.normal(size=(height + 40, width + 40)), 1.5)
    wide = np.clip(128 + 60 * wide / wide.std(), 0, 255)
    y, x = np.indices(size, float)
    offset = level + across * (x / width - 0.5) + down * (y / height - 0.5)
    left = wide[20 : 20 + height, 20 : 20 + width]
    # The right view's pixel (y + offset, x) shows what the left one shows in row y: here the first order is enough.
    right = map_coordinates(wide, [y + 20 - offset, x + 20 + 9], order=3)
    views = {"left": left, "right": gain * right}
    return {name: np.clip(np.rint(view), 0, 255).astype(np.uint8)[..., None] for name, view in views.items()}


def aligned(given: dict[str, object]) -> dict[str, NDArray[np.float32]]:
    return compute_alignment(SURVEY, {"images": given, "survey": compute_survey(SURVEY, {"images": given})})  # type: ignore[typeddict-item]


def offset_of(made: dict[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    return made["rows"][:, None] + made["columns"]


@pytest.mark.parametrize(
    ("terms", "gain"),
    [
        pytest.param((0.4, 0.0, 0.0), 1, id="lower everywhere"),
        pytest.param((-0.7, 0.0, 0.0), 1, id="higher everywhere"),
        pytest.param((0.3, 0.6, 0.0), 1, id="turned"),
        pytest.param((0.0, 0.0, 0.8), 1, id="of another size"),
        pytest.param((3.2, -0.5, 0.4), 1, id="by several pixels"),
        pytest.param((0.4, 0.3, 0.0), 0.6, id="in other light"),
    ],
)
def test_a_plane_is_found_to_a_twentieth_of_a_pixel(terms: tuple[float, float, float], gain: float) -> None:
    made = aligned(images(*terms, gain=gain))
    y, x = np.indices(SIZE)
    expected = terms[0] + terms[1] * (x / SIZE[1] - 0.5) + terms[2] * (y / SIZE[0] - 0.5)
    assert np.abs(offset_of(made) - expected).max() < 0.05
    assert {name: (array.ndim, str(array.dtype)) for name, array in made.items()} == {
        output.name: (len(output.dims), output.dtype) for output in ALIGNMENT.outputs
    }


def test_large_views_are_tracked_from_small_ones() -> None:
    made = aligned(images(1.4, 1.0, -0.6, size=(600, 1000)))
    assert abs(float(offset_of(made)[300, 500]) - 1.4) < 0.05
    assert abs(float(offset_of(made)[0, 999]) - 2.2) < 0.1


@pytest.mark.parametrize(
    "terms",
    [
        pytest.param((0.0, 0.0, 0.0), id="level"),
        pytest.param((LEAST_OFFSET / 2, 0.0, 0.0), id="less than is corrected"),
    ],
)
def test_a_rectified_pair_stays_as_it_is(terms: tuple[float, float, float]) -> None:
    made = aligned(images(*terms))
    assert len(made["offsets"]) > ENOUGH
    assert not offset_of(made).any()


def test_views_without_texture_or_of_different_scenes_are_not_shifted() -> None:
    blank = {name: np.full((*SIZE, 1), 90, np.uint8) for name in ("left", "right")}
    noise = {
        name: np.random.default_rng(seed).integers(0, 256, (*SIZE, 1), np.uint8) for seed, name in enumerate(blank)
    }
    for given in (blank, noise):
        made = aligned(given)
        assert not offset_of(made).any() and made["offsets"].shape[1] == 3


def random_offsets(terms: tuple[float, float, float], count: int = 1000) -> NDArray[np.float64]:
    rng = np.random.default_rng(0)
    places = rng.random((count, 2)) * SIZE
    unit = places / SIZE - 0.5
    return np.column_stack([places, terms[0] + terms[1] * unit[:, 1] + terms[2] * unit[:, 0]])


def measured(share: float) -> NDArray[np.float64]:
    """Offsets of half a pixel, measured to a tenth, in an upper left part of the image."""
    found = random_offsets((0.5, 0, 0)) + np.random.default_rng(3).normal(0, [0, 0, 0.1], (1000, 3))
    return found * (share, share, 1)


def test_offsets_from_everywhere_leave_nothing_open() -> None:
    np.testing.assert_allclose(plane(measured(1), SIZE), (0.5, 0, 0), atol=0.05)


def test_wrong_matches_do_not_bend_the_plane() -> None:
    found = random_offsets((0.3, 0.6, -0.2))
    found[:250, 2] += np.random.default_rng(1).uniform(1, 3, 250)
    np.testing.assert_allclose(plane(found, SIZE), (0.3, 0.6, -0.2), atol=0.05)


@pytest.mark.parametrize(
    "found",
    [
        pytest.param(random_offsets((0.5, 0, 0), ENOUGH - 1), id="too few"),
        pytest.param(random_offsets((LARGEST_OFFSET, 1, 0)), id="too far"),
        pytest.param(random_offsets((0.04, 0.05, 0.05)), id="too little"),
        pytest.param(
            np.column_stack([random_offsets((0, 0, 0))[:, :2], np.random.default_rng(2).normal(0, 2, 1000)]),
            id="no plane",
        ),
        pytest.param(np.empty((0, 3)), id="no match"),
        pytest.param(measured(0.3), id="all in a corner"),
        pytest.param(measured(1) * (0, 1, 1), id="all in a row"),
    ],
)
def test_what_is_no_plane_is_none(found: NDArray[np.float64]) -> None:
    assert plane(found, SIZE) == (0, 0, 0)


def test_a_small_picture_has_too_few_patches_side_by_side() -> None:
    """Hundreds of matches in 64 x 64 px overlap each other: they tell no more than some thirty."""
    left, right = (view[150:214, 250:314] for view in stereo_motorcycle()[:2])
    assert not offset_of(aligned({"left": left, "right": right})).any()


def test_an_offset_tells_where_it_was_measured() -> None:
    given = images(0.5, 0.0, 0.0)
    left, right = (np.asarray(given[name])[..., 0] for name in ("left", "right"))
    found = offsets(left, right, compute_survey(SURVEY, {"images": given}))  # type: ignore[typeddict-item]
    assert found.shape[1] == 3 and np.quantile(np.abs(found[:, 2] - 0.5), 0.99) < 0.1
    assert found[:, 1].max() <= SIZE[1] - 9 + 1  # columns of the right view, 9 px further left


@pytest.mark.parametrize("shape", [(1, 60), (60, 1), (1, 1), (10, 3000)])
def test_views_without_room_for_a_patch_stay_as_they_are(shape: tuple[int, int]) -> None:
    view = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    made = aligned({"left": view[..., None], "right": view[..., None]})
    assert not offset_of(made).any() and len(made["offsets"]) == 0
