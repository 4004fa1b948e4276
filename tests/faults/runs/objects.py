"""Rows 25 to 28: kills, damage, crowds and bad stores for a cache in an object store, on a real S3 server."""

import random
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from semidense.cache import CacheUnavailable, Store
from semidense.cache.document import seal, unseal
from semidense.cache.objects import names, records, requests
from semidense.cache.objects.requests import connect
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from semidense.cache.upkeep.verify import verify
from tests.faults import world
from tests.faults.runs import bucket
from tests.faults.tally import Tally
from tests.s3 import BUCKET, Faults, fresh_url, pointed_at, proxy


def killed_at_steps(scale: float) -> Tally:
    """Kill a run before and after each request that changes something."""
    tally = Tally()
    with bucket.opened():
        steps = bucket.count_steps()
        every = range(steps)
        for number in every if scale >= 1 else random.Random(25).sample(every, max(2, int(steps * scale))):
            url, where = fresh_url(), f"step {number} of {steps}"
            with world.folder() as folder:
                world.in_child(bucket.job_run, url, bucket.environment(), folder.with_name("log"), die_at=number)
            tally.injected += 1
            bucket.recover(tally, Store(url), world.truth(), where)
    tally.figures["steps"] = steps
    return tally


def damaged_objects(scale: float) -> Tally:
    """Flip bits, and truncate, empty, delete, swap and extend each object of each entry; edit and copy records."""
    tally, chance = Tally(), random.Random(26)
    with bucket.nothing_kept():
        store = Store("memory://damaged")
        made = world.run(store, world.whole())
        keys = [each.key for each in made.values()]
        _flip(tally, store, keys[-1], chance, 10**6 if scale >= 1 else 30)
        for key in keys if scale >= 1 else keys[2:3]:
            for number in range(len(paths_of(store, key))):
                _damage_one(tally, store, key, number, scale, chance)
        for name, edit in _EDITS.items():
            path = names.record(keys[1])
            _replace(store, path, edit(_read(store, path), _read(store, names.record(keys[0]))))
            tally.injected += 1
            bucket.recover(tally, store, world.truth(), name)
        _extra_objects(tally, store)
    return tally


def paths_of(store: Store, key: str) -> list[str]:
    """Return the paths of all objects of an entry, in order; they are others when it is made again."""
    objects = connect(str(store.root))
    place = records.read(objects, key).place
    return [*(each.path for each in objects.below(f"data/{place}")), names.record(key)]


def _read(store: Store, path: str) -> bytes:
    found = connect(str(store.root)).get(path)
    return found.data if found else b""


def _replace(store: Store, path: str, data: bytes | None) -> None:
    """Change an object behind the cache's back; None deletes it."""
    objects = connect(str(store.root))
    objects.delete([path]) if data is None else objects.put(path, data)


def _flip(tally: Tally, store: Store, key: str, chance: random.Random, most: int) -> None:
    """Flip bits of all objects of an entry: each is noticed."""
    paths = paths_of(store, key)
    offsets = [(path, at) for path in paths for at in range(len(_read(store, path)))]
    for path, at in chance.sample(offsets, min(most, len(offsets))):
        good = _read(store, path)
        _replace(store, path, good[:at] + bytes([good[at] ^ 1 << at % 8]) + good[at + 1 :])
        tally.injected += 1
        if key in verify(store, [key]).sound:
            tally.fail("wrong", f"{path} at {at} is taken for sound")
        _replace(store, path, good)
    if key not in verify(store, [key]).sound:
        tally.fail("lost", f"{key}: whole again, and not taken for sound")


_CHANGES: dict[str, Callable[[bytes], bytes | None]] = {
    "deleted": lambda _: None,
    "emptied": lambda _: b"",
    "truncated": lambda data: data[: len(data) // 2],
    "zeroed": lambda data: bytes(len(data)),
    "extended": lambda data: data + b"\n",
    "given up": lambda _: b"given up\n",
}


def _damage_one(tally: Tally, store: Store, key: str, number: int, scale: float, chance: random.Random) -> None:
    """Damage one object of an entry in each way, and swap it with the one before it; in the quick form in one way."""
    changes = list(_CHANGES.items()) if scale >= 1 else [chance.choice(list(_CHANGES.items()))]
    for name, change in changes:
        path = paths_of(store, key)[number]
        _replace(store, path, change(_read(store, path)))
        tally.injected += 1
        bucket.recover(tally, store, world.truth(), f"{name} {path}")
    one, other = (paths_of(store, key)[each] for each in (number, number - 1))
    first, second = _read(store, one), _read(store, other)
    if first != second:
        _replace(store, one, second)
        _replace(store, other, first)
        tally.injected += 1
        bucket.recover(tally, store, world.truth(), f"{one} and {other} swapped")


def _placed(data: bytes, **changes: object) -> bytes:
    return seal("placed entry", {**unseal("placed entry", data), **changes})


_EDITS: dict[str, Callable[[bytes, bytes], bytes]] = {
    "another label": lambda mine, _: mine.replace(b"toys", b"toyz"),
    "a newer format": lambda mine, _: mine.replace(b'mat\\": 1', b'mat\\": 2').replace(b'mat": 1', b'mat": 2'),
    "another entry's record": lambda _, other: other,
    "another entry's place": lambda mine, other: _placed(mine, place=unseal("placed entry", other)["place"]),
    "no place": lambda mine, _: _placed(mine, place="../secret"),
    "a place where nothing is": lambda mine, _: _placed(mine, place=f"{'0' * 32}/{'0' * 64}"),
    "no record inside": lambda mine, _: _placed(mine, record=1),
    "a mark of a damaged entry": lambda *_: records.Aside("", "so they say").to_bytes(),
    "nested brackets": lambda *_: b"[" * 100_000,
}
"""What is written in place of a record, from it and another entry's."""


EXTRA = (
    *("notes", "records/zz/notes.json", "records/notes", "leases/x", "leases/x/keys/y", "claims/x"),
    *("drafts/x", "data/x", "data/x/y/z", "sources/x.py", "checkpoints/x"),
)
"""Names that nobody expects, or no writer of this program gives."""


def _extra_objects(tally: Tally, store: Store) -> None:
    """Put objects where nobody expects them: they change nothing."""
    before = bucket.sound(store)
    for path in EXTRA:
        connect(str(store.root)).put(path, b"\xff\x00")
        tally.injected += 1
        made = world.run(store, world.whole())
        collect(store, survey(store, Limits()).items)
        if bucket.sound(store) != before or not all(each.reused for each in made.values()):
            tally.fail("lost", f"{path}: something was made again, or deleted")


def crowds(scale: float) -> Tally:
    """Let many processes work on one cache: the same keys and overlapping sweeps, beside cleaning and verifying."""
    tally, chance = Tally(), random.Random(27)
    with bucket.opened():
        for number in range(max(1, int(10 * scale))):
            url, crowd = fresh_url(), 6 if scale >= 1 else 2
            graphs = [(0, *sorted(chance.sample(range(3), 2))) for _ in range(crowd)]
            with world.folder() as folder:
                logs = folder.parent
                everybody = {
                    f"run {each}": world.start(bucket.job_run, url, bucket.environment(), logs / f"run {each}", graph)
                    for each, graph in enumerate(graphs)
                }
                for name, job in (("clean", bucket.job_clean), ("verify", bucket.job_verify)):
                    everybody[name] = world.start(job, url, bucket.environment(), logs / name, 6 if scale >= 1 else 2)
                for name, process in everybody.items():
                    tally.injected += 1
                    if (code := world.finish(process)) != 0:
                        kind = "lost" if code == world.USER_ERROR else "tracebacks"
                        tally.fail(kind, f"round {number}, {name}: exit {code}: {world.said(logs / name)}")
            bucket.recover(tally, Store(url), world.truth(0, 0, 1, 2), f"round {number}", 0, 0, 1, 2)
    return tally


def bad_stores(scale: float) -> Tally:
    """Let requests go wrong in each way, and lists come late while somebody cleans; and a store that is gone."""
    tally, kinds = Tally(), Faults().kinds
    with bucket.opened() as port:
        for number, chosen in enumerate([(each,) for each in kinds] * 4 if scale >= 1 else [kinds]):
            _run_through(tally, port, Faults(0.2, chosen, slow=0.05, seed=number), f"{chosen[0]}, {number}")
        for number in range(max(1, int(8 * scale))):
            _run_through(tally, port, Faults(late=1.0 if scale >= 1 else 0.5), f"late list {number}", cleaning=True)
        _gone(tally)
    return tally


def _run_through(tally: Tally, port: int, faults: Faults, where: str, *, cleaning: bool = False) -> None:
    """Run through a proxy that spoils requests; then look, through no proxy, at what came of it."""
    with proxy(port, faults) as spoilt, pointed_at(spoilt) as url, _cleaned(Store(url), cleaning):
        try:
            for _ in range(1 + cleaning):  # the second run reuses what is being cleaned away
                world.run(Store(url), world.whole())
        except Exception as error:  # noqa: BLE001 - whatever it is, the run must not fail
            tally.fail("lost", f"{where}: {error!r}")
    tally.injected += faults.injected.total()
    requests._connected.pop(url)
    with pointed_at(port):
        bucket.recover(tally, Store(url), world.truth(), where)


@contextmanager
def _cleaned(store: Store, wanted: bool) -> Iterator[None]:
    """Clean, again and again, beside what is done in the block: leftovers, and entries that nobody uses."""
    done = threading.Event()

    def clean() -> None:
        while wanted and not done.wait(0.1):
            collect(store, survey(store, Limits(seconds=0.0)).items)

    thread = threading.Thread(target=clean)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _gone(tally: Tally) -> None:
    """Run where no store answers, and where there is no bucket: one line."""
    patience, requests.PATIENCE = requests.PATIENCE, 0.5
    try:
        for url, port in ((fresh_url(), 9), (fresh_url().replace(BUCKET, "elsewhere"), None)):
            tally.injected += 1
            try:
                with pointed_at(port) if port else nullcontext():
                    world.run(Store(url), world.whole())
                tally.fail("wrong", f"{url}: nothing was refused")
            except CacheUnavailable as error:
                if "\n" in str(error):
                    tally.fail("tracebacks", f"{url}: {error}")
    finally:
        requests.PATIENCE = patience
