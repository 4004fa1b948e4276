"""The report in a real browser: light, dark, narrow, printed, and without a mouse."""

import io
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.pipeline.api import Task, run, sweep
from semidense.pipeline.pages.report import report
from tests.system.conftest import NARROW, SCREENS, WIDE, Seen

MM = 96 / 25.4
"""Pixels of a browser in a millimetre. An A4 page has 182 x 269 mm inside the report's margins."""


@pytest.fixture(scope="module")
def address(trained_task: Task, tmp_path_factory: pytest.TempPathFactory) -> str:
    return report(trained_task, tmp_path_factory.mktemp("page") / "report.html").as_uri()


@pytest.mark.parametrize(
    ("size", "scheme", "name"),
    [(WIDE, "light", "wide"), (WIDE, "dark", "dark"), (NARROW, "light", "narrow")],
    ids=["light", "dark", "narrow"],
)
def test_it_is_whole_and_fits(
    look: Callable[..., Seen], address: str, size: tuple[int, int], scheme: str, name: str
) -> None:
    seen = look(address, size, scheme)
    seen.keep(f"report-{name}")
    assert seen.said == []
    assert [url for url in seen.asked if not url.startswith(("file:", "data:"))] == []
    assert seen.fits()
    loaded = seen.page.evaluate("[...document.images].map((image) => image.complete && image.naturalWidth > 0)")
    assert loaded
    assert all(loaded)
    body = "(({color, backgroundColor}) => [color, backgroundColor])(getComputedStyle(document.body))"
    ink, paper = seen.page.evaluate(body)
    assert brightness(ink) < brightness(paper) if scheme == "light" else brightness(ink) > brightness(paper)


def brightness(colour: str) -> float:
    """Return the mean of the numbers of ``rgb(r, g, b)``."""
    return float(np.mean([int(part) for part in colour.removeprefix("rgb(").rstrip(")").split(",")]))


PLACES = "[...document.querySelectorAll('.frame')].map((frame) => [frame.scrollLeft, frame.scrollTop])"


def wait_until(seen: Seen, condition: str, seconds: float = 10) -> None:
    """Ask again and again from outside: the page's policy forbids the page to evaluate text, as waiting inside does."""
    end = time.monotonic() + seconds
    while not seen.page.evaluate(condition):
        assert time.monotonic() < end, f"{condition}; the pictures are at {seen.page.evaluate(PLACES)}"
        seen.page.wait_for_timeout(20)


def test_the_keyboard_zooms_and_moves_all_pictures(look: Callable[..., Seen], address: str) -> None:
    seen = look(address)
    page: Any = seen.page
    page.locator(".zoom input").first.focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    assert page.locator(".zoom output").first.text_content() == "3x"
    before = page.evaluate("document.querySelectorAll('.frame')[1].scrollLeft")
    page.locator(".frame").first.focus()
    page.keyboard.press("ArrowRight")
    wait_until(seen, f"document.querySelectorAll('.frame')[1].scrollLeft > {before}")
    places = "[...document.querySelectorAll('.frame')].map((frame) => Math.round(frame.scrollLeft))"
    wait_until(seen, f"new Set({places}).size === 1")


def test_a_picture_moved_right_after_another_leads_all(look: Callable[..., Seen], address: str) -> None:
    seen = look(address)
    page: Any = seen.page
    page.locator(".zoom input").first.focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    two = "const [first, second] = document.querySelectorAll('.scene .frame');"
    apart = "first.scrollLeft !== second.scrollLeft"
    follows = f"for (let n = 0; n < 120 && {apart}; n++) await new Promise(requestAnimationFrame);"
    back = "const place = first.scrollLeft; first.scrollTo(30, 0); return place;"
    moved = f"async () => {{ {two} second.scrollTo(60, 0); {follows} {back} }}"
    assert page.evaluate(moved) == pytest.approx(60, abs=1)
    places = "[...document.querySelector('.scene').querySelectorAll('.frame')].map((frame) => frame.scrollLeft)"
    wait_until(seen, f"{places}.every((place) => Math.abs(place - 30) < 1)")


def test_a_scene_is_printed_on_three_pages_without_controls(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address).page
    SCREENS.mkdir(parents=True, exist_ok=True)
    printed = page.pdf(path=SCREENS / "report.pdf", format="A4")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) <= 3
    page.emulate_media(media="print")
    for hidden in (".zoom", "nav", "#how-it-was-made", "summary"):
        assert not page.locator(hidden).first.is_visible()
    assert page.locator(".gallery").first.is_visible()
    assert page.evaluate("getComputedStyle(document.querySelector('.scroll')).breakInside") == "avoid", "with caption"


@pytest.mark.parametrize("ratio", ["3 / 1", "6 / 5", "2 / 3"], ids=["street", "box", "tall"])
def test_a_scene_fits_below_the_headline_figures_on_paper(look: Callable[..., Seen], address: str, ratio: str) -> None:
    page: Any = look(address, (round(182 * MM), round(269 * MM))).page
    page.emulate_media(media="print")
    page.evaluate(
        f"for (const each of document.querySelectorAll('.frame')) each.style.setProperty('--ratio', '{ratio}')"
    )
    assert page.evaluate("document.querySelector('.scene').getBoundingClientRect().bottom") <= 269 * MM
    shapes = page.evaluate(
        "[...document.querySelectorAll('.frame')].map((each) => each.offsetWidth / each.offsetHeight)"
    )
    width, height = map(int, ratio.split(" / "))
    assert shapes == pytest.approx([width / height] * len(shapes), rel=0.03), "no picture is cut"


def test_results_come_before_what_made_them(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address).page
    top = "(place) => document.querySelector(place).getBoundingClientRect().top"
    tops = [page.evaluate(top, place) for place in (".cards", ".gallery", "table", ".chart", "#how-it-was-made")]
    assert tops == sorted(tops)
    assert tops[1] < WIDE[1], "the first picture is on the first screen"


def test_every_share_names_its_mask_and_all_agree(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address).page
    cards = page.locator(".card").all_inner_texts()
    assert len(cards) >= 3, "the error of what is kept is told where something is"
    assert all("nonocc" in card for card in cards)
    kept = next(card.split("\n")[0] for card in cards if "kept at R" in card)
    captions = page.locator("figure:last-child .legend").first.inner_text()
    assert f"kept: {kept} of the nonocc pixels" in captions


def test_charts_fit_a_narrow_screen(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address, NARROW).page
    ends = "[...document.querySelectorAll('.chart svg')].map((chart) => chart.getBoundingClientRect().right)"
    assert max(each for each in page.evaluate(ends)) <= NARROW[0]


def test_a_table_that_goes_on_shows_an_edge(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address, NARROW).page
    tables = {
        each.evaluate("(box) => box.scrollWidth > box.clientWidth + 1"): each
        for each in page.locator(".scroll").all()
        if each.is_visible()
    }
    picture = np.asarray(Image.open(io.BytesIO(tables[True].screenshot())).convert("L"))
    assert picture[picture.shape[0] // 2, -2] < 128, "a line where columns are hidden"
    if False in tables:
        whole = np.asarray(Image.open(io.BytesIO(tables[False].screenshot())).convert("L"))
        assert (whole[:, -1] > 230).all()


def test_the_curve_is_the_sweep_s(look: Callable[..., Seen], address: str, own_task: Task) -> None:
    rows = [row for row in sweep(own_task, "0.3,0.5").metrics if row["mask"] == "nonocc" and row["threshold_px"] == 1]
    page: Any = look(address).page
    cells = "[...row.cells].map((cell) => cell.textContent).join(' ')"
    told = page.evaluate(f"[...document.querySelectorAll('details tr')].map((row) => {cells})")
    for row in rows:
        if "bad" in row:  # else nothing is kept, and the curve has no point
            assert f"{row['R']:g} {row['invalid']:.2f} {row['bad']:.2f}" in told


def test_a_density_is_told_instead_of_a_threshold(look: Callable[..., Seen], own_task: Task, tmp_path: Path) -> None:
    task = replace(own_task, settings=[*own_task.settings, "semidense.density=0.4"])
    made = run(task)
    page: Any = look(report(task, tmp_path / "density.html").as_uri()).page
    (row,) = [row for row in made.metrics if row["mask"] == "nonocc" and row["threshold_px"] == 1]
    share = f"{100 - row['invalid']:.1f} %"
    told = page.locator(".card").all_inner_texts()
    assert f"{share}\nof the nonocc pixels kept at a density of 40 %" in told
    assert not any("R =" in each for each in told)
    assert page.locator("caption").first.inner_text().endswith("kept at a density of 40 %")
    last = page.locator(".gallery figure").last
    assert last.locator("figcaption").inner_text() == "kept at a density of 40 %"
    assert f"kept: {share} of the nonocc pixels" in last.inner_text()


def test_a_legend_names_only_colours_that_the_picture_has(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address).page
    legends = {
        figure.locator("figcaption").inner_text(): figure.locator(".legend").inner_text()
        for figure in page.locator(".gallery figure").all()
    }
    for title in ("raw disparity, before filtering", "confidence", "error of the raw disparity"):
        assert not any(word in legends[title] for word in ("none", "no disparity")), "every pixel has a disparity"
    assert "not kept" in legends["kept at R = 0.5"]


def test_notes_are_printed_no_larger_than_tables(look: Callable[..., Seen], address: str) -> None:
    page: Any = look(address).page
    page.emulate_media(media="print")
    sizes = "[...document.querySelectorAll('caption, .quiet, td')].filter((each) => each.offsetParent)"
    points = page.evaluate(f"{sizes}.map((each) => parseFloat(getComputedStyle(each).fontSize))")
    assert max(points) == pytest.approx(8 * 96 / 72, abs=0.1), "8 pt, in px of the screen"
