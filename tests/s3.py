"""A real S3 server on loopback, and a proxy before it that lets requests go wrong."""

import html
import os
import random
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from uuid import uuid4

SERVER = """
import sys, threading
from werkzeug.serving import run_simple
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, MotoRequestHandler, create_backend_app

class OneWriteAtATime:
    '''moto compares a condition and then writes, in two steps; S3 does both in one.'''
    def __init__(self, app):
        self.app, self.lock = app, threading.Lock()
    def __call__(self, environ, start_response):
        if environ["REQUEST_METHOD"] != "PUT":
            return self.app(environ, start_response)
        with self.lock:
            return list(self.app(environ, start_response))

class Handler(MotoRequestHandler):
    protocol_version = "HTTP/1.1"

app = OneWriteAtATime(DomainDispatcherApplication(create_backend_app))
run_simple("127.0.0.1", int(sys.argv[1]), app, threaded=True, request_handler=Handler)
"""
KEYS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_REGION": "us-east-1"}
BUCKET = "bucket"
CODES = {
    "409": b"<Error><Code>ConditionalRequestConflict</Code></Error>",
    "400": b"<Error><Code>RequestTimeout</Code></Error>",
}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def s3_server(page: int = 7) -> Iterator[int]:
    """Start moto's server with a bucket; yield its port.

    Args:
        page: names in one answer to a list. S3 gives 1,000, this server few, so that each list of a test has pages.
    """
    port = free_port()
    command = [sys.executable, "-c", SERVER, str(port)]
    environment = {**os.environ, "MOTO_S3_DEFAULT_MAX_KEYS": str(page)}
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
    try:
        _make_bucket(server, port)
        yield port
    finally:
        server.kill()
        server.wait()


def _make_bucket(server: "subprocess.Popen[bytes]", port: int) -> None:
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and server.poll() is None:
        with suppress(OSError):
            urllib.request.urlopen(urllib.request.Request(f"http://127.0.0.1:{port}/{BUCKET}", method="PUT")).close()
            return
        time.sleep(0.1)
    raise RuntimeError("the S3 server does not start")


def fresh_url() -> str:
    """Return the URL of a cache that is not there yet."""
    return f"s3://{BUCKET}/{uuid4().hex}"


@contextmanager
def pointed_at(port: int) -> Iterator[str]:
    """Have this process and its children use the server at a port; yield the URL of a fresh cache."""
    before = dict(os.environ)
    os.environ.update({**KEYS, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}"})
    try:
        yield fresh_url()
    finally:
        os.environ.clear()
        os.environ.update(before)


@dataclass
class Faults:
    """What a proxy does to requests, and what it saw.

    Attributes:
        rate: part of the requests that go wrong.
        kinds: what happens to these; 409 and 400 are what S3 says when two conditional writes meet, and when a request
            comes too slowly: they happen to PUT, and others get a 503 instead.
        slow: seconds that a slow answer takes.
        late: seconds after its PUT in which an object is missing in lists.
        injected: how often each kind happened.
        requests: how many requests of each method came.
        up: bytes of their bodies.
        down: bytes of the answers' bodies.
    """

    rate: float = 0.0
    kinds: tuple[str, ...] = ("500", "503", "409", "400", "dropped before", "lost answer", "slow")
    slow: float = 1.0
    late: float = 0.0
    seed: int = 26
    injected: Counter[str] = field(default_factory=Counter)
    requests: Counter[str] = field(default_factory=Counter)
    up: int = 0
    down: int = 0

    def __post_init__(self) -> None:
        self._chance, self._lock = random.Random(self.seed), threading.Lock()
        self._written: dict[str, float] = {}

    def draw(self, method: str, size: int) -> str:
        """Return what happens to a request; nothing for most."""
        with self._lock:
            self.requests[method] += 1
            self.up += size
            if self._chance.random() >= self.rate:
                return ""
            kind = self._chance.choice(self.kinds)
            kind = kind if method == "PUT" or kind not in ("409", "400") else "503"
            self.injected[kind] += 1
            return kind

    def wrote(self, path: str) -> None:
        """Note that an object was written."""
        self._written.setdefault(path, time.monotonic())

    def listed(self, answer: bytes) -> bytes:
        """Return a list without the objects that were written lately."""
        late = {path for path, when in list(self._written.items()) if time.monotonic() - when < self.late}
        early = set(self._written) - late

        def unless_late(match: "re.Match[bytes]") -> bytes:
            path = f"/{BUCKET}/{html.unescape(match[2].decode())}"
            is_late = path in late or (path.endswith("/") and not any(each.startswith(path) for each in early))
            return b"" if is_late else match[0]

        kept = re.sub(rb"<(Contents|CommonPrefixes)>\s*<(?:Key|Prefix)>(.*?)<.*?</\1>", unless_late, answer, flags=re.S)
        self.injected["late list"] += kept != answer
        return kept


@contextmanager
def proxy(port: int, faults: Faults) -> Iterator[int]:
    """Start a proxy before a server; yield its port."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def handle_one_request(self) -> None:
            with suppress(ConnectionError, HTTPException):
                super().handle_one_request()

        def log_message(self, *_: object) -> None:
            return

        def __getattr__(self, name: str) -> Callable[[], None]:
            if name.startswith("do_"):
                return self._pass_on
            raise AttributeError(name)

        def _pass_on(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            kind = faults.draw(self.command, len(body))
            if kind.isdecimal():
                return self._answer(int(kind), {}, CODES.get(kind, b"injected"))
            if kind == "dropped before":
                return self._drop()
            if kind == "slow":
                time.sleep(faults.slow)
            status, headers, data = self._ask(body)
            if faults.late and self.command == "PUT":
                faults.wrote(self.path)
            if faults.late and "list-type=2" in self.path:
                data = faults.listed(data)
            if kind == "lost answer":
                return self._drop()
            faults.down += len(data)
            return self._answer(status, headers, data)

        def _ask(self, body: bytes) -> tuple[int, dict[str, str], bytes]:
            connection = HTTPConnection("127.0.0.1", port, timeout=60)
            connection.request(self.command, self.path, body, dict(self.headers))
            answer = connection.getresponse()
            data = answer.read()
            connection.close()
            return answer.status, dict(answer.getheaders()), data

        def _answer(self, status: int, headers: dict[str, str], data: bytes) -> None:
            self.send_response_only(status)
            own = {"transfer-encoding", "connection"} | ({"content-length"} if self.command != "HEAD" else set())
            for name, value in headers.items():
                if name.lower() not in own:
                    self.send_header(name, value)
            if self.command != "HEAD":
                self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def _drop(self) -> None:
            self.close_connection = True
            with suppress(OSError):
                self.connection.shutdown(socket.SHUT_RDWR)

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
