import json
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.cache import document
from semidense.cache.document import Documents, canonical, digest, laid_out, parse, plain, seal, unseal
from semidense.cache.errors import InvalidRecipe

scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
trees = st.recursive(
    scalars, lambda t: st.lists(t, max_size=3) | st.dictionaries(st.text(), t, max_size=3), max_leaves=8
)
objects = st.dictionaries(st.text(), trees, max_size=4)


@settings(max_examples=40, deadline=None)
@given(objects)
def test_canonical_round_trips(value: dict[str, Any]) -> None:
    again = parse(canonical(value))
    assert again == value
    assert canonical(again) == canonical(value)


@settings(max_examples=40, deadline=None)
@given(objects)
def test_order_of_keys_does_not_matter(value: dict[str, Any]) -> None:
    assert canonical(dict(reversed(value.items()))) == canonical(value)


@settings(max_examples=40, deadline=None)
@given(trees, trees)
def test_different_values_have_different_texts(first: object, second: object) -> None:
    if canonical(first) == canonical(second):
        assert first == second


@pytest.mark.parametrize(
    ("value", "text"),
    [
        pytest.param((1, [2]), "[1,[2]]", id="tuples are lists"),
        pytest.param([1, 1.0, True], "[1,1.0,true]", id="types that compare equal stay apart"),
        pytest.param([0.1, 1e300, -0.0], "[0.1,1e+300,-0.0]", id="floats by repr"),
        pytest.param({"b": 1, "a": 2, "A": 3}, '{"A":3,"a":2,"b":1}', id="keys sorted by code point"),
        pytest.param("é\n", '"\\u00e9\\n"', id="ASCII only"),
    ],
)
def test_canonical_spelling(value: object, text: str) -> None:
    assert canonical(value) == text


def _numpy_float() -> object:
    import numpy as np

    return np.float64(1)


@pytest.mark.parametrize(
    "value",
    [
        pytest.param(math.nan, id="NaN is not JSON"),
        pytest.param([math.inf], id="nor is infinity, inside a list too"),
        pytest.param({1: 2}, id="a key that is not text would become one"),
        pytest.param({1, 2}, id="a set has no order"),
        pytest.param(b"x", id="bytes"),
        pytest.param(object(), id="an object"),
        pytest.param(_numpy_float(), id="a NumPy scalar, though it is a float"),
    ],
)
def test_canonical_refuses(value: object) -> None:
    with pytest.raises(InvalidRecipe, match=r"^[^\n]+$"):
        canonical(value)


@pytest.mark.parametrize(
    "text",
    [
        pytest.param('{"a":1,"a":2}', id="repeated key"),
        pytest.param('{"a":NaN}', id="NaN"),
        pytest.param('{"a":1e999}', id="a number beyond floats"),
        pytest.param("[1]", id="not an object"),
        pytest.param('{"a":1} x', id="trailing text"),
        pytest.param('{"a":' + "[" * 100_000 + "]" * 100_000 + "}", id="nested without end"),
        pytest.param("", id="empty"),
    ],
)
def test_parse_refuses(text: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        parse(text)


def test_seal_and_unseal() -> None:
    data = seal("thing", {"b": (1, 2), "a": None})
    assert unseal("thing", data) == {"a": None, "b": [1, 2]}


def test_every_changed_byte_breaks_the_seal() -> None:
    data = seal("thing", {"a": [1, 2.5, "text"]})
    for offset in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[offset] ^= 1 << bit
            with pytest.raises(ValueError, match=r"."):
                unseal("thing", bytes(changed))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        pytest.param(seal("thing", {"a": 1}).replace(b'"format": 1', b'"format": 2'), "format 2.*reads 1", id="newer"),
        pytest.param(seal("thing", {"a": 1}).replace(b'"format": 1', b'"format": 0'), "format 0.*reads 1", id="older"),
        pytest.param(seal("other", {"a": 1}), "is a 'other', expected a 'thing'", id="another kind"),
        pytest.param(seal("thing", {"a": 1}).replace(b'"a": 1', b'"a": 2'), "checksum", id="edited"),
        pytest.param(seal("thing", {"a": 1}).replace(b" ", b"  "), "spelling", id="more white space"),
        pytest.param(seal("thing", {"a": 1})[:-1], "spelling", id="last newline cut"),
        pytest.param(b"{}", "format None", id="empty object"),
        pytest.param("é".encode(), "ascii", id="not ASCII"),
        pytest.param(seal("thing", {"a": 1}).replace(b'"a": 1', b'"a": 1e999'), "no JSON spelling", id="infinite"),
        pytest.param(
            seal("thing", {"a": 1}).replace(b'"a": 1', b'"a": ' + b"[" * 900 + b"]" * 900), "deeply", id="nested deeply"
        ),
    ],
)
def test_unseal_refuses(data: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        unseal("thing", data)


def test_digest_is_the_sha256_of_the_text() -> None:
    # printf '{"a":1}' | sha256sum
    assert digest({"a": 1}) == "015abd7f5cc57a2dd94b7590f04ad8084273905ee33ec5cebeae62276a97f862"


@settings(max_examples=100, deadline=None)
@given(trees)
def test_documents_are_laid_out_as_the_standard_library_does(value: object) -> None:
    assert laid_out(plain(value)) == json.dumps(value, sort_keys=True, indent=1)


def test_a_document_of_many_texts_costs_few_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan reads thousands of records, each with hundreds of hashes: no function may be called for each of them."""
    calls: list[str] = []

    def count(name: str) -> None:
        function = getattr(document, name)
        monkeypatch.setattr(document, name, lambda *given: calls.append(name) or function(*given))

    data = seal("thing", {"code": {f"module{number}": "0" * 64 for number in range(1000)}, "more": [{"a": [1, 2]}]})
    count("plain")
    count("laid_out")
    unseal("thing", data)
    assert {*calls} == {"laid_out"}  # what JSON says is plain: nothing goes through it again
    assert len(calls) < 30


def test_a_process_parses_the_same_bytes_once() -> None:
    parsed: list[bytes] = []
    documents = Documents(lambda data: parsed.append(data) or data.decode(), most=2)
    assert [documents.read(data) for data in (b"a", b"b", b"a")] == ["a", "b", "a"]
    assert parsed == [b"a", b"b"]
    assert documents.keep("c", b"c") == documents.read(b"c") == "c", "what was written is known"
    documents.read(b"a")
    assert parsed == [b"a", b"b", b"a"], "the one that was kept first has made way"
    documents.forget()
    documents.read(b"c")
    assert parsed[-1] == b"c"
