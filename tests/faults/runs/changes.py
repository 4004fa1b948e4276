"""Rows 14, 15, 17, 18, 19, 23 and 24: what changes under a run's hands, what is not its own, and what records say."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from semidense.cache import CacheUnavailable, NonDeterministicStage, Recipe, Store
from semidense.cache.entries import publish
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.plan.errors import StageRefused
from tests.cache.keys.test_code import EDITING
from tests.faults import world
from tests.faults.inputs import CALIB
from tests.faults.tally import Tally
from tests.tiny import TEST_ONLY

ACTS = (
    ("import hash look", 0),
    ("import edit hash", 1),
    ("hash edit import look", 1),
    ("import edit hash hash", 2),
    ("edit hash import look", 0),
    ("import hash edit hash look", 0),
    ("hash import look edit look", 0),
    ("hash edit look", 0),
)
"""What happens to a module, in order, and how often a hash is to be refused."""
URLS = ("https://example.org/c", "file:///tmp/x", "HTTP://x", "ftp://a/b", "s3:/", "gs://", "abc+d:/x")


def scene_folder(folder: Path, calib: bytes = CALIB) -> Path:
    """Write a scene of 48 x 40 px in Middlebury's layout."""
    folder.mkdir(parents=True)
    chance = np.random.default_rng(0)
    for name in ("im0.png", "im1.png"):
        Image.fromarray(chance.integers(0, 255, (40, 48), np.uint8)).save(folder / name)
    (folder / "calib.txt").write_bytes(calib)
    return folder


def replaced_inputs(scale: float) -> Tally:
    """Replace an image at a step of the run, and put it back at its end."""
    tally = Tally()
    cases = [(name, step) for step in ("begun", "") for name in ("im0.png", "im1.png")]
    for name, step in cases[: max(2, int(len(cases) * scale))]:
        with world.folder() as root:
            task = Task(f"middlebury:{scene_folder(root.parent / 'scene')}", cache=root)
            file = root.parent / "scene" / name
            good = file.read_bytes()
            tally.injected += 1
            _run_with_replaced(tally, task, file, step, f"{name} at {step or 'the plan'}")
            file.write_bytes(good)
            if entries := list(Store(root).entries()):
                tally.fail("wrong", f"{name}: {entries[0].label} was published")
            made = api.run(task, "images")
            left = made.open("images")["left" if name == "im0.png" else "right"].values[..., 0]
            if not np.array_equal(left, np.asarray(Image.open(file))):
                tally.fail("wrong", f"{name}: other pixels under its key")
            for path in world.leftovers(Store(root)):
                tally.fail("leftovers", f"{name}: {path}")
    return tally


def _run_with_replaced(tally: Tally, task: Task, file: Path, step: str, where: str) -> None:
    def replace(*_: object) -> None:
        Image.fromarray(np.zeros((40, 48), np.uint8)).save(file)

    real, publish.STEP_HOOK = publish.STEP_HOOK, (lambda done: replace() if done == step else None)
    try:
        if step:
            api.run(task, "images")
        else:
            request = task.request("images")  # its scenes are listed; the keys are made of what is there then
            source = request.dataset.scenes[0]
            from dataclasses import replace as changed

            known = changed(source, digests=source.identity()["files"])
            replace()
            known.load_images()
        tally.fail("wrong", f"{where}: nothing was refused")
    except (StageRefused, ValueError) as error:
        if "changed since the run was planned" not in str(error) or "\n" in str(error):
            tally.fail("tracebacks", f"{where}: {error}")
    finally:
        publish.STEP_HOOK = real


def edited_modules(scale: float) -> Tally:
    """Edit a module before, between and after its import and its hash, each in a process of its own."""
    tally = Tally()
    for acts, refused in ACTS[: max(1, int(len(ACTS) * scale))]:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name, "edited")
            folder.mkdir()
            (folder / "__init__.py").write_text("")
            (folder / "stage.py").write_text("x = 1\n")
            command = [sys.executable, "-c", EDITING, name, acts]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        tally.injected += 1
        if done.stderr or done.stdout.count("restart Python") != refused or not done.stdout.endswith("end\n"):
            tally.fail("wrong", f"{acts}: {done.stdout} {done.stderr[-200:]}")
    return tally


def job_hold(root: Path, log: Path) -> None:
    """Hold a draft, as a run does, until killed."""
    world.quiet(log)
    store = Store(root)
    with store.lease() as lease:
        store.begin(_RECIPE, {}, lease)
        store.begin(_RECIPE, {})
        log.with_suffix(".ready").touch()
        time.sleep(world.HANGS)


_RECIPE = Recipe("square", code={"squares": "1f"}, params={"n": 3}, inputs={}, environment={})


def living_runs(scale: float) -> Tally:
    """Sweep and clean beside a run of which nothing but its held lock tells; and after its death."""
    tally = Tally()
    for number in range(max(2, int(10 * scale))):
        with world.folder() as root:
            log, store = root.parent / "log", Store(root)
            process = world.start(job_hold, root, log)
            while not log.with_suffix(".ready").exists():
                time.sleep(0.01)
            for clean in (store.sweep_drafts, lambda s=store: collect(s, survey(s, Limits(seconds=-1)).items)):
                tally.injected += 1
                clean()
                if len(list(store.layout.drafts.iterdir())) != 2:
                    tally.fail("lost", f"round {number}: a living run's draft was swept")
            process.kill()
            world.finish(process)
            store.sweep_drafts()
            for path in world.leftovers(store):
                tally.fail("leftovers", f"round {number}: {path}")
    return tally


def folders_of_others(scale: float) -> Tally:
    """Use a folder of somebody's files as a cache; and put files and links of one's own into a cache."""
    tally = Tally()
    for inside in ("notes.txt", "locks/key", "leases/x", "quarantine/x", "drafts/x", "checkpoints/x", "records/x"):
        with world.folder() as root:
            file = root / inside
            file.parent.mkdir(parents=True)
            file.write_text("kept")
            _refused(tally, inside, lambda r=root: world.run(Store(r), world.whole()))
            _refused(
                tally, f"{inside}, gc", lambda r=root: collect(Store(r), survey(Store(r), Limits(seconds=-1)).items)
            )
            _kept(tally, file, inside)
    for folder in ("locks", "leases", "quarantine", "drafts", "checkpoints"):
        with world.folder() as root:
            store = Store(root)
            world.run(store, world.whole())
            outside = root.parent / "outside"
            outside.mkdir()
            (outside / f"{'ab' * 32}-00ff00ff").write_text("kept")
            (root / folder / "mine").parent.mkdir(exist_ok=True)
            (root / folder / "mine").write_text("kept")
            (root / folder / "away").symlink_to(outside)
            tally.injected += 1
            world.run(store, world.whole())
            collect(store, survey(store, Limits(seconds=-1)).items)
            _kept(tally, root / folder / "mine", f"{folder}/mine")
            _kept(tally, outside / f"{'ab' * 32}-00ff00ff", f"{folder}/away")
    return tally


def _kept(tally: Tally, file: Path, where: str) -> None:
    if not file.is_file() or file.read_text() != "kept":
        tally.fail("lost", f"{where}: a file of the user's own")


def _refused(tally: Tally, where: str, work: Callable[[], object], words: str = "is not a cache") -> None:
    tally.injected += 1
    try:
        work()
        tally.fail("wrong", f"{where}: nothing was refused")
    except CacheUnavailable as error:
        if words not in str(error) or "\n" in str(error):
            tally.fail("tracebacks", f"{where}: {error}")


def urls(scale: float) -> Tally:
    """Name URLs as caches."""
    tally = Tally()
    for url in URLS:
        for work in (lambda u=url: api.open_store(u), lambda u=url: Store(Path(u))):
            _refused(tally, url, work, "is no place for a cache")
    return tally


def records_of_a_sweep(scale: float) -> Tally:
    """Sweep over R: each record must hold the configuration that made its own entry."""
    tally = Tally()
    thresholds = [0.2, 0.4, 0.6, 0.8, 0.123456789][: max(2, int(5 * scale))]
    with world.folder() as root:
        api.sweep(Task(TEST_ONLY, cache=root), thresholds)
        for entry in Store(root).entries():
            told = entry.extras["configuration"]
            if entry.recipe.stage == "semidense":
                tally.injected += 1
                if told["semidense"]["R"] != entry.recipe.params["R"] or entry.recipe.params["R"] not in thresholds:
                    tally.fail("wrong", f"{entry.recipe.params['R']}: its record says {told['semidense']['R']}")
            if entry.recipe.stage == "costvolume" and told["costvolume"]["d_max"] is None:
                tally.fail("wrong", "the record holds a setting that was not resolved")
    return tally


def other_cpus(scale: float) -> Tally:
    """Make a result again that rounds otherwise: on the same CPU, on another, and where the first does not say."""
    tally = Tally()
    for first, second, words in (
        ("A", "A", "find what its key lacks"),
        ("A", "B", "the first was made on A, the second on B, which may round otherwise"),
        (None, "B", "the first was made on an unknown CPU, the second on B"),
        ("A", None, "the first was made on A, the second on an unknown CPU"),
    ):
        with world.folder() as root:
            store = Store(root)
            _publish(store, 1.0, first)
            tally.injected += 1
            try:
                _publish(store, 1.0 + 2**-23, second)
                tally.fail("wrong", f"{first}, {second}: both were taken")
            except NonDeterministicStage as error:
                if words not in str(error):
                    tally.fail("tracebacks", f"{first}, {second}: {error}")
            for path in world.leftovers(store):
                tally.fail("leftovers", f"{first}, {second}: {path}")
    return tally


def _publish(store: Store, value: float, cpu: str | None) -> None:
    draft = store.begin(_RECIPE, {})
    draft.create_array("a", (1,), "float32", (1,), ("x",), {})
    draft.write("a", (slice(0, 1),), np.array([value], np.float32))
    draft.publish(1.0, {"cpu": cpu} if cpu else {})
