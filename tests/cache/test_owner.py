import os

from semidense.cache.owner import describe, owner


def test_the_owner_of_a_lock_is_told_in_words() -> None:
    host, pid = owner().rsplit("-", 1)
    assert int(pid) == os.getpid()
    assert describe(owner()) == f"process {pid} on {host}"


def test_other_texts_name_nobody() -> None:
    assert [describe(text) for text in ("", "notes", "host-x", "a b-1", "host-1-2")] == [None] * 5
