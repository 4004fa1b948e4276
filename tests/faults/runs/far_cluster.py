"""Row 29: a cluster of four workers over an object store: workers are killed while requests go wrong."""

import random
import time
from collections.abc import Mapping

from semidense.cache import Store
from semidense.cache.upkeep.verify import size
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from tests.faults import world
from tests.faults.runs import bucket, slow
from tests.faults.runs.workers import Killer, cluster
from tests.faults.tally import Tally
from tests.s3 import Faults, fresh_url, pointed_at, proxy

KILLS, SCENES = 2, 8
"""Workers that are killed in one run, and its scenes."""


def killed_workers(scale: float) -> Tally:
    """Run eight scenes on four workers, kill two of them and spoil requests; digests are those of a folder."""
    tally, chance, faults = Tally(), random.Random(29), Faults(rate=0.04, slow=0.2)
    graph = slow.scenes(SCENES if scale >= 1 else 2)
    with world.folder() as root:
        expected = {each.key: each.digest for each in world.run(Store(root), graph, workers=16).values()}
    slowest, kills = 0.0, 0
    with bucket.opened() as port, proxy(port, faults) as spoilt, pointed_at(spoilt), cluster(4) as address:
        undisturbed = _run(tally, Store(fresh_url()), address, expected, "no kill") if scale >= 1 else 3.0
        while kills < max(1, int(20 * scale)) or (scale >= 1 and faults.injected.total() < 200):
            killers = [
                Killer(address, chance.uniform(0, undisturbed), which) for which in chance.sample(range(4), KILLS)
            ]
            kills += len(killers)
            slowest = max(slowest, _run(tally, Store(fresh_url()), address, expected, f"up to kill {kills}"))
            for each in killers:
                each.join()
    tally.injected = kills + faults.injected.total()
    tally.figures |= {"workers killed": kills, "requests spoilt": faults.injected.total()}
    if scale >= 1:
        tally.figures["slowest run in ones without kills"] = round(slowest / undisturbed, 1)
    return tally


def _run(tally: Tally, store: Store, address: str, expected: Mapping[str, str], where: str) -> float:
    """Run, and look at what is there; return the seconds that the run took."""
    started, graph = time.monotonic(), slow.scenes(len(expected) // 3)
    try:
        made = attempt(lambda: world.plan(store, graph), store, Unwatched(), {}, address)[1]
    except Exception as error:  # noqa: BLE001 - whatever it is, the run must not fail
        tally.fail("lost", f"{where}: {error!r}")
        return time.monotonic() - started
    seconds = time.monotonic() - started
    if {each.key: each.digest for each in made.values()} != expected:
        tally.fail("wrong", f"{where}: other digests")
    bucket.judged(tally, store, expected, where)
    sizes = size(store)
    if sizes.drafts or sizes.orphans or sizes.quarantine:
        tally.fail("leftovers", f"{where}: {sizes}")
    return seconds
