"""Caches in object stores: in memory, and on a real S3 server."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from semidense.cache import Store
from tests.s3 import pointed_at, s3_server

_number = itertools.count()


@pytest.fixture(scope="session")
def s3_port() -> Iterator[int]:
    with s3_server() as port:
        yield port


@pytest.fixture(autouse=True)
def own_near(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What this machine keeps of objects, for one test alone."""
    monkeypatch.setenv("PIPELINE_NEAR", str(tmp_path / "near"))
    return tmp_path / "near"


@pytest.fixture
def memory() -> Store:
    return Store(f"memory://test-{next(_number)}")


@pytest.fixture
def s3(s3_port: int) -> Iterator[Store]:
    with pointed_at(s3_port) as url:
        yield Store(url)


@pytest.fixture(params=["memory", "s3"])
def objects_store(request: pytest.FixtureRequest) -> Store:
    store: Store = request.getfixturevalue(request.param)
    return store
