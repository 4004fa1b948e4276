import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from semidense.stages.learning import training
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.schedule import SHARDS, Schedule
from semidense.stages.learning.training import balanced_cross_entropy, fit
from semidense.stages.stage import Silent, StageError
from tests.stages.monitors import InterruptedTrainingError, Memory

LN2 = float(np.log(2))


class Toy(nn.Module):
    """Tells points inside a circle from those outside; large enough that torch would share its sums between cores."""

    def __init__(self, width: int = 256) -> None:
        super().__init__()
        self.hidden = nn.Linear(2, width)
        self.middle = nn.Linear(width, width)
        self.out = nn.Linear(width, 2)
        initialise(self, 0)

    def forward(self, points: Tensor) -> Tensor:
        logits: Tensor = self.out(torch.relu(self.middle(torch.relu(self.hidden(points)))))
        return logits


def toy_loss(net: nn.Module) -> Callable[[int, int], Tensor]:
    def loss(step: int, shard: int) -> Tensor:
        points = np.random.default_rng((step, shard)).normal(size=(64, 2)).astype(np.float32)
        labels = torch.from_numpy((np.hypot(*points.T) < 1).astype(np.int64))
        return balanced_cross_entropy(net(torch.from_numpy(points)).T, labels)

    return loss


def trained(schedule: Schedule, monitor: Memory | Silent | None = None) -> tuple[np.ndarray, np.ndarray]:
    net = Toy()
    curve = fit(net, toy_loss(net), schedule, monitor or Silent())
    return to_vector(net), curve


def equal(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        pytest.param([0, 1], LN2, id="as many of each"),
        pytest.param([0, 0, 0, 1], LN2, id="more of one: the same weight"),
        pytest.param([0, 1, -1, -1], LN2, id="what teaches nothing does not count"),
        pytest.param([0, 0], LN2 / 2, id="a class without samples adds nothing"),
        pytest.param([-1, -1], 0.0, id="nothing to learn"),
    ],
)
def test_the_loss_of_equal_logits_by_hand(labels: list[int], expected: float) -> None:
    made = balanced_cross_entropy(torch.zeros(2, len(labels)), torch.tensor(labels))
    assert made.item() == pytest.approx(expected)


def test_the_loss_is_the_mean_of_the_classes_means() -> None:
    logits = torch.tensor([[0.0, 0.0, 0.0], [3.0, 1.0, 2.0]], dtype=torch.bfloat16)
    of_class_0 = (np.log1p(np.exp(3)) + np.log1p(np.exp(1))) / 2
    made = balanced_cross_entropy(logits, torch.tensor([0, 0, 1]))
    assert made.dtype == torch.float32
    assert made.item() == pytest.approx((of_class_0 + np.log1p(np.exp(-2))) / 2)


@pytest.mark.parametrize("optimiser", ["muon", "adam"])
def test_the_loss_falls(optimiser: str) -> None:
    _, curve = trained(Schedule(steps=30, optimiser=optimiser, peak_rate=0.02, last_rate=0.002))
    assert curve.dtype == np.float32 and curve.shape == (30,)
    assert curve[0] == pytest.approx(LN2, abs=0.1)
    assert curve[-10:].mean() < 0.85 * curve[0]


class _OneByOne:
    """An executor that runs the shards one after another, the last one first."""

    def __init__(self, workers: int, initializer: Callable[[], None]) -> None:
        initializer()

    def __enter__(self) -> "_OneByOne":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def map(self, function: Callable[[int], object], shards: Iterable[int]) -> Iterator[object]:
        done = {shard: function(shard) for shard in reversed(list(shards))}
        return iter([done[shard] for shard in range(SHARDS)])

    def submit(self, function: Callable[..., object], *given: object) -> Future[object]:
        done: Future[object] = Future()
        done.set_result(function(*given))
        return done


def test_the_order_in_which_shards_end_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = trained(Schedule(steps=12))
    monkeypatch.setattr(training, "ThreadPoolExecutor", _OneByOne)
    assert equal(trained(Schedule(steps=12)), expected)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_the_number_of_workers_does_not_matter(workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = trained(Schedule(steps=12))
    monkeypatch.setattr(
        training, "ThreadPoolExecutor", lambda _, initializer: ThreadPoolExecutor(workers, "", initializer)
    )
    assert equal(trained(Schedule(steps=12)), expected)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_number_of_torchs_threads_does_not_matter(threads: int) -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        expected = trained(Schedule(steps=12, clip=0.01))
        torch.set_num_threads(threads)
        assert equal(trained(Schedule(steps=12, clip=0.01)), expected)
    finally:
        torch.set_num_threads(before)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system cannot hold a process to one core")
def test_the_number_of_cores_does_not_matter() -> None:
    cores = os.sched_getaffinity(0)
    expected = trained(Schedule(steps=12))
    try:
        os.sched_setaffinity(0, {min(cores)})
        assert equal(trained(Schedule(steps=12)), expected)
    finally:
        os.sched_setaffinity(0, cores)


@pytest.mark.parametrize(
    ("killed", "resumed"),
    [
        pytest.param(3, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12], id="before the first checkpoint: from the start"),
        pytest.param(5, [5, 6, 7, 8, 9, 10, 11, 12], id="just after it"),
        pytest.param(12, [9, 10, 11, 12], id="at the last step"),
    ],
)
def test_a_killed_training_resumes_and_ends_as_an_undisturbed_one(killed: int, resumed: list[int]) -> None:
    schedule = Schedule(steps=12, checkpoint_steps=4)
    expected = trained(schedule)
    memory = Memory(stop_after=killed)
    with pytest.raises(InterruptedTrainingError):
        trained(schedule, memory)
    again = Memory(states=memory.states)
    assert equal(trained(schedule, again), expected)
    assert again.steps == resumed


def test_a_finished_training_is_not_done_again() -> None:
    schedule = Schedule(steps=8, checkpoint_steps=4)
    memory = Memory()
    expected = trained(schedule, memory)
    again = Memory(states=memory.states)
    assert equal(trained(schedule, again), expected)
    assert again.steps == []


def test_reports_every_step_and_saves_every_so_many() -> None:
    memory = Memory()
    trained(Schedule(steps=7, checkpoint_steps=3), memory)
    assert memory.steps == [1, 2, 3, 4, 5, 6, 7] and memory.totals == {7}
    assert len(memory.states) == 2
    assert all(note.startswith("loss 0.") for note in memory.notes)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_loss_that_is_not_finite_is_refused(value: float) -> None:
    net = Toy(8)
    losses = toy_loss(net)

    def loss(step: int, shard: int) -> Tensor:
        return losses(step, shard) * (value if (step, shard) == (2, 1) else 1.0)

    with pytest.raises(StageError, match=f"the loss is {value} at step 2: lower the learning rate") as error:
        fit(net, loss, Schedule(steps=5), Silent())
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("optimiser", ["muon", "adam"])
def test_a_gradient_that_is_not_finite_is_refused(optimiser: str) -> None:
    net = Toy()

    def loss(step: int, shard: int) -> Tensor:
        return net.middle.weight.sum().mul(0).sqrt()  # 0, with a slope that is not a number

    with pytest.raises(StageError, match="the gradient's norm is nan") as error:
        fit(
            net,
            lambda step, shard: loss(step, shard) + toy_loss(net)(step, shard),
            Schedule(steps=2, optimiser=optimiser),
            Silent(),
        )
    assert "\n" not in str(error.value)


def test_the_gradient_of_a_step_is_the_mean_of_its_shards() -> None:
    net = Toy(8)
    parts = [torch.autograd.grad(toy_loss(net)(0, shard), list(net.parameters())) for shard in range(SHARDS)]
    fit(net, toy_loss(net), Schedule(steps=1, clip=1e9), Silent())
    for parameter, *gradients in zip(net.parameters(), *parts, strict=True):
        assert torch.allclose(parameter.grad, sum(gradients) / SHARDS, rtol=1e-5, atol=1e-7)


def test_a_steps_gradient_is_clipped() -> None:
    net = Toy(8)
    losses = toy_loss(net)
    fit(net, lambda step, shard: 1000 * losses(step, shard), Schedule(steps=1, clip=0.5), Silent())
    norm = torch.linalg.vector_norm(torch.cat([parameter.grad.flatten() for parameter in net.parameters()]))
    assert norm.item() == pytest.approx(0.5, rel=1e-3)


def test_the_first_step_has_the_first_rate() -> None:
    """Adam's first step moves every parameter by the learning rate, whatever its gradient."""
    before = to_vector(Toy())
    after, _ = trained(Schedule(steps=1, optimiser="adam", peak_rate=0.01))
    moved = np.abs(after - before)
    assert np.median(moved[moved > 0]) == pytest.approx(0.01, rel=1e-2)
