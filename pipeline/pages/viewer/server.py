"""Bokeh's server with the one page, bound to this machine."""

import signal
import sys
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server
from tornado.httputil import HTTPServerRequest
from tornado.web import ErrorHandler

from semidense.cache import Store
from semidense.pipeline.pages.viewer.document import build
from semidense.pipeline.plan.errors import UsageError

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
"""What this machine is called in the addresses that are answered."""


def start(store: Store, port: int) -> Server:
    """Start serving and return the server; its loop is still to be run.

    Raises:
        UsageError: if the port is taken.
    """
    # A checksum goes with every chunk, so what is read is checked as it is read: a volume is never hashed as a whole.
    checked = Store(store.root, verify="size")

    def page(document: Document) -> None:
        build(document, checked)

    try:
        server = Server(
            {"/": Application(FunctionHandler(page))},
            address=HOST,
            port=port,
            allow_websocket_origin=[f"{name}:{port}" for name in NAMES] if port else None,
        )
    except OSError as error:
        raise UsageError(
            f"port {port}: {error.strerror or error}; choose another by --port, or any by --port 0"
        ) from None
    _answer_to_own_name_alone(server)
    server.start()
    return server


def _answer_to_own_name_alone(server: Server) -> None:
    """Refuse what is asked under another host name: a page elsewhere can have a name of its own point here."""
    application = server._tornado
    find = application.find_handler

    def checked(request: HTTPServerRequest, **options: Any) -> Any:  # noqa: ANN401 - tornado's own types
        if request.host_name in NAMES:
            return find(request, **options)
        return application.get_handler_delegate(request, ErrorHandler, {"status_code": 403})

    application.find_handler = checked


def serve(store: Store, port: int, show: bool) -> None:
    """Serve until SIGINT or SIGTERM: for a server that is the usual end."""
    server = start(store, port)
    address = f"http://localhost:{server.port}/"
    sys.stdout.write(f"viewer over {store.root}: {address} (Ctrl+C to stop)\n")
    sys.stdout.flush()
    if show:
        server.io_loop.add_callback(server.show, "/")
    for number in (signal.SIGINT, signal.SIGTERM):
        server.io_loop.asyncio_loop.add_signal_handler(number, server.io_loop.stop)
    server.io_loop.start()
    server.stop()
