"""The requests that a cache makes to an object store. Each can be sent again, so each is, until it is answered."""

import os
import random
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypeVar
from uuid import uuid4

from semidense.cache.errors import CacheUnavailable
from semidense.cache.objects.clock import Clock

T = TypeVar("T")
PATIENCE = 60.0
"""Seconds, from its first failure, for which a request is sent again before the store is said not to answer."""
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""Seconds between two tries: the pause doubles, and a random part keeps clients apart."""
TIMEOUT, CONNECT_TIMEOUT = "60s", "5s"
_ADVICE = (
    "check its address and your keys in the environment (for S3: AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION, "
    "AWS_ENDPOINT_URL), and that the bucket exists"
)
_MEMORY = "memory://"
_FINAL = ("builder error", *(f"status code: {code}" for code in (301, 307, 400, 401, 403, 404, 405)))
_PASSING = "<Code>RequestTimeout</Code>"
"""What S3 says, under the code 400, when a request came too slowly: sent again, it may come in time."""


@dataclass(frozen=True)
class Found:
    """An object: its bytes, its version, when it was last written by the store's clock, and its attributes."""

    data: bytes
    version: Mapping[str, str]
    modified: float
    size: int
    attributes: Mapping[str, str]


@dataclass(frozen=True)
class Listed:
    """An object of a list: its name, bytes, and when it was last written by the store's clock."""

    path: str
    size: int
    modified: float


_connected: dict[str, "Objects"] = {}
_connecting = threading.Lock()
_process: int | None = None
"""The process that made the first connection: the threads of connections are its own."""


def connect(url: str) -> "Objects":
    """Return the objects below a URL; all users of a URL in this process share their connections.

    Raises:
        CacheUnavailable: if the URL names no object store, or the package for it is missing.
    """
    global _process
    with _connecting:
        _process = _process or os.getpid()
        if url not in _connected:
            _connected[url] = _new(url)
        return _connected[url]


def _new(url: str) -> "Objects":
    try:
        import obstore
    except ImportError:
        raise CacheUnavailable(
            f"a cache at {url} needs the package obstore: pip install 'semidense-stereo[cloud]'"
        ) from None
    if "?" in url or "#" in url or {".", ".."} & set(url.split("/")):
        raise CacheUnavailable(f"{url} is no place for a cache: choose a prefix without ?, # and parts that are dots")
    try:
        if url.startswith(_MEMORY):
            return Objects(url, obstore.store.MemoryStore())
        once: Any = {"max_retries": 0, "retry_timeout": timedelta(seconds=0)}  # retried here, and only here
        plain = os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://")  # whoever writes http means it
        options: Any = {"timeout": TIMEOUT, "connect_timeout": CONNECT_TIMEOUT, "allow_http": plain}
        store: Any = obstore.store.from_url(url, retry_config=once, client_options=options)
    except (obstore.exceptions.BaseError, ValueError, TypeError) as error:
        raise CacheUnavailable(f"{url} is not an object store that can be used: {_first_line(error)}") from None
    return Objects(url, store)


class Objects:
    """The objects below a URL.

    Attributes:
        is_cache: whether this process has seen that they are a cache: it is asked for once.
    """

    def __init__(self, url: str, store: Any) -> None:  # noqa: ANN401
        self.url = url
        self._store = store
        self.is_cache = False
        self._clock: Clock | None = None

    def get(self, path: str) -> Found | None:
        """Return an object, None if there is none."""
        return self._read(path, head=False)

    def head(self, path: str) -> Found | None:
        """Return an object without its bytes, None if there is none."""
        return self._read(path, head=True)

    def create(self, path: str, data: bytes, attributes: Mapping[str, str] | None = None) -> Found | None:
        """Write an object that is not there; return what is there in its place, None if that is ``data`` now."""
        from obstore.exceptions import AlreadyExistsError

        def attempt() -> Found | None:
            try:
                self._put(path, data, "create", attributes)
                return None
            except AlreadyExistsError:
                if found := self.get(path):
                    return None if found.data == data else found
                raise  # it went since, or two writers met: write it after all

        return self._answered(attempt, "write to")

    def replace(self, path: str, data: bytes, old: Found) -> bool:
        """Write an object in place of a version of it; return whether it was still that version, or is ``data`` now."""
        from obstore.exceptions import PreconditionError

        def attempt() -> bool:
            try:
                self._put(path, data, dict(old.version), None)
            except (PreconditionError, FileNotFoundError):
                return (found := self.get(path)) is not None and found.data == data
            return True

        return self._answered(attempt, "write to")

    def put(self, path: str, data: bytes) -> None:
        """Write an object, whatever is there."""
        self._answered(lambda: self._put(path, data, "overwrite", None), "write to")

    def delete(self, paths: Iterable[str]) -> None:
        """Delete objects, those that are there."""
        import obstore

        names = list(paths)
        if names:
            self._answered(lambda: _absent_is_fine(lambda: obstore.delete(self._store, names)), "write to")

    def below(self, prefix: str) -> Iterator[Listed]:
        """Yield the objects below a prefix of whole names, in order."""
        import obstore

        def attempt() -> list[Listed]:
            return [_listed(meta) for batch in obstore.list(self._store, prefix) for meta in batch]

        return iter(sorted(self._answered(attempt, "read"), key=lambda each: each.path))

    def names(self, prefix: str = "") -> list[str]:
        """Return the names directly below a prefix, of objects and of prefixes."""
        import obstore

        def attempt() -> list[str]:
            found = obstore.list_with_delimiter(self._store, prefix or None)
            paths = [*found["common_prefixes"], *(meta["path"] for meta in found["objects"])]
            return sorted(path.rpartition("/")[2] for path in paths)

        return self._answered(attempt, "read")

    def now(self) -> float:
        """Return the time by the store's clock, in seconds since the epoch, or a little less.

        It is read once, and counted on from there; read again if this machine slept, or its own clock was set. An
        object then never looks older than it is: nobody who is alive is taken for dead.
        """
        clock = self._clock
        return (clock if clock and clock.is_right() else self._probe()).now()

    def require_conditions(self) -> None:
        """Refuse a store that ignores conditional writes; they keep two writers apart.

        Raises:
            CacheUnavailable: if it does, or cannot be written.
        """
        if self._clock is None:
            self._probe()

    def _probe(self) -> Clock:
        """Try conditional writes on an object that is deleted afterwards; return the clock that its time tells."""
        path, first, second = f"probe/{uuid4().hex}", uuid4().bytes, uuid4().bytes
        self.create(path, first)
        found = self.head(path)
        clock = Clock.read(found.modified if found else 0.0)
        try:
            if not found or self.create(path, second) is None or not self._replaces_only_its_version(path, second):
                raise CacheUnavailable(
                    f"the store at {self.url} ignores conditional writes (If-None-Match and If-Match), which keep two "
                    "writers apart: use a store that has them, such as S3, GCS, Azure or a recent MinIO"
                )
        finally:
            self.delete([path])
        self._clock = clock
        return clock

    def _replaces_only_its_version(self, path: str, data: bytes) -> bool:
        old = self.get(path)
        return bool(old and self.replace(path, data, old) and not self.replace(path, uuid4().bytes, old))

    def _require_own_process(self) -> None:
        """Refuse a request from a forked child, which would wait for threads that only its parent has."""
        if _process != os.getpid():
            raise CacheUnavailable(
                f"a forked process cannot use the cache at {self.url}: start it by spawn "
                "(multiprocessing.get_context('spawn')), or read the results before the fork"
            )

    def _put(self, path: str, data: bytes, mode: Any, attributes: Mapping[str, str] | None) -> None:  # noqa: ANN401
        import obstore

        obstore.put(self._store, path, data, mode=mode, attributes=dict(attributes or {}), use_multipart=False)

    def _read(self, path: str, head: bool) -> Found | None:
        import obstore

        def attempt() -> Found | None:
            try:
                result = obstore.get(self._store, path, options={"head": head})
            except FileNotFoundError:
                return None
            return _found(result, b"" if head else bytes(result.bytes()))

        return self._answered(attempt, "read")

    def _answered(self, attempt: Callable[[], T], action: str) -> T:
        """Return what a request gives, after sending it again while the store does not answer, or answers badly."""
        from obstore.exceptions import BaseError

        self._require_own_process()
        deadline, pause = None, FIRST_PAUSE
        while True:
            try:
                return attempt()
            except (BaseError, OSError) as error:
                if isinstance(error, CacheUnavailable):
                    raise
                deadline = deadline or time.monotonic() + PATIENCE  # a first try may have waited for its whole timeout
                if _is_final(error) or time.monotonic() + pause > deadline:
                    line = f"cannot {action} the cache at {self.url}: {_first_line(error)}; {_ADVICE}"
                    raise CacheUnavailable(line) from None
            time.sleep(pause * random.uniform(0.5, 1.0))
            pause = min(2 * pause, LONGEST_PAUSE)


def _absent_is_fine(delete: Callable[[], object]) -> None:
    try:
        delete()
    except FileNotFoundError:  # some stores say so, others do not
        return


def _is_final(error: Exception) -> bool:
    """Return whether asking again would get the same answer."""
    from obstore.exceptions import AlreadyExistsError, GenericError, JoinError

    passing = (AlreadyExistsError, GenericError, JoinError)  # the first is a 409: two conditional writes met
    refused = any(each in str(error) for each in _FINAL) and _PASSING not in str(error)
    return refused or not isinstance(error, passing)


def _found(result: Any, data: bytes) -> Found:  # noqa: ANN401
    meta = result.meta
    version = {name: meta[name] for name in ("e_tag", "version") if meta.get(name)}
    attributes = {str(name): str(value) for name, value in result.attributes.items()}
    return Found(data, version, meta["last_modified"].timestamp(), meta["size"], attributes)


def _listed(meta: Any) -> Listed:  # noqa: ANN401
    return Listed(meta["path"], meta["size"], meta["last_modified"].timestamp())


def _first_line(error: Exception) -> str:
    return (str(error).strip().partition("\n")[0] or type(error).__name__)[:300]
