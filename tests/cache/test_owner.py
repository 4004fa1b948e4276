import os
import subprocess
import sys

from semidense.cache.owner import is_abandoned, owner


def test_own_things_are_not_abandoned() -> None:
    assert not is_abandoned(f"{owner()}-00ff")
    assert not is_abandoned(f"{owner()}-00ff.json")


def test_a_process_that_ended_has_abandoned_its_things() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        pass
    host = owner().split("-")[0]
    assert is_abandoned(f"{host}-{process.pid}-0-00ff")


def test_a_used_again_process_id_does_not_protect() -> None:
    host, pid, start = owner().split("-")
    assert int(pid) == os.getpid()
    assert is_abandoned(f"{host}-{pid}-{int(start) + 1}-00ff")


def test_other_hosts_and_other_names_are_left_alone() -> None:
    host, pid, start = owner().split("-")
    assert not is_abandoned(f"not{host}-{pid}-{int(start) + 1}-00ff")
    assert not is_abandoned("notes.txt")
    assert is_abandoned(f"{host}-{'9' * 30}-0-00ff")
