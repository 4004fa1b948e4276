"""A publisher on loopback, which serves files as one does and misbehaves when told to."""

import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest


@dataclass
class Publisher:
    """What the server serves, and how.

    Attributes:
        files: content by path.
        address: of the server.
        cuts: bytes after which the connection of the next answers ends.
        moved: paths that lead to another address.
        ranges: whether parts of a file are served.
        tags: version of each file; the length of its content by default.
        asked: what was asked for: path and ``Range``.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    address: str = ""
    cuts: list[int] = field(default_factory=list)
    moved: dict[str, str] = field(default_factory=dict)
    ranges: bool = True
    tags: dict[str, str] = field(default_factory=dict)
    asked: list[tuple[str, str]] = field(default_factory=list)

    def tag(self, path: str) -> str:
        return self.tags.get(path, f'"{len(self.files[path])}"')


class Handler(BaseHTTPRequestHandler):
    """Answers requests of one `Publisher`."""

    publisher: Publisher
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        path, wanted = self.path.lstrip("/"), self.headers.get("Range", "")
        self.publisher.asked.append((path, wanted))
        if path in self.publisher.moved:
            self._head(302, {"Location": self.publisher.moved[path], "Content-Length": "0"})
        elif path not in self.publisher.files:
            self._head(404, {"Content-Length": "0"})
        else:
            self._serve(path, wanted)

    def _serve(self, path: str, wanted: str) -> None:
        content, start = self.publisher.files[path], 0
        headers = {"ETag": self.publisher.tag(path)} if self.publisher.ranges else {}
        part = re.fullmatch(r"bytes=(\d+)-", wanted)
        if part and self.headers.get("If-Range") == self.publisher.tag(path):
            start = int(part[1])
            headers["Content-Range"] = f"bytes {start}-{len(content) - 1}/{len(content)}"
        self._head(206 if start else 200, {**headers, "Content-Length": str(len(content) - start)})
        most = self.publisher.cuts.pop(0) if self.publisher.cuts else len(content)
        self.wfile.write(content[start : start + most])
        self.close_connection = start + most < len(content)

    def _head(self, code: int, headers: dict[str, str]) -> None:
        self.send_response(code)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        """Print nothing."""


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    """A server on loopback that serves the files that a test puts into it."""
    made = Publisher()
    server = ThreadingHTTPServer(("127.0.0.1", 0), type("Mine", (Handler,), {"publisher": made}))
    made.address = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    yield made
    server.shutdown()
    server.server_close()
