"""Every command through the entry point, on the cache of one tiny run."""

import json
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.pipeline.results.result import Result
from tests.tiny import PATH, SPEC, TEST_ONLY, TRAINED

Invoke = Callable[..., Any]
COMMANDS = (
    *("run", "sweep", "status", "explain", "inspect", "match", "score", "compare", "report", "view"),
    *("cache ls", "cache verify", "cache size", "data list", "data fetch", "data check", "submit"),
)
STEP_KEYS = ["product", "scene", "key", "state", "changed", "why", "seconds"]


@pytest.fixture
def there(trained: Result) -> list[str]:
    """The arguments that find everything in the session's cache."""
    return [*TRAINED, "--cache", str(trained.store.root)]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(invoke: Invoke, command: str) -> None:
    ran = invoke(*command.split(), "--help")
    assert (ran.code, ran.err) == (0, "")
    assert "Usage: pipeline" in ran.out


@pytest.mark.parametrize("group", ["", "cache", "data"])
def test_no_description_of_a_command_is_cut(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, group: str) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    commands = invoke(*group.split(), "--help").out.partition("Commands:\n")[2].splitlines()
    assert commands and all(line.endswith(".") and not line.endswith("...") for line in commands)


def test_run_comes_first(invoke: Invoke) -> None:
    assert invoke("--help").out.partition("Commands:\n")[2].split()[0] == "run"


def only_object(text: str) -> dict[str, Any]:
    """Return the one JSON object that a text is."""
    found: dict[str, Any] = json.loads(text)
    assert text.count("\n") == 1
    return found


def test_run_prints_metrics_and_what_was_reused(invoke: Invoke, there: list[str]) -> None:
    ran = invoke("run", *there)
    assert ran.code == 0
    assert "raw bad %" in ran.out
    assert ran.out.splitlines()[-1] == "reused 27 products, made nothing"
    assert "train-0 and train-1 are training scenes" in ran.err


def test_run_as_json_prints_one_object(invoke: Invoke, there: list[str], trained: Result) -> None:
    ran = invoke("run", *there, "--json")
    found = only_object(ran.out)
    assert ran.err == ""
    assert set(found) == {"steps", "metrics", "files"}
    assert [list(row) for row in found["steps"]] == [STEP_KEYS] * 27
    assert {row["state"] for row in found["steps"]} == {"hit"}
    assert found["metrics"] == trained.metrics
    assert found["files"] == []


def test_run_writes_where_it_is_told(invoke: Invoke, there: list[str], tmp_path: Path) -> None:
    ran = invoke("run", *there, "--output", tmp_path / "out", "--json")
    files = [Path(file) for file in only_object(ran.out)["files"]]
    assert all(file.is_file() for file in files)
    assert {"disparity.pfm", "disparity-colour.png", "confidence-colour.png", "disparity_raw.pfm"} <= {
        file.name for file in files
    }
    said = invoke("run", *there, "-o", tmp_path / "out").out.splitlines()
    assert [line.removeprefix("wrote ") for line in said if line.startswith("wrote ")] == list(map(str, files))


@pytest.mark.parametrize("how", [["status"], ["run", "--dry-run"]], ids=" ".join)
def test_a_plan_is_printed_and_nothing_made(invoke: Invoke, there: list[str], how: list[str], trained: Result) -> None:
    before = {path.stat().st_mtime_ns for path in trained.store.root.rglob("*")}
    ran = invoke(*how, *there, "--set", "channels.rank_window=15")
    lines = [line.split() for line in ran.out.splitlines()]
    assert lines[0] == ["product", "scene", "state", "key", "why"]
    assert [line[4:] for line in lines[:28] if line[0] == "channels"] == [
        ["channels.rank_window:", "31", "->", "15"]
    ] * 3
    assert (["product", "tasks", "MB"] in [line[:3] for line in lines[28:]]) == ("--dry-run" in how)
    assert lines[-2][:3] == ["reuses", "8", "products,"]
    assert lines[-1][0] == "time:"
    found = only_object(invoke(*how, *there, "--set", "channels.rank_window=15", "--json").out)
    assert set(found) == {
        "steps",
        "metrics",
        "estimate_seconds",
        *(["workers", "stages"] if "--dry-run" in how else []),
    }
    assert [list(row) for row in found["steps"]] == [STEP_KEYS] * 27
    states = Counter(row["product"] for row in found["steps"] if row["state"] != "hit")
    assert {row["product"]: row["results"] for row in found.get("stages", ())} in ({}, states)
    assert {path.stat().st_mtime_ns for path in trained.store.root.rglob("*")} == before


def test_sweep_writes_a_table_and_a_curve(invoke: Invoke, own_cache: Path, tmp_path: Path) -> None:
    config = tmp_path / "tiny.toml"
    config.write_text(as_toml(TRAINED))
    arguments = ["sweep", SPEC, "--train", "--config", config, "--cache", own_cache, "-o", tmp_path / "s"]
    ran = invoke(*arguments, "--R", "0,0.9")
    assert ran.code == 0
    assert ran.out.splitlines()[-1] == "reused 27 products, made 1 semidense, 1 metrics"
    assert sorted(path.name for path in (tmp_path / "s").iterdir()) == ["sweep.csv", "sweep.json", "sweep.png"]
    found = only_object(invoke(*arguments, "--R", "0,0.9", "--json").out)
    assert {row["R"] for row in found["metrics"]} == {0, 0.9}
    assert {row["state"] for row in found["steps"]} == {"hit"}
    assert len((tmp_path / "s" / "sweep.csv").read_text().splitlines()) == 1 + len(found["metrics"])


def as_toml(arguments: list[str]) -> str:
    """Return the settings among a command's arguments as a file."""
    settings = [text for before, text in pairwise(arguments) if before == "--set"]
    return "\n".join(settings)  # dotted keys are TOML


@pytest.mark.parametrize("product", sorted(PATH - {"right_disparity"}))
def test_explain_shows_what_a_key_is_made_of(invoke: Invoke, there: list[str], product: str) -> None:
    ran = invoke("explain", product, *there, "--scene", "test-0")
    if product in ("matching_samples", "matching_net", "evaluation_samples", "evaluation_net"):
        ran = invoke("explain", product, *there)
    assert ran.code == 0, ran.err
    assert ran.out.splitlines()[0].startswith(f"{product} of ")
    assert ran.out.splitlines()[0].endswith(": hit")
    assert [line for line in ran.out.splitlines() if line in ("params", "inputs", "environment", "code")] == [
        "params",
        "inputs",
        "environment",
        "code",
    ]


def test_explain_as_json_is_the_recipe(invoke: Invoke, there: list[str], trained: Result) -> None:
    found = only_object(invoke("explain", "costvolume", *there, "--json").out)
    assert found["key"] == trained.find("costvolume", "test-0").key
    assert set(found["recipe"]) == {"stage", "code", "params", "inputs", "environment", "version"}
    assert found["recipe"]["inputs"]["matching_net"] == trained.find("matching_net").digest
    assert found["extras"]["configuration"]["semidense"] == {
        "R": 0.9,
        "density": None,
        "max_error": None,
        "calibrated": False,
    }


@pytest.mark.parametrize("product", ["images", "channels", "costvolume", "disparity", "confidence", "semidense"])
def test_inspect_shows_and_draws(invoke: Invoke, trained: Result, tmp_path: Path, product: str) -> None:
    arguments = [*TRAINED, "--cache", trained.store.root, "--scene", "test-0"]
    ran = invoke("inspect", product, *arguments, "--png", tmp_path / "p.png")
    assert ran.code == 0, ran.err
    assert "xarray.Dataset" in ran.out
    assert "open_product" in ran.out
    assert np.asarray(Image.open(tmp_path / "p.png")).size > 0


def test_inspect_draws_the_curve_of_a_pixel(invoke: Invoke, there: list[str], tmp_path: Path) -> None:
    ran = invoke("inspect", "costvolume", *there, "--png", tmp_path / "p.png", "--pixel", "20,30", "--disparity", "4")
    assert ran.code == 0, ran.err
    assert (tmp_path / "p.png").is_file()


def test_inspect_as_json_gives_statistics(invoke: Invoke, there: list[str]) -> None:
    found = only_object(invoke("inspect", "disparity", *there, "--json").out)
    assert set(found) == {"product", "scene", "key", "arrays", "png"}
    (array,) = found["arrays"]
    assert array["name"] == "disparity"
    assert (array["dims"], array["dtype"], array["units"]) == ("y 64 x x 80", "float32", "px")
    assert 0 <= array["min"] <= array["mean"] <= array["max"] <= 8


def test_the_line_for_python_works(invoke: Invoke, there: list[str]) -> None:
    line = invoke("inspect", "disparity", *there).out.splitlines()[-1].removeprefix("in Python: ")
    names: dict[str, Any] = {}
    imports, expression = line.split("; ")
    exec(imports, names)  # the very line that the user is told to type
    assert eval(expression, names)["disparity"].sizes["x"] == 80


def test_cache_ls_lists_every_entry(invoke: Invoke, trained: Result) -> None:
    root = trained.store.root
    lines = invoke("cache", "ls", "--cache", root).out.splitlines()
    assert len(lines) == 2 + len(list(trained.store.entries())), "a header, a line each, and how many there are"
    entries = only_object(invoke("cache", "ls", "--cache", root, "--json").out)["entries"]
    assert set(entries[0]) == {
        *("product", "dataset", "scene", "key", "digest", "created", "seconds", "bytes", "last_used", "settings")
    }


def test_cache_verify_finds_a_flipped_byte(invoke: Invoke, own_cache: Path) -> None:
    assert invoke("cache", "verify", "--cache", own_cache).code == 0
    chunk = max(
        (path for path in (own_cache / "entries").rglob("c/*") if path.is_file()), key=lambda p: p.stat().st_size
    )
    chunk.chmod(0o600)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    ran = invoke("cache", "verify", "--cache", own_cache)
    assert ran.code == 1
    assert "1 damaged" in ran.out.splitlines()[-1]
    found = only_object(invoke("cache", "verify", "--cache", own_cache, "--json").out)
    assert len(found["damaged"]) == 1


def test_cache_size_sums_up(invoke: Invoke, trained: Result) -> None:
    found = only_object(invoke("cache", "size", "--cache", trained.store.root, "--json").out)
    assert set(found) == {"cache", "products", "quarantine", "drafts", "orphans", "bookkeeping", "total"}
    assert set(found["products"]) == PATH
    assert "costvolume" in invoke("cache", "size", "--cache", trained.store.root).out


@pytest.mark.parametrize("command", [["cache", "ls"], ["cache", "verify"], ["cache", "size"]], ids=" ".join)
def test_looking_into_a_cache_that_is_not_there_makes_none(invoke: Invoke, tmp_path: Path, command: list[str]) -> None:
    assert invoke(*command, "--cache", tmp_path / "none").code == 0
    assert not (tmp_path / "none").exists()


def test_data_list_names_datasets_and_scenes(invoke: Invoke) -> None:
    patterns = [row["dataset"] for row in only_object(invoke("data", "list", "--json").out)["datasets"]]
    assert patterns[:2] == ["motorcycle", "middlebury:DIR"]
    rows = only_object(invoke("data", "list", SPEC, "--json").out)["scenes"]
    assert [row["scene"] for row in rows] == ["train-0", "train-1", "test-0"]
    assert rows[0] == {
        "scene": "train-0", "rows": 64, "columns": 80, "d_min": 0, "d_max": 8, "split": "train", "truth": True,
    }  # fmt: skip
    assert "test-0" in invoke("data", "list", SPEC).out
    assert "kitti2015:DIR" in invoke("data", "list").out


def test_the_environment_names_the_cache(invoke: Invoke, trained: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPELINE_CACHE", str(trained.store.root))
    assert invoke("run", *TRAINED).out.splitlines()[-1] == "reused 27 products, made nothing"


def test_shipped_weights_are_used_without_train(invoke: Invoke, weights: Path, tmp_path: Path) -> None:
    ran = invoke("run", TEST_ONLY, "--cache", tmp_path / "cache", "--upto", "disparity")
    assert ran.code == 0, ran.err
    assert (
        ran.out.splitlines()[-1]
        == "reused 0 products, made 1 images, 1 channels, 1 matching_net, 1 costvolume, 1 disparity"
    )


def test_a_file_that_ends_too_early_is_a_fault_and_no_wish_to_stop(
    invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise EOFError("Compressed file ended before the end-of-stream marker was reached")

    monkeypatch.setattr("semidense.pipeline.api.open_store", fail)
    with pytest.raises(RuntimeError, match="ended too early") as error:
        invoke("status", TEST_ONLY)
    assert "Compressed file" in str(error.value.__cause__)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["macth"], "pipeline: No such command 'macth'"),
        (["run", "--prest", "robust"], "pipeline: No such option: --prest"),
        (["match", "a.png", "b.png", "--R", "90%"], "pipeline: Invalid value for '--R'"),
        (["run", "--cache", "memory://x"], "pipeline: Invalid value for '--cache': memory://x ends with the command"),
        (["score", "a.png"], "pipeline: Missing argument 'disparity'; see `pipeline score --help`"),
        (["run", "motorcycle", "more"], "pipeline: Got unexpected extra argument(s) (more); see `pipeline run --help`"),
    ],
)
def test_a_word_that_no_command_knows_is_one_line(invoke: Invoke, arguments: list[str], told: str) -> None:
    ran = invoke(*arguments)
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert ran.err.startswith(told)


@pytest.mark.parametrize("command", [["run"], ["sweep"], ["compare"], ["submit", "eth3d", "--partial"]])
def test_a_place_that_cannot_be_written_is_told_before_anything_is_made(
    invoke: Invoke, tmp_path: Path, command: list[str]
) -> None:
    (tmp_path / "file").touch()
    ran = invoke(*command, TEST_ONLY, "-o", tmp_path / "file" / "out", "--cache", tmp_path / "cache")
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert f"{tmp_path / 'file'} is a file" in ran.err
    assert not (tmp_path / "cache").exists()


def test_no_command_shows_what_there_is(invoke: Invoke) -> None:
    ran = invoke()
    assert "Usage: pipeline" in ran.out + ran.err


@pytest.mark.parametrize("url", ["http://example.org/x", "ftp://a/b"])
def test_a_url_that_is_no_cache_is_told_as_it_was_typed(
    invoke: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, url: str
) -> None:
    for ran in (
        invoke("cache", "ls", "--cache", url),
        (monkeypatch.setenv("PIPELINE_CACHE", url), invoke("cache", "ls"))[1],
    ):
        assert ran.code == 2
        assert f"{url} is no place for a cache: name a folder, or an object store as s3://" in ran.err


def test_a_report_that_lacks_products_says_so(invoke: Invoke, tmp_path: Path) -> None:
    there = [TEST_ONLY, "--preset", "robust", "--cache", tmp_path / "cache"]
    invoke("run", *there, "--upto", "channels")
    ran = invoke("report", *there, "-o", tmp_path / "r.html")
    assert ran.code == 0 and "products are not cached, and the page lacks them; make them with `pipeline run" in ran.err
