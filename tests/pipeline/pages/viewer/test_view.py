import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.cache import Store
from semidense.pipeline.pages import viewer
from semidense.pipeline.plan.errors import UsageError

Invoke = Callable[..., Any]


def test_without_bokeh_one_line_says_what_to_install(
    invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(viewer, "find_spec", lambda _: None)
    ran = invoke("view", "--cache", tmp_path)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == "pipeline: the viewer needs Bokeh: pip install 'semidense-stereo[view]'\n"


def test_a_cache_that_is_not_there_is_one_line(invoke: Invoke, tmp_path: Path) -> None:
    ran = invoke("view", "--cache", tmp_path / "none")
    assert (ran.code, ran.err.count("\n")) == (2, 1)
    assert not (tmp_path / "none").exists()


def test_it_is_served_to_this_machine_alone(tmp_path: Path) -> None:
    pytest.importorskip("bokeh", reason="Bokeh is not installed: pip install -e .[dev]")
    from semidense.pipeline.pages.viewer.server import start

    server = start(Store(tmp_path), 0)
    try:
        sockets = server._http._sockets.values()
        assert {each.getsockname()[0] for each in sockets} == {"127.0.0.1"}
    finally:
        server.stop()


def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("bokeh", reason="Bokeh is not installed: pip install -e .[dev]")
    from semidense.pipeline.pages.viewer.server import start

    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(UsageError, match="choose another by --port"):
        start(Store(tmp_path), taken.getsockname()[1])


def test_it_answers_to_its_own_name_alone(tmp_path: Path) -> None:
    """A page elsewhere can have a name of its own point at this machine."""
    import asyncio
    import threading

    from semidense.pipeline.pages.viewer.server import start

    found: dict[str, int] = {}

    async def ask() -> None:
        from tornado.httpclient import AsyncHTTPClient

        server = start(Store(tmp_path / "cache"), 0)
        try:
            for name in ("localhost", "127.0.0.1", "evil.example", "localhost.evil.example"):
                address = f"http://127.0.0.1:{server.port}/"
                headers = {"Host": f"{name}:{server.port}"}
                answer = await AsyncHTTPClient().fetch(address, headers=headers, raise_error=False)
                found[name] = answer.code
        finally:
            server.stop()

    thread = threading.Thread(target=lambda: asyncio.run(ask()))
    thread.start()
    thread.join(60)
    assert found == {"localhost": 200, "127.0.0.1": 200, "evil.example": 403, "localhost.evil.example": 403}
