import hashlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from semidense.datasets import Dataset, SceneSource, open_dataset
from semidense.pipeline.api import Task, status
from semidense.pipeline.plan import shipped_weights as shipped
from semidense.pipeline.plan.building import build
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.presets import PRESETS
from semidense.pipeline.plan.steps import SPLIT, Graph, Request, Step, products
from semidense.pipeline.plan.training_split import training_scenes
from semidense.stages.catalog import CATALOG, READ, STAGES
from semidense.stages.stage import Output, Stage, StageError
from tests.tiny import PATH, SPEC, TEST_ONLY

DATASET = open_dataset("synthetic:train=2,test=2,height=64,width=80,disparities=8")
SHIPPED = {"matching_net", "evaluation_net"}


@pytest.fixture(autouse=True)
def weights_of_no_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Graphs need the digest of the weights only."""
    (tmp_path / "weights").write_bytes(b"none")
    monkeypatch.setattr(shipped, "weights_file", lambda _: tmp_path / "weights")
    shipped.weights_digest.cache_clear()
    yield
    shipped.weights_digest.cache_clear()


TRAINING = {"matching_samples", "right_disparity", "evaluation_samples"}
"""Products of a whole run that only a training needs."""


def graph(*settings: str, upto: str = "metrics", train: bool = False, dataset: Dataset = DATASET) -> Graph:
    training = training_scenes(dataset) if train else ()
    return build(Request(dataset, {"": Config.load(None, settings)}, upto, train, training))


def counts(made: Graph) -> Counter[str]:
    return Counter(step.product for step in made.steps.values())


def test_without_training_every_scene_is_worked_on_with_the_shipped_weights() -> None:
    made = graph()
    assert counts(made) == Counter(dict.fromkeys(PATH - TRAINING, 4)) - Counter(dict.fromkeys(SHIPPED, 3))
    assert len(made.targets) == 4


def test_two_stages_of_one_module_of_another_package_are_two_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    def key(compute: str, dtype: str) -> str:
        outputs = (Output("disparity", ("y", "x"), dtype, "px", "disparity"),)
        monkeypatch.setitem(STAGES, "theirs", Stage("theirs", ("images",), outputs, compute))
        made = find(graph(upto="theirs"), "theirs")
        return made.recipe({each: "0" * 64 for ids in made.inputs.values() for each in ids}).key

    module = "tests.pipeline.toy"
    keys = [
        key(f"{module}:make_sum", "float32"),
        key(f"{module}:refuse", "float32"),
        key(f"{module}:refuse", "float64"),
    ]
    assert len({*keys}) == 3


def test_figures_of_scenes_that_the_weights_may_know_are_told_to_be_no_test() -> None:
    (note,) = graph().notes
    assert note.startswith("train-0 and train-1 are training scenes: the package's weights may have learnt from them")
    assert graph(upto="disparity").notes == [], "nothing is judged"


def test_with_training_the_training_scenes_are_only_learnt_from() -> None:
    made = graph(train=True)
    four = dict.fromkeys(("images", "truth", "channels", "costvolume", "disparity"), 4)
    one = dict.fromkeys(("matching_samples", "matching_net", "evaluation_samples", "evaluation_net"), 1)
    scored = ("right_disparity", "distinctiveness", "cost_margin", "confidence", "semidense", "ranking", "metrics")
    two = dict.fromkeys(scored, 2)
    assert counts(made) == Counter({**four, **one, **two})
    assert [made.steps[each].scene for each, _ in made.targets] == ["test-0", "test-1"]
    left_out = "are training scenes: they are left out, since nothing is tested on them"
    assert made.notes == [f"train-0 and train-1 {left_out}"]


def test_a_hundred_training_scenes_are_told_in_one_short_line() -> None:
    first = training_scenes(DATASET)[0]
    many = Dataset("many", tuple(replace(first, name=f"train-{n}") for n in range(116)))
    with pytest.raises(UsageError) as caught:
        build(Request(many, {"": Config.load()}, "metrics", True, many.scenes))
    assert "train-0, train-1, train-2 and 113 more are training scenes" in str(caught.value)
    assert len(str(caught.value)) < 200


def test_a_warning_of_several_scenes_is_told_once() -> None:
    doubtful = tuple(replace(scene, warnings=("its file is old",)) for scene in DATASET.scenes)
    made = graph(upto="disparity", dataset=Dataset("doubtful", doubtful))
    assert made.notes == ["train-0, train-1, test-0 and test-1: its file is old"]


def test_training_scenes_are_known_by_their_content_not_their_name() -> None:
    renamed = tuple(replace(scene, name=f"other/{scene.name}", split="test") for scene in DATASET.scenes)
    request = Request(Dataset("renamed", renamed), {"": Config.load()}, "metrics", True, training_scenes(DATASET))
    made = build(request)
    assert [made.steps[each].scene for each, _ in made.targets] == ["other/test-0", "other/test-1"]
    assert [note.split(" are ")[0] for note in made.notes] == ["other/train-0 and other/train-1"]


def test_where_all_scenes_are_trained_on_nothing_is_left() -> None:
    only = Dataset("synthetic", training_scenes(DATASET))
    with pytest.raises(UsageError, match="no scene is left to work on; train-0 and train-1 are training") as caught:
        build(Request(only, {"": Config.load()}, "metrics", True, only.scenes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("upto", ["matching_samples", "matching_net", "evaluation_net"])
def test_a_product_of_the_split_is_made_once(upto: str) -> None:
    made = graph(upto=upto, train=True)
    ((target, _),) = made.targets
    assert (made.steps[target].product, made.steps[target].scene) == (upto, SPLIT)
    assert {step.scene for step in made.steps.values()} == {"train-0", "train-1", SPLIT}


def test_a_training_can_rest_on_networks_that_come_with_the_package() -> None:
    made = graph('training.shipped=["matching_net"]', upto="evaluation_net", train=True)
    assert "matching_samples" not in counts(made)
    assert find(made, "matching_net", SPLIT).settings == find(graph(), "matching_net", SPLIT).settings
    assert "shipped" not in find(made, "evaluation_net", SPLIT).settings


def behind(made: Graph, step_id: str) -> set[str]:
    """Return the ids of a step and of all that it is made from."""
    inputs = (each for ids in made.steps[step_id].inputs.values() for each in ids)
    return {step_id}.union(*(behind(made, each) for each in inputs))


def seen_by(made: Graph, net: str) -> set[str]:
    """Return the scenes whose truth a network has learnt from."""
    return {made.steps[each].scene for each in behind(made, net) if made.steps[each].product == "truth"}


@pytest.mark.parametrize("upto", ["evidence_net", "calibration"])
def test_cross_fitted_maps_are_by_networks_that_have_not_seen_the_scene(upto: str) -> None:
    made = graph(*PRESETS["robust"], upto=upto, train=True)
    drawn = [step for step in made.steps.values() if step.product == "evidence_samples"]
    assert {step.scene for step in drawn} == {"train-0", "train-1"}
    for step in drawn:
        (costs,) = made.steps[step.inputs["disparity"][0]].inputs["costvolume"]
        assert seen_by(made, made.steps[costs].inputs["descriptor_net"][0]) == {"train-0", "train-1"} - {step.scene}
        (net,) = step.inputs["evaluation_net"]
        assert {made.steps[each].scene for each in made.steps[net].inputs["images"]}.isdisjoint({step.scene})


def test_the_maps_that_are_learnt_from_can_be_fewer_than_the_scenes_of_the_costs() -> None:
    many = open_dataset("synthetic:train=6,test=1,height=64,width=80,disparities=8")
    made = graph("training.maps=2", "training.cross_fit=true", upto="calibration", train=True, dataset=many)
    names = {step.scene for step in made.steps.values() if step.product == "disparity"}
    assert names == {"train-2", "train-5"}
    ((target, _),) = made.targets
    assert made.steps[target].settings["fold_of_scene"] == [0, 1]
    learnt = {step.scene for step in made.steps.values() if step.product == "channels"}
    assert learnt == {f"train-{number}" for number in range(6)}


def test_held_out_scenes_are_judged_by_networks_that_have_not_seen_them() -> None:
    made = graph(*PRESETS["robust"], "training.held_out=true", train=True)
    judged = [made.steps[target] for target, _ in made.targets]
    assert [(step.product, step.scene) for step in judged] == [("metrics", "train-0"), ("metrics", "train-1")]
    for step in judged:
        inputs = [made.steps[each] for each in behind(made, step.id)]
        (costs,) = (each for each in inputs if each.product == "costvolume" and each.scene == step.scene)
        assert seen_by(made, costs.inputs["descriptor_net"][0]) == {"train-0", "train-1"} - {step.scene}
        (confidence,) = (each for each in inputs if each.product == "confidence" and each.scene == step.scene)
        for net, learnt_from in (("evaluation_net", "images"), ("evidence_net", "evidence_samples")):
            learnt = made.steps[confidence.inputs[net][0]].inputs[learnt_from]
            assert {made.steps[each].scene for each in learnt} == {"train-0", "train-1"} - {step.scene}


def test_folds_of_which_one_has_all_the_maps_are_refused() -> None:
    many = open_dataset("synthetic:train=4,test=1,height=64,width=80,disparities=8")
    config = Config.load(None, ["training.maps=2"])
    with pytest.raises(UsageError, match=r"its maps are of one fold; change training\.maps"):
        build(Request(many, {"": config}, "calibrated_confidence", True, training_scenes(many)))


def test_held_out_scenes_are_judged_beside_pairs_of_unknown_range(tmp_path: Path) -> None:
    scene = open_dataset(TEST_ONLY).scenes[0].load()
    for side, view in (("l", scene.left), ("r", scene.right)):
        Image.fromarray(view).save(tmp_path / f"{side}.png")
    task = Task(f"{SPEC}+pair:{tmp_path}/l.png,{tmp_path}/r.png", train=True, settings=["training.held_out=true"])
    plan = status(task, "disparity", cache=tmp_path / "cache")
    assert {planned.step.scene for planned in plan.steps if planned.step.product == "disparity"} == {
        "train-0",
        "train-1",
    }


def test_held_out_scenes_are_those_whose_maps_are_learnt_from_and_that_were_asked_for() -> None:
    many = open_dataset("synthetic:train=6,test=1,height=64,width=80,disparities=8")
    config = Config.load(None, ["training.held_out=true", "training.maps=3"])
    asked = many.select(["train-1", "train-2", "test-0"])
    made = build(Request(asked, {"": config}, "disparity", True, training_scenes(many)))
    assert [made.steps[target].scene for target, _ in made.targets] == ["train-1"]
    assert [note for note in made.notes if "training.held_out judges 1 of 2 training scenes" in note]


@pytest.mark.parametrize(
    ("settings", "train", "named", "told"),
    [
        pytest.param((), False, "train-0", r"judges .* add --train", id="nothing is trained"),
        pytest.param((), True, "test-0", r"and none is named", id="no training scene"),
        pytest.param(("semidense.max_error=0.1",), True, "train-0", r"no calibration; give R", id="a wanted error"),
        pytest.param(("semidense.calibrated=true",), True, "train-0", r"no calibration; give R", id="calibrated"),
    ],
)
def test_what_cannot_be_held_out_is_refused(settings: tuple[str, ...], train: bool, named: str, told: str) -> None:
    config = Config.load(None, ["training.held_out=true", *settings])
    training = training_scenes(DATASET) if train else ()
    with pytest.raises(UsageError, match=told) as caught:
        build(Request(DATASET.select([named]), {"": config}, "metrics", train, training))
    assert "\n" not in str(caught.value)


def test_a_calibration_takes_the_cross_fitted_maps_of_the_evidence() -> None:
    made = graph(*PRESETS["robust"], upto="calibration", train=True)
    ((target, _),) = made.targets
    samples = {step.scene: step for step in made.steps.values() if step.product == "evidence_samples"}
    for scored, shown in zip(*(made.steps[target].inputs[each] for each in ("confidence", "disparity")), strict=True):
        step = made.steps[scored]
        assert step.inputs["disparity"] == (shown,) == samples[step.scene].inputs["disparity"]
        net = made.steps[step.inputs["evidence_net"][0]]
        learnt = {made.steps[each].scene for each in net.inputs["evidence_samples"]}
        assert learnt == {"train-0", "train-1"} - {step.scene}


@pytest.mark.parametrize(("mode", "ending"), [("exact", ""), ("guided", ".guided"), ("fast", "")])
def test_raw_maps_of_a_mode_are_scored_by_what_was_learnt_from_such(mode: str, ending: str) -> None:
    made = graph(f"costvolume.mode={mode}", "semidense.max_error=0.1", upto="semidense")
    used = {step.argument.name for step in made.steps.values() if "shipped" in step.settings}
    nets = {"matching_net", "descriptor_net"} - {{"exact": "descriptor_net", "fast": "matching_net"}.get(mode)}
    assert used == nets | {f"evaluation_net{ending}", f"calibration{ending}"}


def test_a_run_stops_at_the_product_asked_for() -> None:
    assert set(counts(graph(upto="channels"))) == {"images", "channels"}
    assert set(counts(graph(upto="costvolume"))) == {"images", "channels", "matching_net", "costvolume"}


@pytest.mark.parametrize(
    ("upto", "train"),
    [
        (upto, train)
        for upto in (*READ, *(stage.product for stage in CATALOG))
        for train in (False, True)
        if train or not upto.endswith("_samples")  # samples are drawn for training only
    ],
)
def test_every_step_comes_after_its_inputs(upto: str, train: bool) -> None:
    before: set[str] = set()
    for step in graph(upto=upto, train=train).steps.values():
        assert {each for ids in step.inputs.values() for each in ids} <= before
        before.add(step.id)


def test_products_are_in_order() -> None:
    places = [products().index(step.product) for step in graph(train=True).steps.values()]
    assert places == sorted(places)


def variants(*each: str) -> Graph:
    configs = {setting: Config.load(None, [setting]) for setting in each}
    return build(Request(DATASET.select(["test-0"]), configs))


def test_a_sweep_over_the_threshold_shares_all_above() -> None:
    made = variants("semidense.R=0.1", "semidense.R=0.5", "semidense.R=0.9")
    assert {product: count for product, count in counts(made).items() if count > 1} == {"semidense": 3, "metrics": 3}
    assert [variant for _, variant in made.targets] == ["semidense.R=0.1", "semidense.R=0.5", "semidense.R=0.9"]
    assert [made.steps[each].R for each, _ in made.targets] == [0.1, 0.5, 0.9]


def test_a_sweep_over_a_setting_shares_what_does_not_depend_on_it() -> None:
    made = counts(variants("disparity.subpixel=true", "disparity.subpixel=false"))
    assert {product for product, count in made.items() if count == 1} == {
        "images", "truth", "channels", "matching_net", "costvolume", "evaluation_net", "distinctiveness", "cost_margin",
    }  # fmt: skip


def test_equal_configurations_are_one() -> None:
    assert len(variants("semidense.R=0.9", "channels.rank_window=31").steps) == len(variants("semidense.R=0.9").steps)


def without_truth() -> Dataset:
    """As in KITTI's test set: a scene whose truth is not published."""
    scenes = [replace(scene, has_truth=scene.name != "test-1") for scene in DATASET.scenes]
    return Dataset("kitti", tuple(scenes))


def test_a_scene_without_truth_gets_maps_and_no_metrics() -> None:
    made = graph(dataset=without_truth())
    last = {made.steps[each].scene: made.steps[each].product for each, _ in made.targets}
    assert last == {"train-0": "metrics", "train-1": "metrics", "test-0": "metrics", "test-1": "semidense"}
    assert made.notes[1:] == ["test-1 has no ground truth: no metrics can be made for it"]
    assert not [step for step in made.steps.values() if step.product == "truth" and step.scene == "test-1"]


def test_a_scene_without_truth_is_not_trained_on() -> None:
    scenes = tuple(replace(scene, has_truth=scene.name != "train-0") for scene in DATASET.scenes)
    assert [scene.name for scene in training_scenes(Dataset("some", scenes))] == ["train-1"]


def test_a_dataset_without_training_scenes_says_what_to_do() -> None:
    with pytest.raises(UsageError, match=r"has no training scene: name a dataset .* --set training.dataset="):
        training_scenes(DATASET.select(["test-0"]))


def test_without_shipped_weights_one_is_told_to_train(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(product: str) -> Path:
        raise StageError(f"no weights for {product}: train them with --train")

    monkeypatch.setattr(shipped, "weights_file", none)
    with pytest.raises(StageError, match="--train"):
        graph(upto="costvolume")
    assert set(counts(graph(upto="channels"))) == {"images", "channels"}, "nothing needs them up to here"


def find(made: Graph, product: str, scene: str = "test-0") -> Step:
    return next(step for step in made.steps.values() if (step.product, step.scene) == (product, scene))


def test_what_is_left_open_is_filled_in_from_the_scene() -> None:
    settings = find(graph(upto="costvolume"), "costvolume").settings
    assert (settings["d_min"], settings["d_max"]) == (0, 8)
    assert settings["precision"] in ("float32", "bfloat16")
    assert settings["tiles"] == "32 rows, halo 5, edge"
    assert set(settings) == {"d_min", "d_max", "precision", "tiles"}, "a guided volume's settings are in no other's key"


def test_a_guided_volume_is_another_product() -> None:
    exact, guided = (
        find(graph(*settings, upto="costvolume"), "costvolume") for settings in ((), ("costvolume.mode=guided",))
    )
    assert exact.id != guided.id and guided.settings["mode"] == "guided"
    assert guided.settings["tiles"] == "32 rows, halo 12, edge"


def test_a_fast_volume_is_made_by_the_descriptor_net_alone() -> None:
    made = graph("costvolume.mode=fast", upto="costvolume")
    fast = find(made, "costvolume")
    assert set(fast.inputs) == {"channels", "descriptor_net"} and fast.settings["tiles"] == "32 rows, halo 8, edge"
    assert "matching_net" not in {step.product for step in made.steps.values()}
    assert set(find(graph(upto="costvolume"), "costvolume").inputs) == {"channels", "matching_net"}


def test_a_range_of_the_user_s_own_wins() -> None:
    settings = find(graph("costvolume.d_min=-2", "costvolume.d_max=3", upto="costvolume"), "costvolume").settings
    assert (settings["d_min"], settings["d_max"]) == (-2, 3)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        pytest.param("costvolume.d_min=9", r"test-0.*d_max 8 lies below d_min 9", id="above the scene's own end"),
        pytest.param(
            "costvolume.d_max=80", "d_max is 80 px, but the image is only 80 px wide", id="wider than the image"
        ),
        pytest.param("costvolume.d_min=-100000", "d_min is -100000 px", id="far out on the other side"),
    ],
)
def test_a_range_that_no_pixel_can_have_is_refused(setting: str, message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        graph(setting, upto="costvolume", dataset=DATASET.select(["test-0"]))
    assert "\n" not in str(caught.value)


def test_the_widest_range_that_a_pixel_can_have_is_taken() -> None:
    settings = ("costvolume.d_min=-79", "costvolume.d_max=79")
    assert find(graph(*settings, upto="costvolume"), "costvolume").settings["d_max"] == 79


def test_ids_are_equal_for_equal_work_and_differ_else() -> None:
    assert list(graph().steps) == list(graph().steps)
    assert not set(graph("disparity.subpixel=true", upto="disparity").targets) & set(graph(upto="disparity").targets)


def test_a_step_of_the_split_takes_one_input_a_scene() -> None:
    made = graph(train=True)
    step = find(made, "evaluation_net", SPLIT)
    assert {name: len(ids) for name, ids in step.inputs.items()} == {
        "evaluation_samples": 1,
        "images": 2,
        "disparity": 2,
        "right_disparity": 2,
    }
    recipe = step.recipe({name: name for name in made.steps})
    assert [made.steps[each].scene for each in recipe.inputs["images"]] == ["train-0", "train-1"]
    assert isinstance(recipe.inputs["evaluation_samples"], str)


@pytest.mark.parametrize("product", ["costvolume", "confidence"])
def test_what_networks_say_does_not_depend_on_the_code_that_trains_them(product: str) -> None:
    step = find(graph(upto=product, dataset=DATASET.select(["test-0"])), product)
    assert not {"semidense.stages.learning.training", "semidense.stages.learning.optimiser"} & set(step.code)


def test_the_order_of_training_scenes_is_part_of_the_key() -> None:
    forward, backward = training_scenes(DATASET), training_scenes(DATASET)[::-1]
    ids = [
        build(Request(DATASET, {"": Config.load()}, "matching_net", True, scenes)).targets
        for scenes in (forward, backward)
    ]
    assert ids[0] != ids[1]


def test_a_label_names_product_dataset_and_scene() -> None:
    step = find(graph(), "disparity")
    assert step.label == {"product": "disparity", "dataset": "synthetic", "scene": "test-0"}
    assert step.name == "disparity of test-0"


def test_no_path_is_in_a_key(make_pair: Callable[[Path], Path], tmp_path: Path) -> None:
    made = [
        build(
            Request(open_dataset(f"middlebury:{make_pair(tmp_path / place / 'pair')}"), {"": Config.load()}, "channels")
        )
        for place in ("here", "there")
    ]
    assert list(made[0].steps) == list(made[1].steps)
    assert str(tmp_path) not in repr([step.settings for step in made[0].steps.values()])


def test_the_truth_s_key_holds_the_range() -> None:
    scene: SceneSource = DATASET.scenes[0]
    wider = replace(scene, disparities=replace(scene.disparities, maximum=9))
    keys = [
        next(iter(graph(upto="truth", dataset=Dataset("one", (each,))).steps.values())).settings
        for each in (scene, wider)
    ]
    assert keys[0] != keys[1]


def test_no_light_falls_on_other_channels_than_gray() -> None:
    without_gray = 'channels.use=["rank", "companion"]'
    with pytest.raises(UsageError, match="changes the light of the gray channel"):
        graph(without_gray, train=True)
    assert graph(without_gray, "matching_net.relight=0", train=True)
    with pytest.raises(UsageError, match="set descriptor_net"):
        graph(without_gray, "matching_net.relight=0", "costvolume.mode=fast", train=True)


def test_no_light_falls_on_a_raw_gray_channel() -> None:
    with pytest.raises(UsageError, match=r"channels\.gray is raw: set matching_net\.relight=0"):
        graph("channels.gray=raw", train=True)
    assert graph("channels.gray=raw", "matching_net.relight=0", train=True)
    assert graph('channels.use=["rank"]', "channels.gray=raw", "matching_net.relight=0", train=True)


def test_a_product_may_be_made_by_another_stage() -> None:
    pure = "confidence.veto=false"  # the veto asks our own costs
    plain, used = graph(pure), graph(pure, "use.disparity=sgm", "sgm.uniqueness=3")
    made = next(step for step in used.steps.values() if step.product == "disparity")
    assert made.stage.module == "semidense.stages.baselines.sgm"
    assert made.settings["uniqueness"] == 3
    assert set(counts(used)) == set(counts(plain)) - {"channels", "matching_net", "costvolume"}
    confidence = next(step for step in used.steps.values() if step.product == "confidence")
    assert made.id in confidence.inputs["disparity"]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        pytest.param("use.disparity=sgmm", r"no product 'sgmm'; did you mean sgm\?", id="no such product"),
        pytest.param("use.disparity=confidence", r"it has no array 'disparity'", id="other arrays"),
        pytest.param("use.disparity=semidense", r"it is made from disparity", id="made from itself"),
        pytest.param("use.disparity=matching_net", r"it has no array 'disparity'", id="not of a scene"),
    ],
)
def test_a_stage_that_cannot_take_the_place_is_refused(setting: str, message: str) -> None:
    with pytest.raises(UsageError, match=rf"^{setting.partition('=')[0]} = .*{message}"):
        graph(setting)


def test_own_weights_take_the_place_of_the_packages_and_of_a_training(tmp_path: Path) -> None:
    own = tmp_path / "own.safetensors"
    own.write_bytes(b"own")
    for train in (False, True):
        made = graph(f"weights.matching_net={own}", train=train)
        (step,) = [step for step in made.steps.values() if step.product == "matching_net"]
        assert step.settings == {"shipped": hashlib.sha256(b"own").hexdigest()}
        assert step.inputs == {}, "nothing is learnt"


def test_weights_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(StageError, match=rf"^weights\.matching_net = {tmp_path}/none: cannot be read .No such file"):
        graph(f"weights.matching_net={tmp_path}/none")


def test_weights_that_change_after_planning_are_refused(tmp_path: Path) -> None:
    own = tmp_path / "own.safetensors"
    own.write_bytes(b"own")
    planned = shipped.own_weights("matching_net", own)
    own.write_bytes(b"other")
    with pytest.raises(StageError, match="the weights have changed since the run was planned"):
        planned.read()
