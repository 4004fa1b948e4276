"""Fetch a benchmark: download, compare the checksums, unpack; begun again, it goes on where it stopped."""

import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import pooch

from semidense.datasets.benchmarks.copies.catalogue import archives_of
from semidense.datasets.benchmarks.copies.download import LARGEST, Resumable, Watch
from semidense.datasets.benchmarks.copies.lock import Lock
from semidense.datasets.benchmarks.copies.publication import Publication, Source
from semidense.datasets.errors import FetchError, MissingFileError
from semidense.datasets.formats.archives.kinds import kind_of
from semidense.datasets.formats.archives.unpack import unpack

pooch.get_logger().setLevel("WARNING")  # it would tell each download, and ask to copy its checksum


@dataclass(frozen=True)
class Fetch:
    """How benchmarks are fetched.

    Attributes:
        data: the folder of all data.
        lock: the checksums.
        origin: instead of the publishers' servers, the address of a mirror, or a folder of files; both hold each file
            under the path of the publisher's address, and a folder also by its name alone where that is the only one.
        watching: gives for each address a `Watch` that is told how its download goes on.
        largest: bytes that a file may have.
    """

    data: Path
    lock: Lock
    origin: str | None
    watching: Callable[[str], AbstractContextManager[Watch]]
    largest: int = LARGEST

    def __call__(self, wanted: Publication) -> None:
        """Fetch a publication: all of its files are here before the first is unpacked.

        Raises:
            FetchError: If a file cannot be fetched, or is not the one whose checksum the lock has.
            ArchiveError: If an archive holds what is not unpacked.
            OSError: If a folder cannot be written.
        """
        kept = archives_of(wanted, self.data)
        kept.mkdir(parents=True, exist_ok=True)
        files = [(source, self._obtain(source, kept, wanted)) for source in wanted.sources]
        for source, file in files:
            self._place(source, file)
        shutil.rmtree(kept)
        if kept.parent.is_dir() and not any(kept.parent.iterdir()):
            kept.parent.rmdir()

    def _obtain(self, source: Source, kept: Path, wanted: Publication) -> Path:
        if self.origin and not self.origin.startswith(("http://", "https://")):
            found = self._in_folder(Path(self.origin).expanduser(), source, wanted)
            return self._checked(source, found)
        return self._downloaded(source, kept / _path(source))

    def _in_folder(self, folder: Path, source: Source, wanted: Publication) -> Path:
        names = [_path(each).rpartition("/")[2] for each in wanted.sources]
        name = _path(source).rpartition("/")[2]
        candidates = [folder / _path(source), *([folder / name] if names.count(name) == 1 else [])]
        found = next((path for path in candidates if path.is_file()), None)
        if found is None:
            raise MissingFileError(f"no {' and no '.join(map(str, candidates))}; --from needs one of them")
        return found

    def _checked(self, source: Source, file: Path) -> Path:
        digest, expected = pooch.file_hash(str(file)), self.lock.digest(source.address)
        if expected not in (None, digest):
            raise self._changed(source.address, str(file))
        self.lock.record(source.address, digest, file.stat().st_size)
        return file

    def _downloaded(self, source: Source, file: Path) -> Path:
        address = f"{self.origin.rstrip('/')}/{_path(source)}" if self.origin else source.address
        file.parent.mkdir(parents=True, exist_ok=True)
        with self.watching(address) as watch:
            loader = Resumable(file.with_name(f"{file.name}.part"), watch, self.largest)
            try:
                pooch.retrieve(address, self.lock.digest(source.address), file.name, file.parent, downloader=loader)
            except ValueError as error:
                if isinstance(error, FetchError):
                    raise
                raise self._changed(source.address, address) from error
        return self._checked(source, file)

    def _changed(self, address: str, found: str) -> FetchError:
        return FetchError(
            f"{found}: these are not the bytes whose sha256 is recorded for {address}; ask its publisher, or delete "
            f"that entry from {self.lock.path} to trust what is there now"
        )

    def _place(self, source: Source, file: Path) -> None:
        folder = self.data / source.folder
        if kind_of(file.name):
            unpack(file, folder)
            return
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, folder / file.name)


def _path(source: Source) -> str:
    return urlsplit(source.address).path.lstrip("/")
