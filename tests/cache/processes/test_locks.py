import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from semidense.cache.errors import CacheUnavailable
from semidense.cache.processes.locks import held


def test_one_thread_at_a_time(tmp_path: Path) -> None:
    inside, most = [0], [0]

    def work(_: int) -> None:
        with held(tmp_path / "lock"):
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            time.sleep(0.001)
            inside[0] -= 1

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(60)))
    assert most == [1]
    assert not list(tmp_path.iterdir())


def test_released_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), held(tmp_path / "lock"):
        raise ZeroDivisionError
    with held(tmp_path / "lock"):
        pass


def test_waits_for_its_holder(tmp_path: Path) -> None:
    order = []

    def second() -> None:
        with held(tmp_path / "lock"):
            order.append("second")

    with held(tmp_path / "lock"):
        thread = threading.Thread(target=second)
        thread.start()
        time.sleep(0.05)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]


def test_dies_with_its_process(tmp_path: Path, run_script: Callable[..., str]) -> None:
    run_script(
        """
def work():
    assert Store(sys.argv[1]).claim("0" * 64)
    die()
assert code(in_child(work)) == -signal.SIGKILL
assert Store(sys.argv[1]).claim("0" * 64)
""",
        tmp_path,
    )


def test_a_missing_folder_is_explained(tmp_path: Path) -> None:
    with pytest.raises(CacheUnavailable, match="cannot write to the cache at"), held(tmp_path / "no" / "lock"):
        pass
