"""Rows 6 and 7: damaged bytes and files in the cache."""

import random
import shutil
from collections.abc import Iterator
from pathlib import Path

from semidense.cache import Store
from tests.faults import world
from tests.faults.damage import DAMAGE, SAME_SIZE, Damage, files_of, flips, overwrite, unlock
from tests.faults.tally import Tally

QUICK_FLIPS = 400


def flipped_bytes(scale: float) -> Tally:
    """Flip a bit at every offset of the files of two entries, one tiled and one whole."""
    tally = Tally()
    with world.folder() as root:
        store = Store(root)
        made = world.run(store, world.whole())
        chosen = [each.key for each in made.values() if each.step.product in ("blurred", "trained")]
        files = [(key, path) for key in chosen for path in files_of(store, key).values()]
        total = sum(path.stat().st_size for _, path in files)
        stride = 1 if scale >= 1 else max(1, int(total / QUICK_FLIPS))
        for key, path in files:
            for offset in flips(path, range(0, path.stat().st_size, stride)):
                tally.injected += 1
                if store.check(key) is None:
                    tally.fail("wrong", f"{path.name} at {offset} is taken for sound")
            if store.check(key) is not None:
                tally.fail("lost", f"{path.name}: whole again, and not taken for sound")
        tally.figures["bytes"] = total
        _recover_from_flips(tally, files, store, 3 if scale >= 1 else 1)
    return tally


def _recover_from_flips(tally: Tally, files: list[tuple[str, Path]], store: Store, each: int) -> None:
    """Leave a flipped bit in some files, and run again."""
    chance = random.Random(6)
    for _ in range(each):
        for key, path in files:
            data = bytearray(path.read_bytes())
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            overwrite(path, bytes(data))
            tally.injected += 1
            world.recover(tally, store, world.whole(), world.truth(), f"{path.name} of {key[:8]}")


def damaged_files(scale: float) -> Tally:
    """Truncate, zero, extend, delete, swap and replace files; copy entries under other keys."""
    tally = Tally()
    with world.folder() as root:
        store = Store(root)
        made = world.run(store, world.whole())
        keys = [each.key for each in made.values()]
        with world.folder() as backup:
            shutil.copytree(root, backup, symlinks=True)
            for where, key, damage in _cases(store, keys, scale):
                unlock(store, key)
                damage(store.layout.entry(key), store.layout.record(key))
                tally.injected += 1
                world.recover(tally, store, world.whole(), world.truth(), where)
                _start_afresh(root, backup)
        _copied_entries(tally, store, keys)
    return tally


def _cases(store: Store, keys: list[str], scale: float) -> Iterator[tuple[str, str, Damage]]:
    """Yield each damage of each entry, and the plain ones of each file; in the quick form of one entry."""
    chosen = keys if scale >= 1 else keys[-1:]
    for key in chosen:
        for name, damage in {**DAMAGE, **SAME_SIZE}.items():
            yield f"{name} of {key[:8]}", key, damage
    for key in chosen if scale >= 1 else ():
        for path in files_of(store, key):
            for name, change in _CHANGES.items():
                yield f"{name} {path} of {key[:8]}", key, _of_file(store, key, path, change)


_CHANGES = {
    "truncated": lambda data: data[: len(data) // 2],
    "zeroed": lambda data: bytes(len(data)),
    "extended": lambda data: data + b"\n",
    "deleted": lambda data: None,
}


def _of_file(store: Store, key: str, name: str, change: object) -> Damage:
    def damage(folder: Path, record: Path) -> None:
        path = record if name == "record" else folder / name
        data = change(path.read_bytes())  # type: ignore[operator]
        if data is None:
            path.unlink()
        else:
            overwrite(path, data)

    return damage


def _start_afresh(root: Path, backup: Path) -> None:
    from semidense.cache.files import remove

    remove(root)
    shutil.copytree(backup, root, symlinks=True)


def _copied_entries(tally: Tally, store: Store, keys: list[str]) -> None:
    """Put each entry in the place of each other one: its data, and its data with its record."""
    for source in keys:
        for target in keys:
            if source == target:
                continue
            for with_record in (False, True):
                unlock(store, target)
                shutil.rmtree(store.layout.entry(target))
                shutil.copytree(store.layout.entry(source), store.layout.entry(target))
                if with_record:
                    overwrite(store.layout.record(target), store.layout.record(source).read_bytes())
                tally.injected += 1
                world.recover(tally, store, world.whole(), world.truth(), f"{source[:8]} as {target[:8]}")
