from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from semidense.cache import Store
from semidense.stages.metrics.tally import FINE
from tests.handmade import Handmade, handmade, judge

pytest.importorskip("bokeh", reason="Bokeh is not installed: pip install -e .[dev]")

from bokeh.document import Document

from semidense.pipeline.pages.viewer.document import build
from semidense.pipeline.pages.viewer.session import NOTHING, Session


@pytest.fixture
def made(tmp_path: Path) -> Handmade:
    return handmade(tmp_path / "cache")


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Handmade:
    return handmade(tmp_path_factory.mktemp("shown") / "cache")


@pytest.fixture(scope="module")
def session(shown: Handmade) -> Session:
    """A page that the tests share: making one takes most of their time."""
    return build(Document(), shown.store)


def test_the_latest_configuration_is_shown(session: Session, shown: Handmade) -> None:
    np.testing.assert_array_equal(session.sources.base.data["disparity"][0], shown.arrays["disparity"]["disparity"])
    np.testing.assert_array_equal(session.sources.base.data["confidence"][0], shown.arrays["confidence"]["confidence"])
    assert all(panel.box.visible for panel in session.panels.maps.values())
    assert not session.panels.swiped.box.visible
    assert not session.panels.costs_box.visible


def test_the_products_made_from_it_are_listed(session: Session) -> None:
    assert "made from these: 1" in session.panels.products.text


def test_a_mask_and_a_threshold_change_the_figures(session: Session) -> None:
    before = list(session.sources.table.data["bad"])
    session.controls.threshold.value = "4"
    assert list(session.sources.table.data["bad"]) != before
    session.controls.mask.value = "all"
    assert session.sources.table.data["R"].size == len(FINE)


def test_a_tap_outside_the_image_does_nothing(session: Session) -> None:
    session._tap(SimpleNamespace(x=-3.0, y=5.0))
    assert session.controls.x.value is None


@pytest.mark.parametrize(("y", "x"), [(0, 0), (59, 89), (30, 2)], ids=["corner", "other corner", "few costs"])
def test_every_pixel_can_be_shown(session: Session, shown: Handmade, y: int, x: int) -> None:
    session._tap(SimpleNamespace(x=x + 0.3, y=y - 0.3))
    cost = shown.arrays["costvolume"]["cost"][y, x].astype(np.float32)
    np.testing.assert_array_equal(session.sources.curve.data["cost"], cost)
    assert session.panels.pixel.text.startswith(f"<p>y = {y}, x = {x}; raw disparity")
    assert len(session.sources.patches.data["patch"]) in (6, 9)
    assert session.sources.seen.data["disparity"][0].shape == (101, 101)


def test_what_is_not_cached_is_left_out(made: Handmade) -> None:
    made.write("images", {"other": 1}, (), left=np.ones((60, 90, 3), np.uint8))
    made.write("channels", {"use": ["gray"]}, ("images",), channels=np.zeros((2, 1, 60, 90), np.float32))
    made.write("costvolume", {}, ("channels",), cost=np.zeros((60, 90, 2), np.float16), d=np.arange(2, dtype=np.int16))
    made.write("disparity", {}, ("costvolume",), disparity=np.full((60, 90), np.nan, np.float32))
    session = build(Document(), made.store)
    names = session.controls.scene.options
    session.controls.scene.value = next(name for name in names if "no confidence" in _first(session, name))
    assert [name for name, panel in session.panels.maps.items() if panel.box.visible] == ["left", "raw"]
    assert not session.controls.R.visible
    assert not session.controls.mask.visible, "without a truth it would do nothing"
    assert "error" not in session.controls.show.labels
    session._tap(SimpleNamespace(x=4.0, y=4.0))
    assert "no raw disparity" in session.panels.pixel.text


def _first(session: Session, scene: str) -> str:
    return next(each.configurations[0].name for each in session.scenes if each.name == scene)


def test_a_second_configuration_is_offered_and_shown(made: Handmade) -> None:
    judge(made, np.full((60, 90), 0.25, np.float32), 1)
    session = build(Document(), made.store)
    first, second = session.controls.configuration.options
    assert session.controls.compare.options == [NOTHING, second], "a configuration beside itself tells nothing"
    assert session.controls.compare.value == NOTHING
    assert session.controls.compare.visible
    session.controls.compare.value = second
    assert session.panels.swiped.box.visible
    assert session.sources.other.data["confidence"][0].max() > 0.25
    session.controls.configuration.value = second
    assert session.sources.base.data["confidence"][0].max() > 0.25
    assert session.controls.compare.options == [NOTHING, first]
    assert not session.panels.swiped.box.visible


def test_a_single_configuration_has_nothing_to_be_compared_with(session: Session) -> None:
    assert not session.controls.compare.visible, "it would do nothing"


def test_an_entry_that_vanished_is_one_line(made: Handmade) -> None:
    session = build(Document(), made.store)
    made.store.layout.record(made.entries["disparity"].key).unlink()
    session.choose_configuration()
    assert "no entry has the key" in session.panels.problem.text
    assert session.panels.problem.visible


def test_an_empty_cache_says_what_to_do(tmp_path: Path) -> None:
    session = build(Document(), Store(tmp_path))
    assert "make something with `pipeline match` or `pipeline run`" in session.panels.problem.text


def test_provenance_is_told(session: Session, shown: Handmade) -> None:
    assert shown.entries["confidence"].key in session.panels.products.text
    assert "open_product" in session.panels.products.text


def test_names_from_a_cache_are_text(tmp_path: Path) -> None:
    made = handmade(tmp_path / "cache")
    made.scene = "<script>alert(1)</script>"
    made.write("disparity", {"evil": "<img src=x>"}, ("costvolume",), disparity=np.ones((60, 90), np.float32))
    session = build(Document(), made.store)
    session.controls.compare.value = session.controls.compare.options[-1]
    assert "<script" not in session.panels.products.text + session.panels.swiped.title.text
    assert "<img" not in session.panels.products.text
