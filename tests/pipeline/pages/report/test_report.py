import base64
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import open_dataset
from semidense.pipeline.api import Task, open_store
from semidense.pipeline.pages.report import report
from semidense.pipeline.pages.report.page import _cards
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.result import Result
from semidense.stages.evaluation.filtering import SemidenseParams
from tests.tiny import SPEC, TEST_ONLY, TRAINED

Invoke = Callable[..., Any]
PARTS = ["What ran", "Networks", "Settings, versions and keys"]
"""What is closed at the end of a report."""


@pytest.fixture(scope="session")
def page(trained: Result, trained_task: Task, tmp_path_factory: pytest.TempPathFactory) -> str:
    return report(trained_task, tmp_path_factory.mktemp("report") / "report.html").read_text()


def headings(page: str) -> list[str]:
    return re.findall(r"<h2>(.*?)</h2>", page)


def test_it_has_every_part(page: str) -> None:
    assert headings(page) == [
        *("Pictures", "Figures", "Error against invalid pixels", "Confidence", "How it was made"),
    ]
    closed = [each for each in re.findall(r"<summary>(.*?)</summary>", page) if each in PARTS]
    assert closed == PARTS


def test_nothing_is_loaded_from_anywhere(page: str) -> None:
    addresses = re.findall(r'\b(?:src|href)="([^"]*)"', page)
    assert [each[:40] for each in addresses if not each.startswith(("data:", "#"))] == []
    assert "@import" not in page
    assert "default-src 'none'" in page


def test_the_figures_are_those_of_the_run(page: str, trained: Result) -> None:
    (row,) = [each for each in trained.metrics if each["mask"] == "nonocc" and each["threshold_px"] == 1]
    for name, digits in (("raw_bad", 2), ("invalid", 2), ("auc", 4)):
        assert f'<td class="number">{row[name]:.{digits}f}</td>' in page


@pytest.mark.parametrize(
    ("figures", "scenes", "told"),
    [
        pytest.param(1, 1, "", id="one scene"),
        pytest.param(3, 3, "Means of 3 scenes.", id="every scene"),
        pytest.param(2, 3, "Means of 2 of 3 scenes; the others have no figures in the cache.", id="not every scene"),
    ],
)
def test_the_first_figures_say_over_which_scenes_they_are_means(figures: int, scenes: int, told: str) -> None:
    rows = [
        {"scene": f"scene {place}", "mask": "nonocc", "threshold_px": 1.0, "pixels": 9, "raw_bad": 10.0 * place}
        for place in range(figures)
    ]
    cards = _cards(SimpleNamespace(rows=rows, scenes=range(scenes), filtering=SemidenseParams()))  # type: ignore[arg-type]
    assert re.findall(r'<p class="quiet">(.*?)</p>', cards) == [told] * bool(told)
    assert f"<b>{5 * (figures - 1):.1f} %</b>" in cards


def test_the_pictures_are_the_maps(page: str, trained: Result) -> None:
    sources = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    pictures = [np.asarray(Image.open(io.BytesIO(base64.b64decode(source)))) for source in sources]
    assert {picture.shape for picture in pictures} == {(64, 80)}
    kept = trained.open("semidense", "test-0")["disparity"].values
    np.testing.assert_array_equal(pictures[-1] == 0, np.isnan(kept))


def test_trained_networks_have_their_curves(page: str) -> None:
    assert "Training loss of matching_net over its steps" in page
    assert "Training loss of evaluation_net over its steps" in page


def test_training_scenes_are_not_reported_on(page: str) -> None:
    assert re.findall(r'data-scene="([^"]*)"', page) == ["test-0"]
    assert "train-0 and train-1 are training scenes" in page


def test_what_is_not_cached_is_left_out(trained_task: Task, own_cache: Path, tmp_path: Path) -> None:
    task = replace(trained_task, cache=own_cache, settings=[*trained_task.settings, "confidence.window=9"])
    page = report(task, tmp_path / "r.html").read_text()
    assert headings(page) == ["Pictures", "How it was made"]
    assert "raw disparity, before filtering" in page
    assert "kept at R" not in page


def test_shipped_weights_say_where_they_come_from(weights: Path, tmp_path: Path) -> None:
    from semidense.pipeline.api import run

    task = Task(TEST_ONLY, cache=tmp_path / "cache")
    run(task, upto="disparity")
    assert "the weights that come with the package" in report(task, tmp_path / "r.html").read_text()


def test_it_takes_what_a_run_takes(weights: Path, tmp_path: Path) -> None:
    from semidense.pipeline.api import run

    dataset, store = open_dataset(TEST_ONLY), open_store(tmp_path / "cache")
    run(dataset, upto="channels", cache=store)
    for given in (dataset, TEST_ONLY, Task(TEST_ONLY)):
        page = report(given, tmp_path / "r.html", cache=store, settings="semidense.R=0.5").read_text()
        assert f"<title>{TEST_ONLY}: report</title>" in page
        assert "--set semidense.R=0.5" in page
    with pytest.raises(UsageError, match=f"nothing of {TEST_ONLY} is cached in .*--cache {tmp_path}/none"):
        report(dataset, tmp_path / "r.html", cache=open_store(tmp_path / "none"))


def test_the_settings_are_told(trained_task: Task, tmp_path: Path) -> None:
    page = report(
        replace(trained_task, settings=[*trained_task.settings, "semidense.R=0.9"]), tmp_path / "r"
    ).read_text()
    assert "--preset paper" in page
    assert "--set semidense.R=0.9" in page


def test_nothing_cached_is_one_line_and_no_file(invoke: Invoke, tmp_path: Path) -> None:
    ran = invoke("report", SPEC, "--cache", tmp_path / "none", "-o", tmp_path / "r.html")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("\n") == 1
    assert "make it with `pipeline run" in ran.err
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_refused(trained_task: Task, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        report(trained_task, tmp_path / "none" / "r.html")


def test_the_command_says_what_it_wrote(invoke: Invoke, trained: Result, tmp_path: Path) -> None:
    ran = invoke("report", *TRAINED, "--cache", trained.store.root, "-o", tmp_path / "r.html")
    assert ran.code == 0, ran.err
    assert ran.out.startswith(f"wrote {tmp_path / 'r.html'} (")
