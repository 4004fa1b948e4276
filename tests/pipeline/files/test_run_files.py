import csv
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from safetensors import safe_open

from semidense.cache import Store
from semidense.datasets.formats.pfm import read_pfm
from semidense.pipeline.figures.colours import confidence_rgb, disparity_rgb
from semidense.pipeline.files.run_files import COLUMNS, export, require_run_place, require_sweep_place, write_rows
from semidense.pipeline.files.writing import writable_folder
from semidense.pipeline.plan import shipped_weights as shipped
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.images_and_truth import IMAGES, TRUTH
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import SPLIT, Step
from semidense.pipeline.results.metric_rows import METHOD
from semidense.pipeline.results.result import Result
from semidense.stages.catalog import STAGES
from semidense.stages.stage import Stage
from tests.tiny import NETS

N = np.nan
RAW = np.array([[10, 20, N], [30, 40, 50]], np.float32)
CONFIDENCE = np.array([[0.05, 0.95, N], [0.3, 0.5, 0.7]], np.float32)
NUMBERS = itertools.count()


@dataclass
class Run:
    """A run whose products are made by hand."""

    store: Store
    made: dict[str, Made] = field(default_factory=dict)
    targets: list[tuple[str, str]] = field(default_factory=list)
    rows: list[dict[str, Any]] = field(default_factory=list)

    def add(
        self,
        product: str,
        scene: str,
        arrays: Mapping[str, np.ndarray],
        inputs: Mapping[str, Sequence[Made]] | None = None,
        stage: Stage | None = None,
        **settings: object,
    ) -> Made:
        stage = stage or {"images": IMAGES, "truth": TRUTH, **STAGES}[product]
        inputs = inputs or {}
        ids = {name: tuple(each.step.id for each in each_made) for name, each_made in inputs.items()}
        step = Step(f"step-{next(NUMBERS)}", stage, scene, "set", None, settings, ids, None, {"code": "1f"}, {})
        digests = {each.step.id: each.digest for each_made in inputs.values() for each in each_made}
        draft = self.store.begin(step.recipe(digests), step.label)
        for name, array in arrays.items():
            dims = [f"{name}-{axis}" for axis in range(array.ndim)]
            draft.create_array(name, array.shape, str(array.dtype), array.shape, dims, {})
            draft.write(name, tuple(slice(0, length) for length in array.shape), array)
        entry = draft.publish(0.0, {"versions": {"torch": "2.0"}})
        self.made[step.id] = made = Made(step, entry.key, entry.digest, 0.0, False)
        return made

    def scene(self, name: str, net: Made, evaluation: Made, **settings: object) -> tuple[Made, Made]:
        """Add a scene's maps; return disparity and confidence."""
        images = self.add("images", name, {"left": np.zeros(1)}, pair=name)
        channels = self.add("channels", name, {"channels": np.zeros(1)}, {"images": [images]}, **settings)
        inputs = {"channels": [channels], "matching_net": [net]}
        costs = self.add("costvolume", name, {"cost": np.zeros(1)}, inputs, d_min=0)
        disparity = self.add("disparity", name, {"disparity": RAW}, {"costvolume": [costs]}, subpixel=False)
        inputs = {"images": [images], "disparity": [disparity], "evaluation_net": [evaluation]}
        return disparity, self.add("confidence", name, {"confidence": CONFIDENCE}, inputs)

    def target(self, maps: tuple[Made, Made], R: float, variant: str = "") -> None:
        disparity, confidence = maps
        values = np.where(CONFIDENCE >= R, RAW, np.float32(N))
        inputs = {"disparity": [disparity], "confidence": [confidence]}
        made = self.add("semidense", disparity.step.scene, {"disparity": values}, inputs, R=R)
        self.targets.append((made.step.id, variant))

    def nets(self) -> tuple[Made, Made]:
        """Add shipped weights."""
        arrays = {"parameters": np.zeros(3, np.float32), "loss": np.ones(1, np.float32)}
        return tuple(self.add(name, SPLIT, arrays, stage=shipped.weights_stage(name)) for name in NETS)

    def result(self) -> Result:
        return Result(Plan((), tuple(self.targets)), self.made, self.store, self.rows)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(Store(tmp_path / "cache"))


def row(scene: str = "Teddy", R: float = 0.9, **more: object) -> dict[str, Any]:
    figures = {"raw_bad": 10.0, "bad": 2.5, "invalid": 30.0, "avgerr": 0.5, "rms": 1.0, "auc": 0.1, "auc_optimal": 0.05}
    return {
        "scene": scene,
        "method": METHOD,
        "mask": "nonocc",
        "threshold_px": 1.0,
        "R": R,
        "pixels": 6,
        **figures,
        **more,
    }


def names(paths: Sequence[Path], folder: Path) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in paths]


def test_a_run_leaves_its_maps_rows_and_configuration(run: Run, tmp_path: Path) -> None:
    run.target(run.scene("trainingQ/Teddy", *run.nets()), 0.5)
    run.rows.append(row())
    folder = tmp_path / "a" / "out"
    written = export(run.result(), folder)
    maps = [f"trainingQ_Teddy/{name}" for name in ("disparity_raw", "confidence", "disparity")]
    assert names(written, folder) == [
        *(f"{name}{end}" for name in maps for end in (".pfm", "-colour.png")),
        *("metrics.csv", "config.json"),
    ]
    assert sorted(written) == sorted(path for path in folder.rglob("*") if path.is_file())


def test_maps_come_back_as_they_were(run: Run, tmp_path: Path) -> None:
    run.target(run.scene("Teddy", *run.nets()), 0.5)
    export(run.result(), tmp_path / "out")
    semidense = np.array([[N, 20, N], [N, 40, 50]], np.float32)
    for name, expected in (("disparity_raw", RAW), ("confidence", CONFIDENCE), ("disparity", semidense)):
        np.testing.assert_array_equal(read_pfm(tmp_path / "out" / "Teddy" / f"{name}.pfm"), expected)


def test_pictures_of_raw_and_filtered_map_share_their_colours(run: Run, tmp_path: Path) -> None:
    run.target(run.scene("Teddy", *run.nets()), 0.5)
    export(run.result(), tmp_path)
    raw, filtered, confidence = (
        np.asarray(Image.open(tmp_path / "Teddy" / f"{name}-colour.png"))
        for name in ("disparity_raw", "disparity", "confidence")
    )
    np.testing.assert_array_equal(raw, disparity_rgb(RAW, 10, 50))
    np.testing.assert_array_equal(filtered[0, 1], raw[0, 1])
    assert filtered[0, 0].tolist() == [0, 0, 0]
    np.testing.assert_array_equal(confidence, confidence_rgb(CONFIDENCE))


def test_a_sweep_over_thresholds_names_only_what_differs(run: Run, tmp_path: Path) -> None:
    maps = run.scene("Teddy", *run.nets())
    for R in (0.05, 0.9, 0.125):
        run.target(maps, R, f"semidense.R={R:g}")
    written = names(export(run.result(), tmp_path / "out"), tmp_path / "out")
    assert [name for name in written if name.endswith(".pfm")] == [
        *("Teddy/disparity_raw.pfm", "Teddy/confidence.pfm"),
        *("Teddy/disparity-R0.05.pfm", "Teddy/disparity-R0.90.pfm", "Teddy/disparity-R0.125.pfm"),
    ]


def test_a_sweep_over_other_settings_names_those_that_a_file_depends_on(run: Run, tmp_path: Path) -> None:
    nets = run.nets()
    for window in (15, 31):
        maps = run.scene("Teddy", *nets, rank_window=window)
        run.target(maps, 0.5, f"semidense.R=0.5, channels.rank_window={window}")
    written = names(export(run.result(), tmp_path / "out"), tmp_path / "out")
    assert [name for name in written if name.endswith(".pfm")] == [
        *(
            f"Teddy/{name}-channels.rank_window={window}.pfm"
            for name in ("disparity_raw", "confidence")
            for window in (15, 31)
        ),
        *(f"Teddy/disparity-R0.50-channels.rank_window={window}.pfm" for window in (15, 31)),
    ]


@pytest.mark.parametrize(
    "hostile",
    ["../../outside", "/tmp/outside", "..", "a/../../b", "C:\\outside", "\0", "~", "-rf", "con", "x" * 500],
    ids=lambda name: repr(name[:20]),
)
def test_a_hostile_name_stays_in_the_folder(run: Run, tmp_path: Path, hostile: str) -> None:
    run.target(run.scene(hostile, *run.nets()), 0.5)
    folder = tmp_path / "deep" / "out"
    written = export(run.result(), folder)
    assert all(path.resolve().is_relative_to(folder.resolve()) for path in written)
    assert {path.name for path in (tmp_path / "deep").iterdir()} == {"out"}
    assert len({path.parent for path in written}) == 2


def test_scenes_that_would_share_a_folder_do_not(run: Run, tmp_path: Path) -> None:
    nets = run.nets()
    for scene in ("a/b", "a_b"):
        run.target(run.scene(scene, *nets), 0.5)
    assert len({path.parent for path in export(run.result(), tmp_path)}) == 3


def test_shipped_weights_and_training_scenes_are_not_written(run: Run, tmp_path: Path) -> None:
    nets = run.nets()
    run.scene("train-0", *nets)
    run.target(run.scene("Teddy", *nets), 0.5)
    written = names(export(run.result(), tmp_path), tmp_path)
    assert [name for name in written if "train" in name or "safetensors" in name] == []


def test_trained_weights_come_with_how_they_were_made(run: Run, tmp_path: Path) -> None:
    from semidense.stages.evaluation.net import EvaluationNet
    from semidense.stages.learning.parameters import count
    from semidense.stages.weights import read_weights

    net, shipped_evaluation = run.nets()
    disparity, _ = run.scene("train-0", net, shipped_evaluation)
    truth = run.add("truth", "train-0", {"disparity": RAW})
    inputs = {"disparity": [disparity], "truth": [truth]}
    samples = run.add("evaluation_samples", SPLIT, {"labels": np.zeros(1)}, inputs, tolerance=1.0)
    parameters = np.linspace(-1, 1, count(EvaluationNet()), dtype=np.float32)
    images = next(made for made in run.made.values() if made.step.product == "images")
    trained = run.add(
        "evaluation_net",
        SPLIT,
        {"parameters": parameters, "loss": np.r_[np.full(50, 9.0), np.full(50, 0.25)].astype(np.float32)},
        {"evaluation_samples": [samples], "images": [images], "disparity": [disparity]},
        steps=100,
    )
    run.targets.append((trained.step.id, ""))
    written = export(run.result(), tmp_path / "out")
    assert names(written, tmp_path / "out") == ["evaluation_net.safetensors", "config.json"]
    again = read_weights("evaluation_net", written[0].read_bytes())
    np.testing.assert_array_equal(again["parameters"], parameters)
    assert again["loss"].tolist() == [9.0] * 50 + [0.25] * 50
    with safe_open(written[0], "numpy") as file:
        metadata = file.metadata()
    told = {name: json.loads(text) for name, text in metadata.items() if name != "product"}
    assert told["configuration"]["evaluation_net"] == {"steps": 100}
    assert told["configuration"]["evaluation_samples"] == {"tolerance": 1.0}
    assert told["training_data"]["evaluation_samples"] == samples.digest
    assert told["training_data"]["images"] == [images.digest]
    assert (told["loss"], told["steps"], told["versions"]) == (0.25, 100, {"torch": "2.0"})
    assert (metadata["product"], told["key"]) == ("evaluation_net", trained.key)


def test_the_configuration_tells_settings_keys_versions_and_command(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["pipeline", "run"])
    run.target(run.scene("trainingQ/Teddy", *run.nets(), rank_window=31), 0.5, "semidense.R=0.5")
    document = json.loads(export(run.result(), tmp_path)[-1].read_text())
    assert document["command"] == ["pipeline", "run"]
    assert set(document["versions"]) >= {"numpy", "torch", "semidense-stereo"}
    (made,) = document["configuration"]
    target = run.made[run.targets[0][0]]
    assert (made["product"], made["scene"], made["folder"], made["variant"]) == (
        *("semidense", "trainingQ/Teddy", "trainingQ_Teddy"),
        "semidense.R=0.5",
    )
    assert made["settings"]["semidense"] == {"R": 0.5}
    assert made["settings"]["channels"] == {"rank_window": 31}
    assert made["keys"]["semidense"] == target.key


def test_columns_are_exactly_what_is_promised(tmp_path: Path) -> None:
    write_rows([row()], tmp_path / "a.csv")
    head, values = (tmp_path / "a.csv").read_text().splitlines()
    assert head == "scene,method,mask,threshold_px,R,pixels,raw_bad,bad,invalid,avgerr,rms,auc,auc_optimal"
    assert values == f"Teddy,{METHOD},nonocc,1.0,0.9,6,10.0,2.5,30.0,0.5,1.0,0.1,0.05"


def test_what_does_not_apply_is_empty(tmp_path: Path) -> None:
    nothing_reported = row(scene='a,"b')
    del nothing_reported["bad"], nothing_reported["R"]
    write_rows([nothing_reported], tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        (read,) = csv.DictReader(file)
    assert (read["scene"], read["bad"], read["R"]) == ('a,"b', "", "")


@pytest.mark.parametrize(
    ("rows", "columns"),
    [
        pytest.param([], COLUMNS, id="no-rows"),
        pytest.param([row(R=R, variant=f"semidense.R={R}") for R in (0.1, 0.9)], COLUMNS, id="R-tells-the-rows-apart"),
        pytest.param(
            [row(variant=f"channels.rank_window={window}") for window in (15, 31)],
            (*COLUMNS, "variant"),
            id="only-the-variant-does",
        ),
    ],
)
def test_a_variant_is_a_column_only_if_it_is_needed(
    rows: list[dict[str, Any]], columns: Sequence[str], tmp_path: Path
) -> None:
    write_rows(rows, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[0].split(",") == list(columns)


def test_a_table_of_somebody_else_is_refused_beforehand(tmp_path: Path) -> None:
    for name in ("metrics.csv", "sweep.csv"):
        (tmp_path / name).write_text("mine")
    with pytest.raises(UsageError, match=r"metrics\.csv: this file was not written by"):
        require_run_place(tmp_path, "metrics")
    require_run_place(tmp_path, "disparity")
    with pytest.raises(UsageError, match=r"sweep\.csv: this file was not written by"):
        require_sweep_place(tmp_path)
    with pytest.raises(UsageError, match=r"metrics\.csv is a file"):
        require_sweep_place(tmp_path / "metrics.csv" / "out")


@pytest.mark.parametrize("place", [pytest.param("file", id="a-file"), pytest.param("file/out", id="below-a-file")])
def test_a_folder_that_cannot_be_written_is_one_line(run: Run, tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("mine")
    run.target(run.scene("Teddy", *run.nets()), 0.5)
    with pytest.raises(UsageError, match="cannot be written") as refused:
        export(run.result(), tmp_path / place)
    assert "\n" not in str(refused.value)
    assert (tmp_path / "file").read_text() == "mine"


def test_files_are_replaced_and_nothing_is_left_beside_them(run: Run, tmp_path: Path) -> None:
    run.target(run.scene("Teddy", *run.nets()), 0.5)
    out = tmp_path / "out"
    assert export(run.result(), out) == export(run.result(), out)
    assert len([path for path in out.rglob("*") if path.is_file()]) == 7


def test_of_the_scenes_of_a_run_no_older_file_stays_and_others_keep_theirs(run: Run, tmp_path: Path) -> None:
    nets, out = run.nets(), tmp_path / "out"
    for scene in ("Teddy", "Cones"):
        run.target(run.scene(scene, *nets), 0.5)
    run.rows.append(row())
    export(run.result(), out)
    (out / "Teddy" / "disparity.pfm").rename(out / "Teddy" / "disparity-R0.50.pfm")  # as of a sweep
    (out / "Cones" / "notes.txt").write_text("mine")
    (out / "evaluation_net.safetensors").write_text("trained for hours")
    record = json.loads((out / "config.json").read_text())
    record["files"] += ["Teddy/disparity-R0.50.pfm", "evaluation_net.safetensors"]
    (out / "config.json").write_text(json.dumps(record))
    cones = names(sorted((out / "Cones").iterdir()), out)
    run.rows.clear()
    run.targets.clear()
    run.target(run.scene("Teddy", *nets), 0.5)
    written = names(export(run.result(), out), out)
    there = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert there == {*written, *cones, "evaluation_net.safetensors"}
    record = json.loads((out / "config.json").read_text())
    assert {*record["files"]} == there - {"Cones/notes.txt"}
    assert [each["scene"] for each in record["configuration"]] == ["Cones", "Teddy"]


@pytest.mark.parametrize("name", ["../confidence.pfm", "thesis.pfm", "a/../../disparity.pfm"])
def test_a_record_makes_an_export_delete_nothing_that_it_never_writes(run: Run, tmp_path: Path, name: str) -> None:
    run.target(run.scene("Teddy", *run.nets()), 0.5)
    out = tmp_path / "out"
    out.mkdir()
    mine = out / "a" / ".." / name
    (out / "a").mkdir()
    mine.write_text("mine")
    (out / "config.json").write_text(json.dumps({"files": [name]}))
    export(run.result(), out)
    assert mine.read_text() == "mine"


def test_a_folder_is_made_and_left_empty(tmp_path: Path) -> None:
    writable_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
