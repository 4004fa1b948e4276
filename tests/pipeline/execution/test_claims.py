import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from semidense.cache import Store
from semidense.pipeline.execution.claims import LocalClaims, RunStopped

KEY, OTHER = "ab" * 32, "cd" * 32


@pytest.fixture
def claims(store: Store) -> Iterator[LocalClaims]:
    with store.lease() as lease:
        found = LocalClaims(lease, store, threads=2)
        yield found
        found.stop()
        found.close()


def silent(_: str) -> None:
    """Say nothing."""


def test_who_waits_says_for_whom_and_goes_on_when_it_is_free(store: Store, claims: LocalClaims) -> None:
    other = store.claim(KEY)
    assert other
    told: list[str] = []
    thread = threading.Thread(target=claims.take, args=(KEY, told.append))
    thread.start()
    time.sleep(0.8)
    assert thread.is_alive()
    other.release()
    thread.join(5)
    assert not thread.is_alive()
    assert told == ["an equal scene of this run"], "the claim is of this very process"
    assert store.claim(KEY) is None, "it has the claim now"
    claims.release(KEY)
    free = store.claim(KEY)
    assert free
    free.release()


def test_who_waits_takes_over_from_a_process_that_is_killed(store: Store, claims: LocalClaims) -> None:
    program = f"""
import time
from pathlib import Path
from semidense.cache import Store
claim = Store(Path({str(store.root)!r})).claim({KEY!r})
print("has it", flush=True)
time.sleep(600)
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout
        assert other.stdout.readline() == "has it\n"
        told: list[str] = []
        thread = threading.Thread(target=claims.take, args=(KEY, told.append))
        thread.start()
        deadline = time.monotonic() + 60
        while not told and time.monotonic() < deadline:
            time.sleep(0.05)
        assert thread.is_alive()
        other.kill()
        thread.join(60)
    assert not thread.is_alive()
    assert f"process {other.pid} on " in told[0]
    assert store.claim(KEY) is None, "it has the claim now"


def test_a_run_never_waits_with_all_its_threads_while_its_own_products_stand_still(store: Store) -> None:
    with store.lease() as lease:
        claims = LocalClaims(lease, store, threads=1)
        claims.take(KEY, silent)
        other = store.claim(OTHER)
        assert other
        claims.take(OTHER, silent)  # returns at once: it is made twice rather than waited for
        claims.close()
        other.release()


def test_a_run_that_ends_wakes_what_waits(store: Store, claims: LocalClaims) -> None:
    other = store.claim(KEY)
    assert other
    errors: list[BaseException] = []

    def work() -> None:
        try:
            claims.take(KEY, silent)
        except RunStopped as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    claims.stop()
    thread.join(5)
    assert len(errors) == 1
    other.release()
