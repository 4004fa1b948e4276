"""Requests that go wrong, and stores that cannot be used."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from obstore.exceptions import GenericError

from semidense.cache import CacheUnavailable, Store
from semidense.cache.objects import requests
from semidense.cache.objects.requests import Objects, connect
from tests.s3 import Faults, free_port, pointed_at, proxy


@pytest.mark.parametrize("kind", Faults().kinds)
def test_a_request_is_sent_again_until_it_is_answered(s3_port: int, kind: str) -> None:
    faults = Faults(rate=0.5, kinds=(kind,), slow=0.1)
    with proxy(s3_port, faults) as port, pointed_at(port) as url:
        objects = connect(url)
        for number in range(4):
            assert objects.create(f"a/{number}", b"one") is None
        other = objects.create("a/0", b"two")
        assert other is not None
        assert other.data == b"one"
        assert objects.replace("a/0", b"three", other)
        assert not objects.replace("a/0", b"four", other)
        assert [each.path for each in objects.below("a")] == [f"a/{number}" for number in range(4)]
        objects.delete(["a/0", "a/none"])
        assert objects.get("a/0") is None
    assert faults.injected[kind] > 0


def test_a_store_that_never_answers_is_told_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, "PATIENCE", 0.5)
    with (
        pointed_at(free_port()) as url,
        pytest.raises(CacheUnavailable, match=r"cannot read the cache at .*AWS_ENDPOINT_URL") as told,
    ):
        Store(url).find("0" * 64)
    assert "\n" not in str(told.value)


def test_a_bucket_that_is_not_there_is_told_in_one_line(s3_port: int) -> None:
    with (
        pointed_at(s3_port) as url,
        pytest.raises(CacheUnavailable, match=r"cannot write to .*that the bucket exists") as told,
    ):
        Store(url.replace("bucket", "no-such-bucket")).claim("0" * 64)
    assert "\n" not in str(told.value)


class Careless(Objects):
    """A store that writes whatever the condition says."""

    def _put(self, path: str, data: bytes, mode: Any, attributes: Any) -> None:  # noqa: ANN401
        super()._put(path, data, "overwrite", attributes)


def test_a_store_without_conditional_writes_is_refused() -> None:
    from obstore.store import MemoryStore

    careless = Careless("memory://careless", MemoryStore())
    with pytest.raises(CacheUnavailable, match="ignores conditional writes"):
        careless.require_conditions()
    assert list(careless.below("")) == []


def test_a_forked_child_is_refused_and_does_not_hang(run_script: Callable[..., str]) -> None:
    told = run_script(
        """
store = Store("memory://forked")
entry = make("memory://forked")
def look():
    from semidense.cache import CacheUnavailable
    try:
        store.read(entry.key)
    except CacheUnavailable as error:
        print(error, flush=True)
assert code(in_child(look)) == 0
"""
    )
    assert told.startswith("a forked process cannot use the cache at memory://forked: start it by spawn")
    assert "\n" not in told.rstrip()


def test_the_patience_for_a_store_begins_with_the_first_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, "PATIENCE", 0.3)
    tries: list[float] = []

    def hangs_once() -> str:
        tries.append(0.0)
        if len(tries) == 1:
            time.sleep(0.5)
            raise GenericError("operation timed out")
        return "answered"

    assert connect("memory://patient")._answered(hangs_once, "read") == "answered"


@pytest.mark.parametrize("prefix", ["a?b=c", "a#b", "a/../b", "./a", ".."])
def test_a_prefix_that_would_become_another_one_is_refused(prefix: str) -> None:
    with pytest.raises(CacheUnavailable, match="choose a prefix without"):
        connect(f"s3://bucket/{prefix}")


def test_caches_side_by_side_do_not_see_each_other(s3_port: int, make: Callable[..., Any]) -> None:
    with pointed_at(s3_port) as url:
        names = ["a", "a2", "a b", "a+b", "a&b", "a=b", "a*b", "a:b", "\u00fc/\u4e2d", "~"]
        for number, name in enumerate(names):
            make(Store(f"{url}/{name}"), n=number)
        for number, name in enumerate(names):
            (entry,) = Store(f"{url}/{name}").entries()
            assert entry.recipe.params == {"n": number}
        with pytest.raises(CacheUnavailable, match="is not a cache: it holds"):
            make(Store(url))


def test_lists_and_deletes_of_many_objects_are_whole(s3_port: int) -> None:
    with pointed_at(s3_port) as url:
        objects = connect(url)
        paths = [f"a/{number:02d}" for number in range(40)]  # six pages of the server's
        for path in paths:
            objects.put(path, b"")
            objects.put(path.replace("a/", "a2/"), b"")
        assert [each.path for each in objects.below("a")] == paths
        assert objects.names("a") == [path.removeprefix("a/") for path in paths]
        assert objects.names() == ["a", "a2"]
        objects.delete([*paths, *(f"a/none{number}" for number in range(1000))])  # a request deletes 1,000 at most
        assert objects.names() == ["a2"]
