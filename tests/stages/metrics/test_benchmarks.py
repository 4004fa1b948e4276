"""The figures of the benchmarks against loops that follow their evaluation programs pixel by pixel."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.metrics.eth3d import eth3d_figures
from semidense.stages.metrics.kitti import d1_counts, d1_figures, fill_background, kitti2012_figures
from semidense.stages.metrics.middlebury import WEIGHTS, middlebury_figures, weighted_mean
from semidense.stages.stage import StageError

NAN, INF = math.nan, math.inf
Map = NDArray[Any]


def maps(seed: int, shape: tuple[int, int] = (12, 31)) -> tuple[Map, Map, NDArray[np.bool_], Map]:
    """A map, a truth, a mask and objects: errors at and around every threshold, and everything that may be missing."""
    random = np.random.default_rng(seed)
    truth = random.choice(np.array([0.25, 1, 7.5, 20, 59.75, 60, 61], np.float32), shape)
    steps = np.array([0, 0, 0.5, -0.5, 0.75, 1, 2, -2, 2.25, 3, -3, 3.0625, 4, 4.5, 9, 100, -100], np.float32)
    disparity = truth + random.choice(steps, shape)
    disparity[random.random(shape) < 0.3] = NAN
    disparity[random.random(shape) < 0.02] = INF
    truth[random.random(shape) < 0.3] = NAN
    return disparity, truth, random.random(shape) < 0.7, random.integers(0, 3, shape)


def same(found: dict[str, float], expected: dict[str, float]) -> None:
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-6, nan_ok=True), name


def of_errors(errors: list[float]) -> tuple[float, float]:
    return sum(errors) / len(errors), math.sqrt(sum(error * error for error in errors) / len(errors))


def middlebury_by_pixel(disparity: Map, truth: Map, mask: Map, largest: int, unit: float) -> dict[str, float]:
    factor, n, invalid = truth.shape[1] // disparity.shape[1], 0, 0
    errors: list[float] = []
    for y, x in np.ndindex(*truth.shape):
        if math.isnan(truth[y, x]) or not mask[y, x]:
            continue
        n += 1
        value = factor * float(disparity[y // factor, x // factor])
        if not math.isfinite(value):
            invalid += 1
            continue
        errors.append(abs(max(0.0, min(float(factor * largest), value)) - float(truth[y, x])) * unit)
    bad = {t: 100 * sum(error > t for error in errors) / n for t in (0.5, 1.0, 2.0, 4.0)}
    avgerr, rms = of_errors(errors)
    rising = sorted(errors)
    quantiles = {f"A{q}": rising[-(-len(rising) * q // 100) - 1] for q in (50, 90, 95, 99)}
    return {
        **{f"bad{t}": share for t, share in bad.items()},
        **{f"totbad{t}": share + 100 * invalid / n for t, share in bad.items()},
        "invalid": 100 * invalid / n, "avgerr": avgerr, "rms": rms, **quantiles,
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("factor, unit", [(1, 1.0), (1, 4.0), (2, 1.0), (4, 1.0)])
def test_middlebury(seed: int, factor: int, unit: float) -> None:
    small = maps(seed)[0]
    _, truth, mask, _ = maps(seed + 100, (12 * factor, 31 * factor))
    same(middlebury_figures(small, truth, mask, 60, unit), middlebury_by_pixel(small, truth, mask, 60, unit))


def test_the_weighted_mean_of_middlebury() -> None:
    assert sum(WEIGHTS.values()) == 100 and len(WEIGHTS) == 15
    figures = {scene: {"bad2.0": float(place)} for place, scene in enumerate(WEIGHTS)}
    expected = sum(place * (4 if scene in ("PianoL", "Playroom", "Playtable", "Shelves", "Vintage") else 8)
                   for place, scene in enumerate(WEIGHTS)) / 100  # fmt: skip
    assert weighted_mean(figures)["bad2.0"] == pytest.approx(expected)
    with pytest.raises(StageError, match="'Plants' is none of the 15"):
        weighted_mean({"testQ/Plants": {"bad2.0": 1.0}})
    with pytest.raises(StageError, match="no pair"):
        weighted_mean({})


def filled_by_pixel(disparity: Map) -> list[list[float]]:
    """Fill as the kit's ``interpolateBackground`` does, -1 for what is not known."""
    rows = [[float(value) if math.isfinite(value) else -1.0 for value in row] for row in disparity]
    height, width = disparity.shape
    for row in rows:
        count = 0
        for u in range(width):
            if row[u] < 0:
                count += 1
                continue
            if count and u - count > 0:
                row[u - count : u] = [min(row[u - count - 1], row[u])] * count
            count = 0
        valid = [u for u in range(width) if row[u] >= 0]
        if valid:
            row[: valid[0]] = [row[valid[0]]] * valid[0]
            row[valid[-1] + 1 :] = [row[valid[-1]]] * (width - valid[-1] - 1)
    for u in range(width):
        column = [v for v in range(height) if rows[v][u] >= 0]
        for v in range(height):
            if column and not column[0] <= v <= column[-1]:
                rows[v][u] = rows[column[0] if v < column[0] else column[-1]][u]
    return rows


def positive(disparity: Map) -> Map:
    return np.where(disparity < 0, 0, disparity)


@pytest.mark.parametrize("seed", range(5))
def test_the_background_is_filled_as_by_the_kit(seed: int) -> None:
    disparity = positive(maps(seed)[0])
    disparity[[0, 1, 5, 11]] = NAN
    assert fill_background(disparity).tolist() == filled_by_pixel(disparity)
    assert (fill_background(np.full((2, 3), NAN)) == -1).all()


def kitti_by_pixel(disparity: Map, truth: Map, objects: Map) -> dict[str, float]:
    filled = filled_by_pixel(disparity)
    wrong: dict[str, list[bool]] = {"bg": [], "fg": [], "all": [], "est": []}
    for y, x in np.ndindex(*truth.shape):
        if math.isnan(truth[y, x]):
            continue
        error = abs(float(truth[y, x]) - filled[y][x])
        outlier = error > 3 and error / abs(float(truth[y, x])) > 0.05
        for region in ("all", "fg" if objects[y, x] else "bg", *(["est"] if math.isfinite(disparity[y, x]) else [])):
            wrong[region].append(outlier)
    shares = {f"D1-{region}": 100 * sum(each) / len(each) for region, each in wrong.items()}
    return shares | {"density": 100 * len(wrong["est"]) / len(wrong["all"])}


@pytest.mark.parametrize("seed", range(5))
def test_kitti_2015(seed: int) -> None:
    disparity, truth, _, objects = maps(seed)
    disparity = positive(disparity)
    same(d1_figures(d1_counts(disparity, truth, objects)), kitti_by_pixel(disparity, truth, objects))


def test_kitti_2015_counts_the_pixels_of_all_frames_together() -> None:
    small, large = np.full((1, 10), 50.0), np.full((1, 90), 50.0)
    counts = d1_counts(small + 10, small) + d1_counts(large, large)
    assert d1_figures(counts)["D1-all"] == 10
    assert math.isnan(d1_figures(counts)["D1-fg"])


@pytest.mark.parametrize(
    "truth, error, wrong",
    [
        (10, 3.0, False),
        (10, 3.0625, True),
        (100, 5.0, False),
        (100, 5.0625, True),
        (60, 3.0, False),
        (59, 3.0625, True),
    ],
)
def test_an_outlier_is_off_by_more_than_3_px_and_5_percent(truth: float, error: float, wrong: bool) -> None:
    figures = d1_figures(d1_counts(np.array([[truth + error]]), np.array([[truth]])))
    assert figures["D1-all"] == (100 if wrong else 0)


@pytest.mark.parametrize("seed", range(3))
def test_kitti_2012(seed: int) -> None:
    disparity, truth, _, _ = maps(seed)
    disparity = positive(disparity)
    filled, known = (
        filled_by_pixel(disparity),
        [place for place in np.ndindex(*truth.shape) if truth[place] == truth[place]],
    )
    errors = [abs(float(truth[y, x]) - filled[y][x]) for y, x in known]
    expected = {f"out{t}": 100 * sum(error > t for error in errors) / len(errors) for t in (1, 2, 3, 4, 5)}
    reported = sum(math.isfinite(disparity[place]) for place in known)
    same(kitti2012_figures(disparity, truth),
         expected | {"avg": sum(errors) / len(errors), "density": 100 * reported / len(known)})  # fmt: skip


def eth3d_by_pixel(disparity: Map, truth: Map, mask: Map) -> dict[str, float]:
    errors, n = [], 0
    for y, x in np.ndindex(*truth.shape):
        if math.isnan(truth[y, x]) or not mask[y, x]:
            continue
        n += 1
        if math.isfinite(disparity[y, x]) and abs(disparity[y, x]) <= truth.shape[1]:
            errors.append(abs(float(disparity[y, x]) - float(truth[y, x])))
    avgerr, rms = of_errors(errors)
    rising = sorted(errors)
    return {
        **{f"bad{t}": 100 * sum(error > t for error in errors) / len(errors) for t in (0.5, 1.0, 2.0, 4.0)},
        "avgerr": avgerr, "rms": rms,
        **{f"A{q}": rising[len(rising) * q // 100] for q in (50, 90, 95, 99)},
        "coverage": 100 * len(errors) / n,
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_eth3d(seed: int) -> None:
    disparity, truth, mask, _ = maps(seed)
    same(eth3d_figures(disparity, truth, mask), eth3d_by_pixel(disparity, truth, mask))


def test_an_empty_map() -> None:
    empty, truth, everywhere = np.full((2, 3), NAN), np.full((2, 3), 5.0), np.ones((2, 3), bool)
    figures = middlebury_figures(empty, truth, everywhere, 9)
    assert (figures["bad2.0"], figures["totbad2.0"], figures["invalid"]) == (0, 100, 100)
    assert math.isnan(figures["avgerr"])
    assert d1_figures(d1_counts(empty, truth))["D1-all"] == 100
    assert kitti2012_figures(empty, truth)["avg"] == 6
    worst = eth3d_figures(empty, truth, everywhere)
    assert (worst["bad0.5"], worst["avgerr"], worst["A99"], worst["coverage"]) == (100, INF, INF, 0)


def test_no_pixel_that_counts_gives_nan() -> None:
    unknown, everywhere = np.full((2, 3), NAN), np.ones((2, 3), bool)
    assert math.isnan(middlebury_figures(unknown, unknown, everywhere, 9)["bad2.0"])
    assert math.isnan(d1_figures(d1_counts(unknown, unknown))["D1-all"])
    assert math.isnan(kitti2012_figures(unknown, unknown)["out3"])
    assert math.isnan(eth3d_figures(unknown, unknown, everywhere)["coverage"])


def test_a_truth_scores_0_against_itself() -> None:
    _, truth, mask, objects = maps(1)
    zero = dict.fromkeys(("bad0.5", "bad1.0", "bad2.0", "bad4.0", "avgerr", "rms", "A50", "A90", "A95", "A99"), 0)
    assert middlebury_figures(truth, truth, mask, 61).items() >= (zero | {"invalid": 0, "totbad0.5": 0}).items()
    assert eth3d_figures(truth / 2, truth / 2, mask).items() >= (zero | {"coverage": 100}).items()
    counts = d1_counts(truth, truth, objects)
    assert d1_figures(counts) == {"D1-bg": 0, "D1-fg": 0, "D1-all": 0, "D1-est": 0, "density": 100}
    assert kitti2012_figures(truth, truth)["avg"] == 0


@pytest.mark.parametrize(
    "shape, message",
    [((2, 4), "must be equal"), ((1, 3), "must be equal"), ((2, 1), "1, 2 or 4 times is needed")],
)
def test_sizes_that_do_not_fit_are_refused(shape: tuple[int, int], message: str) -> None:
    with pytest.raises(StageError, match=message):
        middlebury_figures(np.ones(shape), np.ones((2, 3)), np.ones((2, 3), bool), 9)
