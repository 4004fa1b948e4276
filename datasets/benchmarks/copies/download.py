"""Download a file over http: resumed where it broke off, never larger than the cap, never from https to http.

`Resumable` is what `pooch.retrieve` takes for a downloader; Pooch compares the checksum before the file gets its name.
"""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import requests

from semidense.datasets.errors import FetchError

LARGEST = 8 << 30
"""Bytes that a file may have: four times the largest archive of the benchmarks."""
Watch: TypeAlias = Callable[[int, int | None], None]
"""Told how many bytes are here, and how many there will be if that is known."""
_CONNECT_SECONDS, _SILENT_SECONDS = 10, 60
_CHUNK = 1 << 16
"""Bytes that are written at once: less is lost when the connection breaks."""
_TRIES = 10
"""How often a download is resumed, if each time brings something new."""


@dataclass(frozen=True)
class Resumable:
    """Download to a file beside the one that is wanted, which stays when the connection breaks.

    Attributes:
        part: that file. What the server says of its version is kept beside it: another version is begun anew.
        watch: told how it goes on.
        largest: bytes that it may have.
    """

    part: Path
    watch: Watch = lambda here, total: None
    largest: int = LARGEST

    def __call__(self, url: str, output_file: str, pooch: object, check_only: bool = False) -> None:
        """Download an address to a file, as Pooch asks.

        Raises:
            FetchError: If the server cannot be reached, refuses, or sends too much; in one line.
        """
        with requests.Session() as session:
            for _ in range(_TRIES):
                before = self._size()
                try:
                    self._attempt(session, url)
                    break
                except (requests.RequestException, _CutError) as error:
                    if self._size() <= before:
                        raise FetchError(f"{url}: {_reason(error)}") from error
                except OSError as error:
                    raise FetchError(f"{self.part}: cannot be written ({error.strerror or error})") from error
            else:
                raise FetchError(f"{url}: the connection broke {_TRIES} times; fetch again to go on from there")
        self._tag.unlink(missing_ok=True)
        shutil.move(self.part, output_file)

    @property
    def _tag(self) -> Path:
        return self.part.with_name(f"{self.part.name}.version")

    def _size(self) -> int:
        return self.part.stat().st_size if self.part.exists() else 0

    def _attempt(self, session: requests.Session, url: str) -> None:
        version = self._tag.read_text() if self._tag.exists() and self.part.exists() else ""
        headers = {"Accept-Encoding": "identity"}
        if version:
            headers |= {"Range": f"bytes={self._size()}-", "If-Range": version}
        timeout = (_CONNECT_SECONDS, _SILENT_SECONDS)
        with session.get(url, headers=headers, stream=True, timeout=timeout) as answer:
            self._check(url, answer)
            resumed = answer.status_code == requests.codes.partial_content
            if not resumed:
                self._tag.write_text(_version(answer))
            self._receive(url, answer, self._size() if resumed else 0)

    def _check(self, url: str, answer: requests.Response) -> None:
        if url.startswith("https:") and not all(each.url.startswith("https:") for each in (*answer.history, answer)):
            raise FetchError(f"{url}: the server leads from https to {answer.url}; that is not followed")
        place = answer.headers.get("Content-Range", "")
        begun = answer.status_code != requests.codes.partial_content or place.startswith(f"bytes {self._size()}-")
        if answer.status_code == requests.codes.requested_range_not_satisfiable or not begun:
            self.part.unlink()
            raise FetchError(f"{url}: what was fetched before no longer fits and is deleted; fetch it again")
        if answer.status_code not in (requests.codes.ok, requests.codes.partial_content):
            raise FetchError(f"{url}: the server answers {answer.status_code} {answer.reason}")

    def _receive(self, url: str, answer: requests.Response, here: int) -> None:
        length = answer.headers.get("Content-Length", "")
        total = here + int(length) if length.isdecimal() else None
        with self.part.open("r+b" if here else "wb") as file:
            file.seek(here)
            self._check_amount(url, total or 0)
            for chunk in answer.iter_content(_CHUNK):
                here += len(chunk)
                self._check_amount(url, here)
                file.write(chunk)
                self.watch(here, total)
        if total is not None and here < total:
            raise _CutError

    def _check_amount(self, url: str, size: int) -> None:
        if size > self.largest:
            raise FetchError(f"{url}: more than {self.largest:,} bytes, which no benchmark has; it is not fetched")


class _CutError(Exception):
    """The connection ended before the file did."""


def _version(answer: requests.Response) -> str:
    """Return what tells this version of the file from another, for ``If-Range``; nothing if the server does not say."""
    tag = answer.headers.get("ETag", "")
    return tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified", "")


def _reason(error: Exception) -> str:
    if isinstance(error, requests.exceptions.SSLError):
        return "the server's certificate is not trusted"
    if isinstance(error, requests.exceptions.Timeout):
        return f"no answer within {_CONNECT_SECONDS} s"
    if isinstance(error, requests.exceptions.TooManyRedirects):
        return "the server leads in a circle"
    if isinstance(error, requests.exceptions.InvalidURL | requests.exceptions.InvalidSchema):
        return "no valid address; write http:// or https://"
    return "cannot be reached, or the connection broke; is there a network? --from takes a mirror or a folder"
