import json
from dataclasses import replace
from typing import Any

import pytest

from semidense.cache import ABSENT, Change
from semidense.pipeline.cli import console
from semidense.pipeline.plan.causes import PENDING
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.results.estimate import Estimate
from tests.pipeline.toy import RAMP, SUM, step

KEY = "ab" * 32
STEP = step(RAMP, 0)
HIT = Planned(STEP, "hit", KEY, "cd" * 32, seconds=1.5)
STALE = Planned(STEP, "stale", KEY, changed=(Change("params.window", 31, 15),))
MISSING = Planned(step(SUM), "missing")
ROW = {
    "scene": "A",
    "method": "dual-cnn",
    "mask": "nonocc",
    "threshold_px": 1.0,
    "R": 0.9,
    "pixels": 100,
    "raw_bad": 20.0,
}


def test_a_row_of_a_plan_has_the_promised_keys() -> None:
    (row,) = console.step_rows(Plan((STALE,), ()), {})
    assert list(row) == ["product", "scene", "key", "state", "changed", "why", "seconds"]
    assert row["changed"] == [{"field": "params.window", "old": 31, "new": 15}]
    assert (row["state"], row["seconds"]) == ("stale", None)


def test_a_damaged_entry_s_row_says_so() -> None:
    (row,) = console.step_rows(Plan((replace(STALE, damage="a byte flipped"),), ()), {})
    assert row["damage"] == "a byte flipped"


@pytest.mark.parametrize(("reused", "state"), [(True, "hit"), (False, "made")])
def test_after_a_run_the_state_is_what_happened(reused: bool, state: str) -> None:
    made = Made(MISSING.step, KEY, "ef" * 32, 2.0, reused)
    (row,) = console.step_rows(Plan((MISSING,), ()), {MISSING.step.id: made})
    assert (row["state"], row["key"], row["seconds"]) == (state, KEY, 2.0)


@pytest.mark.parametrize(
    ("planned", "text"),
    [
        pytest.param(HIT, "", id="a hit needs no reason"),
        pytest.param(STALE, "params.window: 31 -> 15", id="old and new"),
        pytest.param(MISSING, "never made; its inputs are not there yet", id="below what is missing"),
        pytest.param(replace(MISSING, key=KEY), "never made", id="missing"),
        pytest.param(replace(STALE, damage="a file is gone"), "damaged: a file is gone", id="damaged"),
        pytest.param(
            replace(STALE, changed=(Change("inputs.a", ABSENT, PENDING), Change("inputs.b", ABSENT, PENDING))),
            "made after a, b",
            id="below what is made again",
        ),
        pytest.param(
            replace(STALE, changed=(*STALE.changed, Change("inputs.a", ABSENT, PENDING))),
            "params.window: 31 -> 15; made after a",
            id="both",
        ),
        pytest.param(
            replace(STALE, changed=tuple(Change(f"params.{n}", n, n + 1) for n in range(5))),
            "params.0: 0 -> 1; params.1: 1 -> 2; params.2: 2 -> 3; and 2 more",
            id="many",
        ),
    ],
)
def test_why_a_step_is_not_a_hit(planned: Planned, text: str) -> None:
    assert console.why(planned) == text


def test_a_plan_is_a_line_a_step_and_a_sum(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_plan(Plan((HIT, STALE, MISSING), (), ("one", "two")), Estimate(170))
    out, err = capsys.readouterr()
    lines = [line.split() for line in out.splitlines()]
    assert lines[0] == ["product", "scene", "state", "key", "why"]
    assert lines[1] == ["ramp", "Toy", "hit", KEY[:12]]
    assert lines[2] == ["ramp", "Toy", "stale", KEY[:12], "params.window:", "31", "->", "15"]
    assert lines[3][:3] == ["sum", "Toy", "missing"]
    assert out.splitlines()[-2:] == ["reuses 1 product, makes 1 ramp, 1 sum", "time: about 3 min"]
    assert err.splitlines() == ["note: one", "note: two"]


def test_where_all_is_there_nothing_is_made(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_plan(Plan((HIT,), ()), Estimate(170))
    assert capsys.readouterr().out.splitlines()[-1] == "reuses 1 product, makes nothing"


def test_names_are_text_not_markup(capsys: pytest.CaptureFixture[str]) -> None:
    odd = replace(STEP, scene="[red]x[/y]")
    console.print_plan(Plan((replace(HIT, step=odd),), (), ("[/z] left out",)), Estimate(170))
    console.print_metrics([ROW | {"scene": "[red]x[/y]"}], {})
    out, err = capsys.readouterr()
    assert out.count("[red]x[/y]") == 2
    assert err == "note: [/z] left out\n"


def test_many_notes_are_cut_short(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_notes([str(number) for number in range(8)])
    assert capsys.readouterr().err.splitlines()[-1] == "note: and 3 more like these"


def test_json_is_one_line_whatever_its_length(capsys: pytest.CaptureFixture[str]) -> None:
    value = {"steps": ["[bold]" + "x" * 500] * 20}
    console.print_json(value)
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert json.loads(out) == value


def test_json_never_holds_what_json_has_not() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        console.print_json({"x": float("nan")})


def test_a_run_s_work_is_one_line() -> None:
    made = [Made(STEP, KEY, KEY, 1.0, reused) for reused in (True, True, False)]
    assert console.reuse_line(made) == "reused 2 products, made 1 ramp"
    assert console.reuse_line(made[:2]) == "reused 2 products, made nothing"


def table(rows: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    console.print_metrics(rows, {"A": "exact", "B": "left-right check"})
    return [line.split() for line in capsys.readouterr().out.splitlines()]


def test_metrics_are_a_row_a_threshold_with_dashes_for_what_does_not_apply(capsys: pytest.CaptureFixture[str]) -> None:
    lines = table([ROW | {"auc": 0.12345, "bad": 1.25, "avgerr": 0.126}], capsys)
    assert lines[1] == ["A", "1", "0.9", "20.00", "1.25", "-", "0.13", "-", "0.1235", "-", "100"]
    assert "mask: nonocc (exact, left-right check)" in " ".join(lines[2])
    assert len(lines) in (3, 4)


def test_other_masks_are_left_to_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert table([ROW | {"mask": "all"}], capsys) == []


def test_a_threshold_has_a_column_where_a_row_has_one(capsys: pytest.CaptureFixture[str]) -> None:
    by_density = {name: value for name, value in ROW.items() if name != "R"}
    heads, cells = table([by_density], capsys)[:2]
    assert "R" not in heads
    assert cells[:3] == ["A", "1", "20.00"]
    assert [cells[2] for cells in table([ROW, by_density | {"scene": "B"}], capsys)[1:3]] == ["0.9", "-"]


def test_a_sweep_shows_means_and_a_dash_for_what_a_scene_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [ROW | {"scene": scene, "R": R, "bad": 4.0} for scene in "AB" for R in (0.5, 0.9)]
    del rows[-1]["bad"]
    console.print_sweep(rows, {})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:7] for line in lines[1:3]] == [
        ["mean", "of", "2", "1", "0.5", "20.00", "4.00"],
        ["mean", "of", "2", "1", "0.9", "20.00", "-"],
    ]


def test_a_cause_is_told_once_and_then_by_the_product_that_told_it() -> None:
    first = Planned(STEP, "stale", causes=("ramp.window: 31 -> 15",))
    below = Planned(step(SUM), "stale", causes=("ramp.window: 31 -> 15", "total.own: 1 -> 2"))
    tellers: dict[str, str] = {}
    assert console.why(first, tellers) == "ramp.window: 31 -> 15"
    assert console.why(first, tellers) == "ramp.window: 31 -> 15", "of another scene"
    assert console.why(below, tellers) == f"total.own: 1 -> 2; because of {STEP.product}"
    assert console.why(below) == "ramp.window: 31 -> 15; total.own: 1 -> 2"
