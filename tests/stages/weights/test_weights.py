import io
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load, save

from semidense.stages import weights
from semidense.stages.evaluation.evidence.features import NAMES
from semidense.stages.evaluation.evidence.foreign.declaration import FEATURES
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import count, to_vector
from semidense.stages.matching.declaration import Head
from semidense.stages.matching.descriptors.declaration import Width
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.net import MatchingNet
from semidense.stages.stage import StageError
from semidense.stages.weights import candidates, read_weights, save_weights
from tests.stages.matching.reference import NETS, random_net

VECTOR = to_vector(random_net())
LOSS = np.array([0.7, 0.25], np.float32)
FILE = save_weights("matching_net", {"parameters": VECTOR, "loss": LOSS}, {})


def changed(**tensors: torch.Tensor | None) -> bytes:
    """Return the file with tensors replaced, or left out."""
    state = {name: tensor for name, tensor in (load(FILE) | tensors).items() if tensor is not None}
    return save(state)


def bias(dtype: torch.dtype = torch.float32, value: float = 0.5) -> torch.Tensor:
    return torch.full((2,), value, dtype=dtype)


@pytest.mark.parametrize(("channels", "head"), NETS)
def test_the_round_trip_of_a_matching_net_is_exact(channels: int, head: Head) -> None:
    vector = to_vector(random_net(channels, head))
    again = read_weights("matching_net", save_weights("matching_net", {"parameters": vector, "loss": LOSS}, {}))
    assert all(array.dtype == np.float32 for array in again.values())
    assert np.array_equal(again["parameters"], vector) and np.array_equal(again["loss"], LOSS)


@pytest.mark.parametrize(("channels", "width"), [(1, 64), (2, 64), (3, 64), (3, 96)])
def test_the_round_trip_of_a_descriptor_net_is_exact(channels: int, width: Width) -> None:
    vector = np.random.default_rng(0).normal(size=count(DescriptorNet(channels, width))).astype(np.float32)
    data = save_weights("descriptor_net", {"parameters": vector, "loss": LOSS}, {})
    assert np.array_equal(read_weights("descriptor_net", data)["parameters"], vector)


def test_the_round_trip_of_an_evaluation_net_is_exact() -> None:
    vector = np.random.default_rng(0).normal(size=count(EvaluationNet())).astype(np.float32)
    data = save_weights("evaluation_net", {"parameters": vector, "loss": LOSS}, {})
    assert np.array_equal(read_weights("evaluation_net", data)["parameters"], vector)


def test_the_round_trip_of_an_evidence_net_is_exact() -> None:
    vector = np.random.default_rng(0).normal(size=count(EvidenceNet(len(NAMES)))).astype(np.float32)
    data = save_weights("evidence_net", {"parameters": vector, "loss": LOSS}, {})
    assert np.array_equal(read_weights("evidence_net", data)["parameters"], vector)


def test_the_round_trip_of_a_foreign_net_is_exact() -> None:
    vector = np.random.default_rng(0).normal(size=count(EvidenceNet(len(FEATURES)))).astype(np.float32)
    data = save_weights("foreign_net", {"parameters": vector, "loss": LOSS}, {})
    assert np.array_equal(read_weights("foreign_net", data)["parameters"], vector)


@pytest.mark.parametrize(("product", "networks"), [("matching_net", 6), ("descriptor_net", 12)])
def test_the_number_of_parameters_tells_the_network(product: str, networks: int) -> None:
    numbers = [count(net) for net in candidates(product)]
    assert len(set(numbers)) == len(numbers) == networks


def test_the_file_says_what_it_is_and_how_it_was_made(tmp_path: pytest.TempPathFactory) -> None:
    file = tmp_path / "net.safetensors"
    arrays = {"parameters": VECTOR, "loss": LOSS}
    file.write_bytes(save_weights("matching_net", arrays, {"params": {"steps": 3, "head": "compact"}}))
    with safe_open(file, "numpy") as opened:
        assert opened.metadata()["product"] == "matching_net"
        assert json.loads(opened.metadata()["params"]) == {"head": "compact", "steps": 3}
        assert set(opened.keys()) == {*MatchingNet().state_dict(), "loss"}


def test_the_same_weights_give_the_same_bytes() -> None:
    assert save_weights("matching_net", {"parameters": VECTOR, "loss": LOSS}, {}) == FILE


class Payload:
    """A pickle of it makes a file, if anything ever loads it."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (self.path, "w")


def test_a_payload_in_place_of_weights_never_runs(tmp_path: Path) -> None:
    marker = tmp_path / "it ran"
    file = io.BytesIO()
    torch.save(Payload(str(marker)), file)
    for data in (pickle.dumps(Payload(str(marker))), file.getvalue()):
        with pytest.raises(StageError, match="no safetensors file"):
            read_weights("matching_net", data)
    assert not marker.exists()
    pickle.loads(pickle.dumps(Payload(str(marker)))).close()
    assert marker.exists(), "it would have run"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        pytest.param(b"", "no safetensors file", id="empty"),
        pytest.param(pickle.dumps({"out.bias": [0.0]}), "no safetensors file", id="a pickle is never opened"),
        pytest.param(FILE[: len(FILE) // 2], "no safetensors file", id="truncated"),
        pytest.param(FILE[:4], "no safetensors file", id="not even a header"),
        pytest.param(FILE + b"\0", "no safetensors file", id="something behind it"),
        pytest.param(b"\xff" * 64, "no safetensors file", id="a header longer than the file"),
        pytest.param(
            (34).to_bytes(8, "little") + b'{"a\\nb":{"dtype":"X\\nY","shape":[',
            "no safetensors file",
            id="broken header",
        ),
        pytest.param(changed(**{"out.bias": torch.zeros(3)}), "other tensors .*or of other shapes", id="another shape"),
        pytest.param(changed(**{"out.bias": None}), "other tensors than its network", id="a tensor is missing"),
        pytest.param(changed(extra=bias()), "other tensors than its network", id="a tensor too many"),
        pytest.param(
            save({"a\nb\x1b[31m" * 40: bias()}), "other tensors than its network", id="a name made to confuse"
        ),
        pytest.param(save({}), "other tensors than its network", id="no tensor"),
        pytest.param(changed(**{"out.bias": bias(value=float("nan"))}), "must all be finite float32", id="NaN"),
        pytest.param(changed(**{"out.bias": bias(value=float("inf"))}), "must all be finite float32", id="infinity"),
        pytest.param(changed(**{"out.bias": bias(torch.float64)}), "must all be finite float32", id="float64"),
        pytest.param(changed(**{"out.bias": bias(torch.float16)}), "must all be finite float32", id="float16"),
        pytest.param(changed(**{"out.bias": bias(torch.int32)}), "must all be finite float32", id="integers"),
        pytest.param(changed(loss=None), "need the training's `loss`", id="no loss"),
        pytest.param(changed(loss=torch.zeros(1, 1)), "need the training's `loss`", id="a loss that is no curve"),
        pytest.param(changed(loss=bias(torch.float64)), "need the training's `loss`", id="a loss in float64"),
        pytest.param(changed(loss=bias(value=float("nan"))), "need the training's `loss`", id="a loss that is NaN"),
    ],
)
def test_refuses(data: bytes, message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        read_weights("matching_net", data)
    assert str(error.value).isprintable() and len(str(error.value)) < 250, "one clear line"


def test_refuses_the_weights_of_the_other_network() -> None:
    with pytest.raises(StageError, match="weights of evaluation_net have other tensors"):
        read_weights("evaluation_net", FILE)


def test_refuses_a_file_that_is_too_large_before_it_is_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weights, "LARGEST", len(FILE) - 1)
    monkeypatch.setattr(weights, "load_tensors", lambda _: pytest.fail("it was parsed"))
    with pytest.raises(StageError, match=f"have {len(FILE)} bytes, at most {len(FILE) - 1} are read"):
        read_weights("matching_net", FILE)


def test_the_largest_network_is_not_too_large() -> None:
    assert max(4 * count(net) for net in candidates("matching_net")) < weights.LARGEST / 2


@pytest.mark.parametrize("product", ["costvolume", "", "../matching_net"])
def test_other_products_are_no_networks(product: str) -> None:
    with pytest.raises(StageError, match="is no network"):
        read_weights(product, FILE)
    with pytest.raises(StageError, match="is no network"):
        save_weights(product, {"parameters": VECTOR, "loss": LOSS}, {})


@pytest.mark.parametrize(
    ("vector", "message"),
    [
        pytest.param(VECTOR[:-1], "no network has 500615 parameters", id="one too few"),
        pytest.param(np.full_like(VECTOR, np.nan), "not finite", id="NaN"),
    ],
)
def test_saving_refuses(vector: np.ndarray, message: str) -> None:
    with pytest.raises(StageError, match=message):
        save_weights("matching_net", {"parameters": vector, "loss": LOSS}, {})


@pytest.mark.parametrize("loss", [LOSS.astype(np.float64), LOSS[None], np.array([np.nan], np.float32)])
def test_a_loss_that_could_not_be_read_again_is_not_saved(loss: np.ndarray) -> None:
    with pytest.raises(StageError, match="need the training's `loss`"):
        save_weights("matching_net", {"parameters": VECTOR, "loss": loss}, {})
