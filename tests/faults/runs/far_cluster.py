"""Row 29: a cluster of four workers over an object store: workers are killed while requests go wrong."""

import random
import time
from collections.abc import Mapping
from dataclasses import replace

from semidense.cache import Store
from semidense.cache.upkeep.verify import size
from tests.faults import world
from tests.faults.runs import bucket
from tests.faults.runs.work import Scenes, Work, of_scale
from tests.faults.runs.workers import Killer, cluster
from tests.faults.tally import Tally
from tests.s3 import Faults, fresh_url, pointed_at, proxy


def killed_workers(scale: float) -> Tally:
    """Run eight scenes on four workers, kill some of them and spoil requests; digests are those of threads."""
    tally, chance, faults = Tally(), random.Random(29), Faults(rate=0.04, slow=0.2)
    slowest, kills = 0.0, 0
    with (
        of_scale(scale, 2) as work,
        bucket.opened() as port,
        proxy(port, faults) as spoilt,
        pointed_at(spoilt),
        cluster(4) as address,
    ):
        real = isinstance(work, Scenes)
        if real:
            paper = replace(work, preset="paper")
            _run(tally, paper, address, _on_threads(paper), "paper")
        expected = _on_threads(work)
        undisturbed = _run(tally, work, address, expected, "no kill") if scale >= 1 else 3.0
        while kills < max(1, int(20 * scale)) or (scale >= 1 and faults.injected.total() < 200):
            at_once = 4 if real else 2
            killer = Killer(address, chance, undisturbed, at_once)
            kills += at_once
            slowest = max(slowest, _run(tally, work, address, expected, f"up to kill {kills}"))
            killer.join()
        tally.figures |= {"workers killed": kills, "requests spoilt": faults.injected.total()}
        if scale >= 1:
            tally.figures["slowest run in ones without kills"] = round(slowest / undisturbed, 1)
        tally.figures[work.name] = work.scenes
    tally.injected = kills + faults.injected.total()
    return tally


def _on_threads(work: Work) -> dict[str, str]:
    """Return the digests of a run on threads in a folder."""
    with world.folder() as root:
        return work.run(Store(root))


def _run(tally: Tally, work: Work, address: str, expected: Mapping[str, str], where: str) -> float:
    """Run in a new cache, and look at what is there; return the seconds that the run took."""
    store, started = Store(fresh_url()), time.monotonic()
    try:
        made = work.run(store, address)
    except Exception as error:  # noqa: BLE001 - whatever it is, the run must not fail
        tally.fail("lost", f"{where}: {error!r}")
        return time.monotonic() - started
    seconds = time.monotonic() - started
    if made != expected:
        tally.fail("wrong", f"{where}: other digests")
    bucket.judged(tally, store, expected, where)
    sizes = size(store)
    if sizes.drafts or sizes.orphans or sizes.quarantine:
        tally.fail("leftovers", f"{where}: {sizes}")
    return seconds
