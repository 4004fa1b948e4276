"""Row 10: random sequences of run, sweep, damage, kill, clean and verify, against a model of what must hold."""

import logging
import os
import shutil
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from semidense.cache import Store
from semidense.cache.files import remove
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from semidense.cache.upkeep.verify import verify
from tests.faults import world
from tests.faults.damage import DAMAGE, SAME_SIZE, unlock
from tests.faults.tally import Tally

OFFSETS = st.sampled_from([(0,), (1,), (0, 1)])
ALL = (0, 1)
TRUTH = Tally()
"""What every example together has counted."""
_TEMPLATES: dict[str, Path] = {}


class CacheMachine(RuleBasedStateMachine):
    """A cache, and the keys that must be in it: what was made and neither damaged nor cleaned away since."""

    def __init__(self) -> None:
        super().__init__()
        self.place = world.folder()
        self.root = self.place.__enter__()
        self.store = Store(self.root)
        self.expected = world.truth(0, *ALL)
        self.there: set[str] = set()

    @initialize(filled=st.booleans())
    def begin(self, filled: bool) -> None:
        """Begin empty, or with what an undisturbed run made."""
        if filled:
            shutil.copytree(_template(), self.root, symlinks=True)
            self.there = {entry.key for entry in self.store.entries()}

    @rule(offsets=OFFSETS)
    def run(self, offsets: tuple[int, ...]) -> None:
        """Run, or sweep: what is there is reused, the rest made, all as undisturbed."""
        made = world.run(self.store, world.small(0, *offsets))
        for each in made.values():
            assert self.expected[each.key] == each.digest
            assert each.reused == (each.key in self.there), f"{each.step.name}: reused {each.reused}"
        self.there |= {each.key for each in made.values()}
        assert world.leftovers(self.store) == []

    # No precondition: what a kill leaves differs between repetitions, and Hypothesis must see the same rules in each.
    @rule(name=st.sampled_from(sorted({**DAMAGE, **SAME_SIZE})), number=st.integers(0, 99))
    def damage(self, name: str, number: int) -> None:
        """Damage an entry, if there is any: it is not taken for sound any more, and all others are."""
        if not self.there:
            return
        key = sorted(self.there)[number % len(self.there)]
        unlock(self.store, key)
        {**DAMAGE, **SAME_SIZE}[name](self.store.layout.entry(key), self.store.layout.record(key))
        TRUTH.injected += 1
        self.there.discard(key)
        assert self.store.check(key) is not None

    @rule(offsets=OFFSETS, step=st.integers(0, 45))
    def kill(self, offsets: tuple[int, ...], step: int) -> None:
        """Kill a run at a step; nothing that was there is lost, and what is new is whole."""
        options = {"make": world.small, "die_at": step}
        code = world.in_child(world.job_run, self.root, self.root.parent / "log", (0, *offsets), **options)
        TRUTH.injected += 1
        assert code in (0, -9), world.said(self.root.parent / "log")
        self.look()
        self.there = set(world.sound(self.store))

    @rule(entries=st.booleans(), number=st.integers(0, 99))
    def clean(self, entries: bool, number: int) -> None:
        """Clean up leftovers, and entries but for one that is in use."""
        used = sorted(self.there)[number % len(self.there)] if self.there else None
        with self.store.lease() as lease:
            lease.add([used] if used else [])
            found = survey(self.store, Limits(seconds=-1.0 if entries else None))
            collect(self.store, found.items)
        if entries:
            self.there &= {used} if used else set()
        assert [item for item in survey(self.store, Limits()).items if item.kind != "damaged record"] == []

    @rule()
    def verify(self) -> None:
        """Verify: exactly what is there is sound."""
        assert set(verify(self.store).sound) == self.there

    @rule()
    def look(self) -> None:
        """Look at everything: what must be there is, and all of it is right."""
        found = world.sound(self.store)
        assert self.there <= set(found)
        for key in found:
            entry = self.store.find(key)
            assert entry
            assert entry.digest == self.expected[key]

    def teardown(self) -> None:
        """Recover once more, and throw the cache away."""
        tally = Tally()
        world.recover(tally, self.store, world.small(0, *ALL), self.expected, "at the end")
        self.place.__exit__(None, None, None)
        assert tally.clean, tally.notes


def _template() -> Path:
    if "full" not in _TEMPLATES:
        root = Path(tempfile.mkdtemp(prefix="faults-template-")) / "cache"
        world.run(Store(root), world.small(0, *ALL))
        _TEMPLATES["full"] = root
    return _TEMPLATES["full"]


def random_sequences(scale: float) -> Tally:
    """Play random sequences, the large form in several processes; one that goes wrong is shrunk to the shortest."""
    examples = max(5, int(1000 * scale))
    tally = Tally(figures={"examples": examples})
    for injected, notes in _played(examples, scale):
        tally.injected += injected
        for note in notes:
            tally.fail("wrong", note)
    return tally


def _played(examples: int, scale: float) -> list[tuple[int, list[str]]]:
    """Return what ``_play`` does, one result a process."""
    processes = min(2 * (os.cpu_count() or 1), 8) if scale >= 1 else 1  # half of them wait for one to be killed
    if processes == 1:
        return [_play(examples, scale)]
    shares = [examples // processes + (number < examples % processes) for number in range(processes)]
    with ProcessPoolExecutor(processes, mp_context=world.context()) as pool:
        return list(pool.map(_play, shares, [scale] * processes))


def _play(examples: int, scale: float) -> tuple[int, list[str]]:
    """Play so many examples; return how many faults they injected, and what went wrong."""
    logging.getLogger("semidense.cache").setLevel(logging.ERROR)  # in a process of its own too
    TRUTH.__init__()  # type: ignore[misc]
    notes: list[str] = []
    try:
        run_state_machine_as_test(
            CacheMachine,
            settings=settings(
                max_examples=examples,
                stateful_step_count=20 if scale >= 0.2 else 10,
                deadline=None,
                derandomize=scale < 1,
                phases=[Phase.generate] if scale < 1 else [Phase.generate, Phase.shrink],
                suppress_health_check=list(HealthCheck),
                print_blob=True,
                database=None,
            ),
        )
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        notes.append(f"{error!r} {getattr(error, '__notes__', '')}")
    finally:
        if template := _TEMPLATES.pop("full", None):
            remove(template.parent)
    return TRUTH.injected, notes
