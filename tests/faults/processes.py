"""Rows 1 to 5 and 8: kills, signals, failing stages, full and forbidden disks, and many processes at once."""

import os
import random
import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

from semidense.cache import Store
from semidense.cache.entries import publish
from semidense.pipeline.plan.errors import StageFailed
from semidense.stages.stage import Stage
from tests.faults import world
from tests.faults.tally import Tally
from tests.pipeline import toy
from tests.tiny import TEST_ONLY


def kill_at_steps(scale: float) -> Tally:
    """Kill a run at every step of the publishing protocol, for products of every kind."""
    tally, steps = Tally(), world.count_steps()
    chosen = range(steps) if scale >= 1 else sorted(random.Random(1).sample(range(steps), max(1, int(steps * scale))))
    for number in chosen:
        _killed(tally, f"step {number} of {steps}", die_at=number)
    tally.figures["steps"] = steps
    return tally


def kill_at_random(scale: float) -> Tally:
    """Kill a run, and one of the real pipeline, at a random time of those that an undisturbed one takes."""
    tally, chance = Tally(), random.Random(2)
    longest = _seconds_of_a_run()
    for number in range(max(2, int(25 * scale))):
        _killed(tally, f"trial {number}", chance.uniform(0, longest), pause=0.01, workers=1 + number % 2)
    for number in range(int(5 * scale) if scale >= 1 else 0):
        _killed_pipeline(tally, f"pipeline {number}", chance.random())
    return tally


def _seconds_of_a_run() -> float:
    """Return what an undisturbed run takes here and now; the first one of all also starts the server of processes."""
    for _ in range(2):
        started = time.monotonic()
        with world.folder() as root:
            world.in_child(world.job_run, root, root.parent / "log", pause=0.01)
    return time.monotonic() - started


def _killed(tally: Tally, where: str, after: float | None = None, **options: Any) -> None:  # noqa: ANN401
    with world.folder() as root:
        process = world.start(world.job_run, root, root.parent / "log", **options)
        if after is not None:
            time.sleep(after)
            process.kill()
        world.finish(process)
        tally.injected += 1
        world.recover(tally, Store(root), world.whole(), world.truth(), where)


def job_pipeline(root: Path, log: Path, number: int | None = None, step: int = 0) -> None:
    """Run the real pipeline through its entry point; send this process a signal at a step."""
    import sys

    world.quiet(log)
    import torch

    from semidense.pipeline.cli.main import main

    torch.set_num_threads(1)  # on a busy machine, threads of one product would mostly wait for one another
    seen: list[str] = []

    def hook(name: str) -> None:
        seen.append(name)
        if number is not None and len(seen) == step:
            os.kill(os.getpid(), number)
            time.sleep(0.2)

    publish.STEP_HOOK = hook
    sys.argv = ["pipeline", "run", TEST_ONLY, "--cache", str(root)]
    try:
        main()
    except SystemExit as stop:
        os._exit(int(stop.code or 0))
    except BaseException:  # noqa: BLE001
        import traceback

        traceback.print_exc()
        os._exit(world.OTHER_ERROR)


def _killed_pipeline(tally: Tally, where: str, part: float) -> None:
    """Kill the real pipeline when a part of the time is over that an undisturbed run took."""
    expected = _pipeline_truth()
    with world.folder() as root:
        process = world.start(job_pipeline, root, root.parent / "log")
        time.sleep(part * _SECONDS[0])
        process.kill()
        world.finish(process)
        tally.injected += 1
        _recover_pipeline(tally, root, expected, where)


def _recover_pipeline(tally: Tally, root: Path, expected: dict[str, str], where: str) -> None:
    store, log = Store(root), root.parent / "log"
    before = world.sound(store)
    world.judge(tally, store, expected, where)
    if (code := world.in_child(job_pipeline, root, log)) != 0:
        tally.fail("tracebacks", f"{where}: rerun: exit {code}: {world.said(log)}")
    if {entry.key: entry.digest for entry in store.entries()} != expected:
        tally.fail("wrong", f"{where}: the rerun's digests differ")
    if any(world.sound(store).get(key) != inode for key, inode in before.items()):
        tally.fail("lost", f"{where}: a sound product was made again")
    for path in world.leftovers(store):
        tally.fail("leftovers", f"{where}: {path}")


_TRUTH: dict[str, str] = {}
_SECONDS: list[float] = []
"""What the undisturbed run of the pipeline took."""


def _pipeline_truth() -> dict[str, str]:
    if not _TRUTH:
        with world.folder() as root:
            log, started = root.parent / "log", time.monotonic()
            if (code := world.in_child(job_pipeline, root, log)) != 0:
                raise RuntimeError(f"an undisturbed run failed: exit {code}: {world.said(log)}")
            _SECONDS[:] = [time.monotonic() - started]
            _TRUTH.update({entry.key: entry.digest for entry in Store(root).entries()})
    return _TRUTH


def signals(scale: float) -> Tally:
    """Interrupt and terminate a run of the command line in the middle of a stage."""
    tally = Tally()
    trials = [(number, step) for step in (3, 20, 45) for number in (signal.SIGINT, signal.SIGTERM)]
    for number, step in trials[: max(1, int(len(trials) * scale))]:
        expected, where = _pipeline_truth(), f"{signal.Signals(number).name} at step {step}"
        with world.folder() as root:
            log = root.parent / "log"
            code = world.in_child(job_pipeline, root, log, int(number), step)
            tally.injected += 1
            if code != 128 + number or "Traceback" in world.said(log, 10**6):
                tally.fail("tracebacks", f"{where}: exit {code}: {world.said(log)}")
            if left := list(Store(root).layout.drafts.iterdir()):
                tally.fail("leftovers", f"{where}: {left[0].name}")
            _recover_pipeline(tally, root, expected, where)
    return tally


def failing_stages(scale: float) -> Tally:
    """Let a stage raise in one of its tiles, with one thread and with several."""
    from dataclasses import replace

    tally = Tally()
    for workers in (1, 2, 3, 4)[: max(2, int(4 * scale))]:
        broken: Stage = replace(toy.BLURRED, compute="tests.pipeline.toy:fail_below")
        with world.folder() as root:
            store = Store(root)
            tally.injected += 1
            try:
                world.run(store, toy.chain(stage=broken), workers)
                tally.fail("wrong", f"{workers} threads: nothing was raised")
            except StageFailed as error:
                if not str(error).startswith("blurred of Toy, rows ") or "fourth row" not in str(error):
                    tally.fail("tracebacks", f"{workers} threads: {error}")
            for path in world.leftovers(store):
                tally.fail("leftovers", f"{workers} threads: {path}")
            if [entry.label["product"] for entry in store.entries()] != ["ramp"]:
                tally.fail("lost", f"{workers} threads: the ramp")
            world.recover(tally, store, world.whole(), world.truth(), f"{workers} threads")
    return tally


def bad_disks(scale: float) -> Tally:
    """Fill the disk at every step, limit the size of files, and take away permissions."""
    tally, steps = Tally(), world.count_steps()
    stride = 1 if scale >= 1 else max(1, int(1 / scale) * 3)
    for number in range(0, steps, stride):
        _refused(tally, f"disk full at step {number}", may_succeed=True, raise_at=number)
    for limit in [0, 100, 300, 600, 1000, 2000, 3000, 5000][:: 1 if scale >= 1 else 4]:
        _refused(tally, f"files of at most {limit} bytes", may_succeed=limit >= 600, largest_file=limit)
    for mode in (0o555, 0o000, 0o444):
        _refused(tally, f"cache with mode {mode:o}", mode=mode, user=65534)
    return tally


def _refused(
    tally: Tally,
    where: str,
    mode: int | None = None,
    may_succeed: bool = False,
    **options: Any,  # noqa: ANN401
) -> None:
    """Run on a bad disk: one line for the user; and well again on a good one."""
    with world.folder() as root:
        store, log = Store(root), root.parent / "log"
        if mode is not None:
            store.layout.create()
            for path in (*root.iterdir(), root):
                path.chmod(mode if path.is_dir() else 0o444)
        code = world.in_child(world.job_run, root, log, **options)
        tally.injected += 1
        if code not in ((0, world.USER_ERROR) if may_succeed else (world.USER_ERROR,)):
            tally.fail("tracebacks", f"{where}: exit {code}: {world.said(log)}")
        if mode is not None:
            for path in (root, *root.iterdir()):
                path.chmod(0o755)
        world.recover(tally, store, world.whole(), world.truth(), where)


def crowds(scale: float) -> Tally:
    """Let many processes work on one cache: the same keys, overlapping sweeps, cleaning and verifying."""
    tally, chance = Tally(), random.Random(8)
    made = Counter[str]()
    runs = 0
    for number in range(max(2, int(13 * scale))):
        with world.folder() as root:
            crowd = 8 if scale >= 1 else 4
            offsets = [(0, *sorted(chance.sample(range(3), 2))) for _ in range(crowd)]
            runs += crowd
            _crowd(tally, f"round {number}", root, offsets, cleaning=number % 2 == 1)
            if number % 2 == 0:
                made.update(_made_twice(root))
    tally.figures.update({"runs": runs, "made twice": made.total()})
    return tally


def _crowd(tally: Tally, where: str, root: Path, graphs: list[tuple[int, ...]], *, cleaning: bool) -> None:
    """Start everybody at once; all end well, and what is there is right."""
    logs = root.parent
    everybody = [
        world.start(world.job_run, root, logs / f"{number}", graph, pause=0.002, workers=1 + number % 3)
        for number, graph in enumerate(graphs)
    ]
    for number in range(3):
        everybody.append(world.start(world.job_verify, root, logs / f"verify{number}"))
        everybody.append(world.start(world.job_gc, root, logs / f"gc{number}", 0.0 if cleaning else None))
    names = [*map(str, range(len(graphs))), "verify0", "gc0", "verify1", "gc1", "verify2", "gc2"]
    for name, process in zip(names, everybody, strict=True):
        tally.injected += 1
        if (code := world.finish(process)) != 0:
            tally.fail("tracebacks" if code != world.USER_ERROR else "lost", f"{where}, {name}: exit {code}: "
                       f"{world.said(logs / name)}")  # fmt: skip
    store, everything = Store(root), world.whole(0, 0, 1, 2)
    world.recover(tally, store, everything, world.truth(0, 0, 1, 2), where)


def _made_twice(root: Path) -> Counter[str]:
    """Count how often the crowd made a product that one of it had made before; tiles count once a product."""
    lines = Counter(line for log in root.parent.glob("*.made") for line in log.read_text().split())
    once = {"ramp": 1, "blurred": 9, "sum": 3}
    return Counter({name: max(0, lines[name] - most) for name, most in once.items()})
