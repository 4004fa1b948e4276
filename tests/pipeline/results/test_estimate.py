from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Recipe, Store
from semidense.pipeline.cli import console
from semidense.pipeline.plan.environment import cpu_name
from semidense.pipeline.plan.plan import Plan, Planned
from semidense.pipeline.plan.steps import Step
from semidense.pipeline.results import estimate as estimates
from semidense.pipeline.results.estimate import Estimate, Part, estimate, estimate_parts, in_all
from semidense.stages.stage import Output
from tests.pipeline.toy import BLURRED, SUM, step

SIZE = (10, 4)
"""Of the toy scene, 40 px."""
COSTS = replace(step(BLURRED), settings={"mode": "exact", "d_min": 0, "d_max": 9, "window": 11})
SCORE = replace(step(SUM, blurred=COSTS), size=SIZE)
SPLIT_STEP = replace(step(SUM), size=None, settings={"epochs": 5})
Remember = Callable[..., str]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "cache")


@pytest.fixture
def remember(store: Store) -> Remember:
    """Publish an entry that took some seconds; return its digest."""

    def publish(
        stage: str,
        seconds: float,
        size: tuple[int, int] | None = SIZE,
        cpu: str = "",
        inputs: Mapping[str, str] | None = None,
        **settings: object,
    ) -> str:
        recipe = Recipe(stage, {COSTS.stage.module: "1f" * 32}, settings, inputs or {}, {})
        with store.begin(recipe, {"product": stage, "scene": "Old"}) as draft:
            draft.create_array("values", (1,), "float64", (1,), ("one",), {})
            draft.write("values", (slice(None),), np.array([seconds]))
            extras = {"cpu": cpu or cpu_name(), **({"image_size": list(size)} if size else {})}
            return draft.publish(seconds, extras).digest

    return publish


def plan(*steps: Step) -> Plan:
    return Plan(tuple(Planned(each, "missing") for each in steps), ())


def test_time_grows_with_pixels_and_disparities(store: Store, remember: Remember) -> None:
    remember("blurred", 6.0, (5, 4), mode="exact", d_min=-1, d_max=3, window=11)
    assert estimate(plan(COSTS), store) == Estimate(6.0 * (40 / 20) * (10 / 5))


def test_what_is_made_from_costs_grows_with_their_disparities(store: Store, remember: Remember) -> None:
    costs = remember("blurred", 1.0, mode="exact", d_min=0, d_max=4, window=11)
    remember("sum", 3.0, inputs={"blurred": costs}, argument=None)
    assert estimate(plan(COSTS, SCORE), store) == Estimate(1.0 * 2 + 3.0 * 2)


def test_another_mode_says_nothing(store: Store, remember: Remember) -> None:
    remember("blurred", 6.0, mode="fast", d_min=0, d_max=9, window=11)
    assert estimate(plan(COSTS), store) == Estimate(0.0, ("blurred",))


def test_another_machine_says_nothing(store: Store, remember: Remember) -> None:
    remember("blurred", 6.0, cpu="a faster one", mode="exact", d_min=0, d_max=9, window=11)
    assert estimate(plan(COSTS), store) == Estimate(0.0, ("blurred",))


def test_an_entry_without_a_size_says_nothing(store: Store, remember: Remember) -> None:
    remember("blurred", 6.0, None, mode="exact", d_min=0, d_max=9, window=11)
    assert estimate(plan(COSTS), store).unknown == ("blurred",)


def test_the_nearest_is_looked_for_once_for_all_scenes(
    store: Store, remember: Remember, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seconds in (6.0, 8.0):
        remember("blurred", seconds, mode="exact", d_min=0, d_max=9, window=int(seconds))
    looked, real = [], estimates._alike
    monkeypatch.setattr(estimates, "_alike", lambda entry, step: looked.append(entry) or real(entry, step))
    scenes = [replace(COSTS, id=str(ends), settings={**COSTS.settings, "d_max": ends}) for ends in (9, 19, 29)]
    assert estimate(plan(*scenes), store).seconds == 8.0 * (1 + 2 + 3)
    assert len(looked) == 2


def test_the_nearest_settings_count_and_of_equals_the_newest(store: Store, remember: Remember) -> None:
    remember("blurred", 6.0, mode="exact", d_min=0, d_max=9, window=11)
    remember("blurred", 8.0, mode="exact", d_min=1, d_max=10, window=11)
    remember("blurred", 50.0, mode="exact", d_min=0, d_max=9, window=31)
    assert estimate(plan(COSTS), store).seconds == 8.0


def test_parts_by_hand(store: Store, remember: Remember, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two scenes of 10 x 4 px in tiles of 4 rows: 3 tiles each; a result took 6 s on the two threads here."""
    monkeypatch.setattr(estimates.os, "cpu_count", lambda: 2)
    remember("blurred", 6.0, mode="exact", d_min=0, d_max=9, window=11)
    tiled = replace(COSTS, stage=replace(COSTS.stage, tile_rows=4))
    (part,) = estimate_parts(plan(tiled, replace(tiled, id="other scene")), store)
    assert part == Part("blurred", 2, 6, part.bytes, 12.0, 24.0, 4.0)
    assert [part.seconds_on(workers) for workers in (1, 2, 4, 100)] == [24.0, 12.0, 6.0, 4.0]


def test_bytes_are_those_declared_or_those_of_results_like_it(store: Store, remember: Remember) -> None:
    flat = replace(
        COSTS.stage, outputs=(Output("costs", ("y", "x", "d"), "float16", "1", ""),), sizes=lambda _: {"d": 7}
    )
    known, unknown = replace(COSTS, stage=flat), replace(SPLIT_STEP, id="unknown")
    assert [part.bytes for part in estimate_parts(plan(known, unknown), store)] == [10 * 4 * 7 * 2, None]
    remember("sum", 100.0, None, epochs=5)
    (entry,) = store.entries()
    assert [part.bytes for part in estimate_parts(plan(unknown), store)] == [entry.size]


def test_a_part_without_a_measured_time_is_unknown_on_any_number_of_workers(store: Store) -> None:
    parts = estimate_parts(plan(COSTS), store)
    assert [part.seconds_on(8) for part in parts] == [None]
    assert in_all(parts, 8) == Estimate(0.0, ("blurred",))


@pytest.mark.parametrize(("epochs", "seconds"), [(5, 100.0), (50, None)])
def test_training_takes_as_long_as_with_equal_settings(
    store: Store, remember: Remember, epochs: int, seconds: float | None
) -> None:
    remember("sum", 100.0, None, epochs=epochs)
    assert estimate(plan(SPLIT_STEP), store).seconds == seconds


def test_what_is_cached_takes_no_time(store: Store) -> None:
    assert estimate(Plan((Planned(COSTS, "hit"),), ()), store) == Estimate()


@pytest.mark.parametrize(
    ("found", "text"),
    [
        pytest.param(Estimate(0.2), "less than 1 s", id="no time"),
        pytest.param(Estimate(170), "about 3 min", id="minutes"),
        pytest.param(Estimate(0, ("costvolume",)), "unknown: nothing like it was made here yet", id="unknown"),
        pytest.param(
            Estimate(30, ("costvolume", "disparity")),
            "about 30 s, and an unknown time for costvolume, disparity: nothing like it was made here yet",
            id="partly unknown",
        ),
    ],
)
def test_an_estimate_in_words(found: Estimate, text: str) -> None:
    assert str(found) == text


@pytest.mark.parametrize(("seconds", "told"), [(9.0, ""), (11.0, "time: about 11 s\n")])
def test_only_a_long_run_is_announced(
    store: Store, remember: Remember, seconds: float, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    remember("blurred", seconds, mode="exact", d_min=0, d_max=9, window=11)
    console.announce(plan(COSTS), store)
    assert capsys.readouterr() == ("", told)
