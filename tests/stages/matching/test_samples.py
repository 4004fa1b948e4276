import numpy as np
import pytest

from semidense.stages.learning import scenes as kept
from semidense.stages.matching import samples
from semidense.stages.matching.crops import IGNORED, cut_crop, label_cells
from semidense.stages.matching.declaration import MATCHING_SAMPLES, MatchingSamplesParams
from semidense.stages.matching.samples import ABSENT, draw_samples, visible_truth
from semidense.stages.stage import StageError
from tests.stages.matching.reference import shifted_scene
from tests.stages.tiling import same

N = np.nan
SMALL = {"samples": 60, "height": 6, "width": 10}
forms = pytest.mark.parametrize("form", ["dense", "patch"])


def truths(*scenes: dict[str, dict]) -> dict[str, list]:
    return {"truth": [scene["truth"] for scene in scenes or (shifted_scene(),)]}


def without_right(scene: dict[str, dict]) -> dict[str, dict]:
    blind = {name: np.zeros_like(scene["truth"][name]) for name in ("right_nonocc",)}
    return {"truth": scene["truth"] | blind}


def labels(samples: dict[str, np.ndarray], index: int, width: int = 64) -> np.ndarray:
    return label_cells(samples["truth"][index], samples["disparities"][index], int(samples["x"][index]), width)


def test_visible_truth_by_hand() -> None:
    truth = {
        "disparity": np.float32([[1, 2, 3]]),
        "nonocc": np.array([[False, True, True]]),
        "right_disparity": np.float32([[4, 5, 6]]),
        "right_nonocc": np.array([[True, True, False]]),
    }
    assert np.array_equal(visible_truth(truth, mirrored=False), [[N, 2, 3]], equal_nan=True)
    assert np.array_equal(visible_truth(truth, mirrored=True), [[N, 5, 4]], equal_nan=True)


@forms
def test_makes_what_it_declares(form: str) -> None:
    params = MatchingSamplesParams(form=form, **SMALL)
    made = draw_samples(params, truths())
    sizes = {"sample": 60, "slot": params.disparities, "row": params.crop[0], "column": params.crop[1]}
    assert list(made) == [output.name for output in MATCHING_SAMPLES.outputs]
    for output in MATCHING_SAMPLES.outputs:
        assert made[output.name].dtype == output.dtype
        assert made[output.name].shape == tuple(sizes[dim] for dim in output.dims)


@forms
def test_a_seed_gives_one_draw_and_another_seed_another(form: str) -> None:
    one, again, other = (draw_samples(MatchingSamplesParams(form=form, seed=s, **SMALL), truths()) for s in (1, 1, 2))
    assert same(one, again)
    assert not same(one, other)


def test_scenes_that_do_not_fit_into_memory_give_the_same_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(
        samples, "visible_truth", lambda truth, mirrored: asked.append(mirrored) or visible_truth(truth, mirrored)
    )
    scenes = truths(shifted_scene(), without_right(shifted_scene()), shifted_scene())
    all_kept = draw_samples(MatchingSamplesParams(**SMALL), scenes)
    assert sorted(asked) == [False, False, False, True, True]  # each side there is, once
    monkeypatch.setattr(kept, "MOST_BYTES", 0)
    assert same(draw_samples(MatchingSamplesParams(**SMALL), scenes), all_kept)
    assert len(asked) > 20  # only the side that was drawn from last stays in memory


def test_a_share_of_the_samples_is_of_dense_truths() -> None:
    dense, sparse = shifted_scene(), shifted_scene()
    known = np.random.default_rng(0).random(sparse["truth"]["disparity"].shape) < 0.2
    sparse["truth"] = sparse["truth"] | {"disparity": np.where(known, sparse["truth"]["disparity"], np.float32(N))}
    sparse["truth"]["nonocc"] = sparse["truth"]["nonocc"] & known
    given = truths(sparse, dense, sparse)
    counts = {
        share: np.bincount(draw_samples(MatchingSamplesParams(dense_share=share, **SMALL), given)["scene"]).tolist()
        for share in (None, 0.5, 0.7)
    }
    assert counts == {None: [20, 20, 20], 0.5: [15, 30, 15], 0.7: [9, 42, 9]}
    alike = MatchingSamplesParams(dense_share=0.9, **SMALL), MatchingSamplesParams(**SMALL)
    for kind in (dense, sparse):  # with truths of one kind there is nothing to balance
        assert same(*(draw_samples(params, truths(kind, kind)) for params in alike))


@forms
def test_crops_are_those_of_the_visible_truth(form: str) -> None:
    scene = shifted_scene()
    params = MatchingSamplesParams(form=form, **SMALL)
    made = draw_samples(params, truths(scene))
    assert 0 < made["mirrored"].sum() < 60
    for index in range(60):
        visible = visible_truth(scene["truth"], bool(made["mirrored"][index]))
        y, x = made["y"][index], made["x"][index]
        crop = visible[y : y + params.crop[0], x : x + params.crop[1]]
        assert np.array_equal(made["truth"][index], crop, equal_nan=True)
        assert np.isfinite(crop).any(), "there is something to learn"


def test_a_patch_has_one_match_and_one_mismatch() -> None:
    scene = shifted_scene()
    scene["truth"]["disparity"] = scene["truth"]["disparity"] + np.float32(0.4)
    made = draw_samples(MatchingSamplesParams(form="patch", samples=200, mirror=False), truths(scene))
    error = np.abs(made["disparities"] - made["truth"][:, :, 0])
    assert (error[:, 0] <= 0.5).all(), "the disparity nearest to the truth"
    assert (error[:, 1] > 1).all()
    assert len(np.unique(made["disparities"][:, 1])) > 8, "anywhere in the range"
    low, high = scene["truth"]["range"]
    assert made["disparities"].min() >= low and made["disparities"].max() <= high


def test_a_dense_crop_is_compared_at_the_whole_range() -> None:
    made = draw_samples(MatchingSamplesParams(samples=20, height=6, width=10, slots=20), truths())
    low, high = shifted_scene()["truth"]["range"]
    count = high - low + 1
    assert count < 20
    assert (made["disparities"][:, :count] == np.arange(low, high + 1)).all()
    assert (made["disparities"][:, count:] == ABSENT).all()


def test_of_a_larger_range_come_matches_near_misses_and_others() -> None:
    scene = shifted_scene()
    scene["truth"]["range"] = np.array([-20, 60])
    made = draw_samples(MatchingSamplesParams(samples=80, height=6, width=10, slots=12), truths(scene))
    assert made["disparities"].min() < -10 and made["disparities"].max() > 50, "anywhere in the range"
    beside = 0
    for index in range(80):
        slots = made["disparities"][index]
        assert len(np.unique(slots)) == 12 and slots.min() >= -20 and slots.max() <= 60
        least = np.nanmin(np.abs(slots[:, None, None] - made["truth"][index]), axis=(1, 2))
        assert least[0] == 0, "first disparities of the crop"
        beside += ((least >= 2) & (least <= 6)).sum()
        found = labels(made, index)
        assert (found == 0).any() and (found == 1).any()
    assert beside >= 2 * 80, "a sixth lie near them"


def test_only_pixels_seen_in_both_views_teach() -> None:
    """At disparity 2 and 9 the first 2 and 9 columns of the left view have no match in the right."""
    scene = shifted_scene()
    made = draw_samples(MatchingSamplesParams(mirror=False, **SMALL), truths(scene))
    for index in range(60):
        x = made["x"][index] + np.arange(10)
        y = made["y"][index] + np.arange(6)
        hidden = x < np.where(y < 15, 2, 9)[:, None]
        assert np.array_equal(np.isnan(made["truth"][index]), hidden)
        assert (labels(made, index)[:, hidden] == IGNORED).all()


@forms
@pytest.mark.parametrize(
    ("low", "high"),
    [pytest.param(2, 9, id="positive disparities"), pytest.param(-4, 3, id="negative and positive")],
)
def test_left_and_right_patches_agree_at_the_truth(form: str, low: int, high: int) -> None:
    """Both views of a mirrored sample are flipped and exchanged, and again show the same texture at the truth."""
    scene = shifted_scene(low=low, high=high)
    views = scene["channels"]["channels"]
    made = draw_samples(MatchingSamplesParams(form=form, **SMALL), truths(scene))
    compared = {False: 0, True: 0}
    for index in range(60):
        crop = cut_crop(made, index, [views], 0.0, np.random.default_rng(0))
        height, width = made["truth"][index].shape
        for slot, row, column in np.argwhere(crop.labels.numpy() == 0):
            left = crop.left[0, :, row + 5, column + 5]
            right = crop.strip[0, :, row + 5, crop.starts[slot] + column + 5]
            assert np.array_equal(left, right)
            compared[bool(made["mirrored"][index])] += 1
        assert crop.left.shape == (1, 3, height + 10, width + 10)
    assert min(compared.values()) > 10


@pytest.mark.parametrize(
    ("mirror", "scene"),
    [
        pytest.param(False, shifted_scene(), id="not asked for"),
        pytest.param(True, without_right(shifted_scene()), id="the right view has no truth"),
    ],
)
def test_nothing_is_mirrored(mirror: bool, scene: dict[str, dict]) -> None:
    assert not draw_samples(MatchingSamplesParams(mirror=mirror, **SMALL), truths(scene))["mirrored"].any()


def test_scenes_take_equal_parts_in_random_order() -> None:
    scenes = shifted_scene(0), shifted_scene(1, 20, 80), shifted_scene(2)
    order = draw_samples(MatchingSamplesParams(**SMALL), truths(*scenes))["scene"]
    assert np.bincount(order).tolist() == [20, 20, 20]
    assert (np.diff(order) < 0).any()


def test_every_visible_pixel_is_drawn_alike() -> None:
    scene = shifted_scene(height=4, width=16)
    made = draw_samples(MatchingSamplesParams(form="patch", samples=3000, mirror=False), truths(scene))
    drawn = np.zeros((4, 16), int)
    np.add.at(drawn, (made["y"], made["x"]), 1)
    visible = scene["truth"]["nonocc"]
    expected = 3000 / visible.sum()
    assert not drawn[~visible].any()
    assert (np.abs(drawn[visible] - expected) < 6 * np.sqrt(expected)).all()


def blind_scene() -> dict[str, dict]:
    scene = shifted_scene()
    scene["truth"]["nonocc"] = np.zeros((30, 64), bool)
    return scene


def narrow_range() -> dict[str, dict]:
    scene = shifted_scene()
    scene["truth"]["range"] = np.array([8, 10], np.int32)
    scene["truth"]["disparity"] = np.full((30, 64), 9, np.float32)
    return scene


@pytest.mark.parametrize(
    ("params", "scene", "message"),
    [
        pytest.param(
            {"height": 31}, shifted_scene(), r"crop of \(31, 32\) px does not fit .* \(30, 64\) px", id="tall"
        ),
        pytest.param({"width": 65}, shifted_scene(), r"crop of \(16, 65\) px does not fit", id="wide"),
        pytest.param(
            {"mirror": False}, blind_scene(), "no pixel with a known disparity that both views see", id="blind"
        ),
        pytest.param(
            {"form": "patch", "mirror": False}, narrow_range(), r"range 8\.\.10 px has no mismatch", id="range"
        ),
    ],
)
def test_refuses(params: dict[str, object], scene: dict[str, dict], message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        draw_samples(MatchingSamplesParams.model_validate(params), truths(scene))
    assert "\n" not in str(error.value)


def test_refuses_no_scene() -> None:
    with pytest.raises(StageError, match="name a dataset with a training split"):
        draw_samples(MatchingSamplesParams(), {"truth": []})
