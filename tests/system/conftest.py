"""A real browser for pages: Chromium from the system, driven by playwright."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import PROJECT

SCREENS = PROJECT / "build" / "screens"
"""Where pictures of the pages are kept for looking."""
WIDE, NARROW = (1280, 800), (390, 800)
_NAMES = ("chromium", "chromium-browser", "google-chrome")


@dataclass
class Seen:
    """A page in the browser, and what was said while it ran."""

    page: Any
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def keep(self, name: str) -> None:
        """Keep a picture of the whole page."""
        SCREENS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SCREENS / f"{name}.png", full_page=True)

    def fits(self) -> bool:
        """Return whether the page is no wider than the screen."""
        return bool(self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"))


@contextmanager
def chromium() -> Iterator[Any]:
    """Run headless Chromium; tests skip where there is none."""
    driver = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install -e .[dev]")
    program = next((path for path in map(shutil.which, _NAMES) if path), None)
    if program is None:
        pytest.skip("there is no Chromium on this machine: apt-get install chromium")
    with driver.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless Chromium, for all tests."""
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def look(browser: Any) -> Iterator[Callable[..., Seen]]:  # noqa: ANN401
    """Open an address in a window of its own."""
    pages = []

    def visit(address: str, size: tuple[int, int] = WIDE, scheme: str = "light") -> Seen:
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
        page.set_default_timeout(120_000)
        pages.append(page)
        seen = Seen(page)
        page.on("console", lambda message: seen.said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: seen.said.append(str(error)))
        page.on("request", lambda request: seen.asked.append(request.url))
        page.goto(address, timeout=120_000)
        return seen

    yield visit
    for page in pages:
        page.close()


@contextmanager
def serving(cache: Path) -> Iterator[tuple[str, int]]:
    """Run ``pipeline view`` over a cache; give its address and process."""
    code = "from semidense.pipeline.cli.main import command; command()"
    command = [sys.executable, "-c", code, "view", "--cache", str(cache), "--port", "0", "--no-show"]
    process = subprocess.Popen(command, cwd=PROJECT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found, "the viewer did not say where it is"
        yield found[0], process.pid
    finally:
        process.terminate()
        process.wait(timeout=30)
