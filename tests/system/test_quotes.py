"""Figures that the documents quote are those of their source, where the source is a file of the repository."""

import json
import re
import tomllib
from collections.abc import Iterator
from statistics import mean

import pytest
from safetensors.numpy import load_file

from semidense.stages.evaluation.calibration.table import Table, outcome
from tests.system.test_links import ROOT

WEIGHTS = ROOT / "stages" / "weights"
CALIBRATION = "general/calibration.evidence_confidence.aggregated.fast.safetensors"


def text(name: str) -> str:
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def rows(name: str) -> Iterator[list[str]]:
    """Yield the cells of each row of a page's tables, without marks of emphasis."""
    for line in (ROOT / name).read_text(encoding="utf-8").splitlines():
        if line.startswith("|"):
            yield [cell.strip().strip("*") for cell in line.strip("|").split("|")]


def numbers(cells: list[str]) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.\d+", " ".join(cells))]


@pytest.mark.parametrize(("ending", "said"), [("", "training scenes"), (".3px", "the same, within 3 px")])
def test_a_wanted_error_came_to_what_the_calibration_says(ending: str, said: str) -> None:
    made = load_file(WEIGHTS / CALIBRATION.replace(".safetensors", f"{ending}.safetensors"))
    found = [outcome(Table.of(made), made["log_odds"], wish, made["tolerance"]) for wish in (0.01, 0.02, 0.05)]
    row = next(row for row in rows("docs/comparison.md") if row[0].startswith(said))
    assert row[1:4] == [f"{100 * each.error:.1f} of {100 * each.kept:.0f}" for each in found]


def test_the_calibration_is_of_as_many_scenes_as_the_model_card_says() -> None:
    scenes = re.search(r"cross-fitted maps of (\d+) Middlebury and (\d+) KITTI", text("stages/weights/README.md"))
    assert scenes
    assert sum(map(int, scenes.groups())) == len(load_file(WEIGHTS / CALIBRATION)["right"])


@pytest.mark.parametrize("folder", ["", "general/"])
def test_the_evidence_net_weighs_as_many_numbers_as_the_page_says(folder: str) -> None:
    units, weighed = load_file(WEIGHTS / f"{folder}evidence_net.safetensors")["first.weight"].shape[:2]
    assert f"A net with {units} units weighs {weighed} numbers a pixel" in text("docs/choices.md")


def test_the_mean_of_the_scenes_is_their_mean() -> None:
    table = [row for row in rows("docs/accuracy.md") if len(row) == 6]
    scenes = [numbers(row[1:]) for row in table[2 : table.index(next(row for row in table if row[0] == "mean"))]]
    means = numbers(next(row for row in table if row[0] == "mean")[1:])
    assert len(scenes) == 8
    for found, quoted in zip(map(mean, zip(*scenes, strict=True)), means, strict=True):
        assert found == pytest.approx(quoted, abs=0.1 if quoted > 1 else 0.0001)  # all are rounded


def test_the_readme_quotes_the_accuracy_of_each_preset() -> None:
    def figures(name: str) -> dict[str, list[float]]:
        found = {row[0].split(" (")[0]: row for row in rows(name) if row[0].startswith("`--preset")}
        return {options: sorted(numbers(row[1:6])) for options, row in found.items()}

    assert len(figures("README.md")) == 5
    assert figures("README.md") == figures("docs/accuracy.md")


def test_a_page_that_quotes_another_quotes_its_figures() -> None:
    """Of `robust` on MiddEval3 and KITTI 2015: its wrong pixels, the order of them, and what a wish gave."""
    raw, auc, optimal, _, kept = next(row for row in rows("docs/accuracy.md") if row[0] == "mean")[1:]
    found = {row[0]: row[1:] for row in reversed(list(rows("docs/comparison.md")))}  # the first row of a name
    assert found["mean of the eight"][0] == found["MiddEval3, 8 scenes"][1] == found["MiddEval3, > 1 px"][0] == raw
    assert found["ours, R = 0.9"][0] == found["MiddEval3, 8 scenes"][5] == kept
    assert f"a perfect order has {optimal}" in text("docs/comparison.md") and auc in found
    wishes = [cell.partition(" of ")[0] for cell in found["MiddEval3, within 1 px"][:3]]
    assert "{}, {} and {} % are wrong where 1, 2 and 5 %".format(*wishes) in text("docs/own-pictures.md")
    streets = next(row for row in rows("docs/comparison.md") if row[0] == "KITTI 2015" and " of " in row[2])
    assert f"The preset `robust` has {streets[2].split()[0].strip('*')} % there" in text("README.md")


def test_the_faults_that_a_page_tells_are_those_that_were_injected() -> None:
    row = next(row for row in json.loads((ROOT / "docs/faults.json").read_text())["rows"] if row["row"] == 29)
    killed, spoilt = row["figures"]["workers killed"], row["figures"]["requests spoilt"]
    assert f"In row 29, {killed} workers were killed and {spoilt:,} requests spoilt" in text("docs/clusters.md")


def test_the_version_is_the_same_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)[1] == version  # type: ignore[index]
    assert re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] == version  # type: ignore[index]
    assert f"to {'.'.join(version.split('.')[:2])}" in text("docs/versions.md"), "no upgrade note"
