import numpy as np

from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.likeness import distinctiveness, support


def test_a_patch_is_compared_with_those_of_its_row() -> None:
    """Against the definition, pixel by pixel; what lies nearer to the end than it reaches is not known."""
    gray = np.random.default_rng(0).integers(0, 256, (89, 95), np.uint8)
    found = distinctiveness(gray)
    assert np.isfinite(found[43:-43, 43:-43]).all() and np.isnan(found).sum() == 89 * 95 - 3 * 9
    for y, x in ((43, 43), (44, 47), (45, 51)):
        patch = {at: gray[y - 3 : y + 4, x + at - 3 : x + at + 4].astype(int) for at in range(-40, 41)}
        least = min(np.abs(patch[0] - patch[at]).mean() for at in patch if abs(at) >= 2)
        np.testing.assert_allclose(found[y, x], least, rtol=1e-6)


def test_a_blank_or_repeated_row_is_not_distinct() -> None:
    stripes = np.tile(np.uint8([0, 200, 90, 30, 120]), (90, 20))
    assert np.nanmax(distinctiveness(stripes)) == 0
    assert np.nanmax(distinctiveness(np.full((90, 100), 7, np.uint8))) == 0


def test_neighbours_of_like_colour_support_a_disparity() -> None:
    """Left of the edge all is one surface; the pixel right of it has the surface's disparity, but not its colour."""
    shape = (1 + 2 * RADIUS, 2 + 2 * RADIUS)
    gray = np.where(np.arange(shape[1]) <= RADIUS, 20, 250).astype(np.uint8)[None].repeat(shape[0], 0)
    disparity = np.where(gray == 20, np.float32(5), np.float32(9))
    disparity[RADIUS, RADIUS + 1] = 5
    found = support(disparity, gray)[0]
    assert found[0] > 0.999 and found[1] < 1e-3


def test_a_hole_supports_nothing() -> None:
    disparity = np.full((1 + 2 * RADIUS, 2 + 2 * RADIUS), 5, np.float32)
    disparity[:, RADIUS + 1 :] = np.nan
    found = support(disparity, np.full(disparity.shape, 9, np.uint8))[0]
    # Of 13 x 13 pixels, 7 columns of 13 have a disparity; the pixel itself does not count.
    np.testing.assert_allclose(found, [(7 * 13 - 1) / 168, 0], rtol=1e-5)


def test_a_pixel_unlike_all_its_neighbours_is_supported_by_them_all_the_same() -> None:
    gray = np.zeros((101, 101), np.uint8)
    gray[50, 50] = 255
    disparity = np.full(gray.shape, 7, np.float32)
    assert support(disparity, gray).tolist() == [[1.0]]
    disparity[:50] = 3
    assert np.allclose(support(disparity, gray), 90 / 168)
