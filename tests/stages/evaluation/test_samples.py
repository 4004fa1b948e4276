import numpy as np
import pytest

from semidense.stages.evaluation.declaration import EVALUATION_SAMPLES, EvaluationSamplesParams
from semidense.stages.evaluation.samples import UNKNOWN, draw_samples, label_pixels
from semidense.stages.stage import StageError
from tests.stages.evaluation.reference import scene
from tests.stages.tiling import same

N = np.nan
SMALL = {"samples": 30, "rows": 2, "columns": 3}
LEFT = SMALL | {"mirror": False}
"""From the left views' maps alone."""
forms = pytest.mark.parametrize("form", ["strided", "patch"])


def inputs(*scenes: dict[str, dict[str, np.ndarray]]) -> dict[str, list]:
    return {name: [one[name] for one in scenes or (scene(),)] for name in (scene() if not scenes else scenes[0])}


@pytest.mark.parametrize(
    ("disparity", "truth", "tolerance", "label"),
    [
        pytest.param(7.0, 7.0, 1.0, 1, id="exact"),
        pytest.param(8.0, 7.0, 1.0, 1, id="at the tolerance"),
        pytest.param(8.25, 7.0, 1.0, 0, id="above it"),
        pytest.param(5.75, 7.0, 1.0, 0, id="below it"),
        pytest.param(8.25, 7.0, 2.0, 1, id="another tolerance"),
        pytest.param(N, 7.0, 1.0, 0, id="no disparity is wrong"),
        pytest.param(7.0, N, 1.0, UNKNOWN, id="no truth"),
        pytest.param(N, N, 1.0, UNKNOWN, id="neither"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_labels_by_hand(disparity: float, truth: float, tolerance: float, label: int) -> None:
    made = label_pixels(np.float32([[disparity]]), np.float32([[truth]]), tolerance)
    assert made.dtype == np.int8 and made.tolist() == [[label]]


@forms
def test_makes_what_it_declares(form: str) -> None:
    made = draw_samples(EvaluationSamplesParams(form=form, **SMALL), inputs())
    assert list(made) == [output.name for output in EVALUATION_SAMPLES.outputs]
    for output in EVALUATION_SAMPLES.outputs:
        assert made[output.name].dtype == output.dtype and made[output.name].ndim == len(output.dims)
    assert made["labels"].shape[1:] == ((1, 1) if form == "patch" else (2, 3))


@forms
def test_a_seed_gives_one_draw_and_another_seed_another(form: str) -> None:
    one, again, other = (draw_samples(EvaluationSamplesParams(form=form, seed=s, **SMALL), inputs()) for s in (1, 1, 2))
    assert same(one, again)
    assert not same(one, other)


def test_a_grid_has_the_labels_of_pixels_16_px_apart() -> None:
    given = scene()
    labels = label_pixels(given["disparity"]["disparity"], given["truth"]["disparity"], 1.0)
    made = draw_samples(EvaluationSamplesParams(**LEFT), inputs(given))
    assert not made["mirrored"].any()
    for index in range(30):
        y, x = made["y"][index], made["x"][index]
        assert np.array_equal(made["labels"][index], labels[y : y + 17 : 16, x : x + 33 : 16])


def test_a_grid_larger_than_the_image_starts_in_its_first_16_pixels() -> None:
    params = EvaluationSamplesParams(samples=300, rows=4, columns=2, mirror=False)
    made = draw_samples(params, inputs(scene(height=40, width=30)))
    assert np.unique(made["y"]).tolist() == list(range(16)), "every offset is learnt"
    assert np.unique(made["x"]).tolist() == list(range(16))
    assert (made["labels"][:, 3] == UNKNOWN).all(), "row 48 and on is outside"
    assert ((made["labels"][:, 2] != UNKNOWN).any(1) == (made["y"] + 32 < 40)).all()


def test_patches_are_all_the_wrong_pixels_and_as_many_right_ones() -> None:
    given = scene()
    labels = label_pixels(given["disparity"]["disparity"], given["truth"]["disparity"], 1.0)
    made = draw_samples(EvaluationSamplesParams(form="patch", mirror=False), inputs(given))
    found = made["labels"][:, 0, 0]
    assert np.array_equal(found, labels[made["y"], made["x"]])
    wrong = np.sort(np.flatnonzero(labels == 0))
    assert np.array_equal(np.sort((made["y"] * 56 + made["x"])[found == 0]), wrong)
    assert (found == 1).sum() == min(len(wrong), (labels == 1).sum())
    assert len(np.unique(made["y"] * 56 + made["x"])) == len(found), "none twice"
    assert len(np.flatnonzero(np.diff(found))) > 2, "in random order"


def test_scenes_take_equal_parts() -> None:
    made = draw_samples(EvaluationSamplesParams(**LEFT), inputs(scene(0), scene(1, 60, 30), scene(2)))
    assert np.bincount(made["scene"]).tolist() == [10, 10, 10]


def test_a_mirrored_grid_has_the_labels_of_the_right_view_from_its_right_edge_on() -> None:
    given = scene()
    labels = label_pixels(given["right_disparity"]["disparity"], given["truth"]["right_disparity"], 1.0)
    made = draw_samples(EvaluationSamplesParams(**SMALL), inputs(given))
    assert made["mirrored"].sum() == 15, "both maps take equal parts"
    for index in np.flatnonzero(made["mirrored"]):
        y, x = made["y"][index], 55 - made["x"][index]
        assert np.array_equal(made["labels"][index], labels[y : y + 17 : 16, [x, x - 16, x - 32]])


def test_a_right_view_without_truth_gives_no_samples() -> None:
    given = scene()
    given["truth"]["right_disparity"][:] = N
    made = draw_samples(EvaluationSamplesParams(**SMALL), inputs(given, scene(1)))
    assert np.bincount(made["scene"]).tolist() == [10, 20]
    assert set(made["scene"][made["mirrored"]].tolist()) == {1}


def test_every_scene_gives_its_patches() -> None:
    made = draw_samples(EvaluationSamplesParams(form="patch"), inputs(scene(0), scene(1, 20, 30)))
    for index in (0, 1):
        assert {0, 1} == set(made["labels"][made["scene"] == index].ravel().tolist())


def unknown() -> dict[str, dict[str, np.ndarray]]:
    nothing = np.full((40, 56), N, np.float32)
    return scene() | {"truth": {"disparity": nothing, "right_disparity": nothing}}


def perfect() -> dict[str, dict[str, np.ndarray]]:
    given = scene()
    truth = given["truth"]
    given["disparity"]["disparity"] = np.nan_to_num(truth["disparity"])
    given["right_disparity"]["disparity"] = np.nan_to_num(truth["right_disparity"])
    return given


@pytest.mark.parametrize(
    ("form", "given", "message"),
    [
        pytest.param(
            "strided", unknown(), "no training scene has a pixel with a known disparity", id="grids, no truth"
        ),
        pytest.param(
            "patch", unknown(), "no training scene has a pixel with a known disparity", id="patches, no truth"
        ),
        pytest.param("patch", perfect(), "no training scene has a wrong disparity to learn from", id="nothing wrong"),
    ],
)
def test_refuses(form: str, given: dict[str, dict[str, np.ndarray]], message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        draw_samples(EvaluationSamplesParams(form=form, **SMALL), inputs(given))
    assert "\n" not in str(error.value)


def test_one_scene_without_truth_is_no_reason_to_refuse() -> None:
    made = draw_samples(EvaluationSamplesParams(**SMALL), inputs(unknown(), scene()))
    assert (made["labels"][made["scene"] == 0] == UNKNOWN).all()


def test_refuses_no_scene() -> None:
    with pytest.raises(StageError, match="name a dataset with a training split"):
        draw_samples(EvaluationSamplesParams(), {"disparity": [], "right_disparity": [], "truth": []})
