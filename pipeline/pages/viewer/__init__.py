"""The viewer: a local web page over a cache."""

from importlib.util import find_spec
from pathlib import Path

from semidense.pipeline.api import open_store
from semidense.pipeline.plan.errors import UsageError

INSTALL = "the viewer needs Bokeh: pip install 'semidense-stereo[view]'"


def view(cache: Path | str | None = None, *, port: int = 5006, show: bool = True) -> None:
    """Serve the viewer over a cache on this machine alone, until it is interrupted.

    Args:
        cache: its folder; by default as for every command.
        port: of ``localhost``; 0 for any that is free.
        show: open the page in the browser.

    Raises:
        UsageError: if Bokeh is not installed, the cache is not there, or the port is taken.
    """
    if find_spec("bokeh") is None:
        raise UsageError(INSTALL)
    store = open_store(cache)
    if not store.exists():
        raise UsageError(
            f"{store.root}: no cache is there; make one with `pipeline match` or `run`, or name another: --cache"
        )
    from semidense.pipeline.pages.viewer.server import serve

    serve(store, port, show)
