from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.pipeline.files.file_names import safe_names


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        pytest.param("Teddy", "Teddy", id="plain"),
        pytest.param("trainingQ/Teddy", "trainingQ_Teddy", id="separator"),
        pytest.param("..", "_", id="parent"),
        pytest.param("../../etc/passwd", "_.._etc_passwd", id="climbing"),
        pytest.param("/etc/passwd", "_etc_passwd", id="absolute"),
        pytest.param("a\\..\\b", "a_.._b", id="windows-separator"),
        pytest.param("C:evil", "C_evil", id="windows-drive"),
        pytest.param("nul", "_nul", id="windows-device"),
        pytest.param("", "_", id="empty"),
        pytest.param(".hidden", "hidden", id="hidden"),
        pytest.param("-rf", "rf", id="option"),
        pytest.param("a\0b\nc", "a_b_c", id="control-characters"),
        pytest.param("x" * 300, "x" * 80, id="too-long"),
    ],
)
def test_a_name_becomes_a_plain_file_name(name: str, expected: str) -> None:
    assert safe_names([name]) == {name: expected}


def test_names_that_would_come_out_alike_stay_apart() -> None:
    safe = safe_names(["a/b", "a_b", "A_B", "c"])
    assert len({name.lower() for name in safe.values()}) == 4
    assert all(safe[name].startswith(("a_b-", "A_B-")) for name in ("a/b", "a_b", "A_B"))
    assert safe["c"] == "c"


def test_a_name_that_comes_twice_is_one_name() -> None:
    assert safe_names(["a", "a"]) == {"a": "a"}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.text(max_size=12), max_size=4))
def test_no_name_is_a_path_and_none_is_lost(names: list[str]) -> None:
    safe = safe_names(names)
    assert list(safe) == list(dict.fromkeys(names))
    assert len({name.lower() for name in safe.values()}) == len(safe)
    for name in safe.values():
        assert PurePosixPath(name).name == PureWindowsPath(name).name == name
        assert not name.startswith((".", "-"))
