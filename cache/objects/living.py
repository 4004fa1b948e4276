"""Objects that say that their process is alive: it writes them again every few seconds, and others see the time.

Leases, claims and the mark of a cleaning are such objects. One that was not written for long is dead: whoever wants
its name takes it over by a conditional write, which one of several takers wins. All times are by the store's clock.
"""

import json
import secrets
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from semidense.cache.errors import CacheUnavailable
from semidense.cache.objects.requests import Found, Objects
from semidense.cache.owner import describe, owner

EXPIRY = 90.0
"""Seconds without a sign of life after which an object's process counts as dead."""
BEAT = 20.0
"""Seconds between two signs of life."""


class Living:
    """An object that this process keeps alive until it is released, or the process ends."""

    def __init__(self, objects: Objects, path: str, content: Mapping[str, Any]) -> None:
        self.path = path
        self._objects = objects
        self._content = {**content, "owner": owner(), "token": secrets.token_hex(8)}
        self._lock = threading.Lock()

    def renew(self) -> bool:
        """Write the object again; return False if it is no longer this process's own."""
        with self._lock:  # of two threads that renew at a time, one would take the other for somebody else
            found = self._objects.get(self.path)
            if found is None or content_of(found).get("token") != self._content["token"]:
                return False
            return self._objects.replace(self.path, self.to_bytes(), found)

    def release(self) -> None:
        """Delete the object, if it is still this process's own: let the next one have its name."""
        _hearts.discard(self)
        with suppress(CacheUnavailable):
            found = self._objects.get(self.path)
            if found and content_of(found).get("token") == self._content["token"]:
                self._objects.delete([self.path])

    def to_bytes(self) -> bytes:
        """Return the object's bytes: different ones each time, so that an answer that was lost can be told."""
        return json.dumps({**self._content, "beat": secrets.token_hex(8)}, sort_keys=True).encode("ascii")


def take(objects: Objects, path: str, content: Mapping[str, Any] | None = None) -> Living | None:
    """Return the object of this name as this process's own; None while another living process or thread has it.

    Raises:
        CacheUnavailable: if the store refuses.
    """
    mine = Living(objects, path, content or {})
    data = mine.to_bytes()
    there = objects.create(path, data)
    if there and (is_alive(objects, there) or not objects.replace(path, data, there)):
        return None
    _hearts.add(mine)
    return mine


def is_alive(objects: Objects, found: Found | None) -> bool:
    """Return whether an object was written lately."""
    return found is not None and objects.now() - found.modified < EXPIRY


def content_of(found: Found) -> dict[str, Any]:
    """Return what an object says; nothing if it is not one of this kind."""
    try:
        content = json.loads(found.data)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def owner_of(found: Found | None) -> str | None:
    """Return who keeps an object alive, such as ``process 123 on host``; None if nobody says so."""
    return describe(str(content_of(found).get("owner"))) if found else None


class _Hearts:
    """All objects that this process keeps alive, and the thread that does."""

    def __init__(self) -> None:
        self._all: set[Living] = set()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def add(self, living: Living) -> None:
        with self._lock:
            self._all.add(living)
            if self._thread is None:
                self._thread = threading.Thread(target=self._beat, name="cache leases", daemon=True)
                self._thread.start()

    def discard(self, living: Living) -> None:
        with self._lock:
            self._all.discard(living)

    def _beat(self) -> None:
        while self._sleep():
            for each in list(self._all):
                with suppress(CacheUnavailable):  # it is tried again at the next beat
                    if not each.renew():
                        self.discard(each)

    def _sleep(self) -> bool:
        """Wait for the next beat; return False, and forget the thread, if nothing is left to keep alive."""
        time.sleep(BEAT)
        with self._lock:
            if not self._all:
                self._thread = None
            return bool(self._all)


_hearts = _Hearts()
