"""Of the threads of a worker, a training runs alone."""

import threading
import time

from semidense.pipeline.execution.cluster.sharing import Room


def test_many_are_together_and_one_is_alone() -> None:
    room, lock = Room(), threading.Lock()
    inside: list[str] = []
    seen: list[tuple[str, ...]] = []

    def work(kind: str) -> None:
        with room.alone() if kind == "training" else room.together():
            with lock:
                inside.append(kind)
                seen.append(tuple(inside))
            time.sleep(0.02)
            with lock:
                inside.remove(kind)

    kinds = ["tile", "tile", "training", "tile", "tile", "training", "tile"]
    threads = [threading.Thread(target=work, args=(kind,)) for kind in kinds]
    for each in threads:
        each.start()
    for each in threads:
        each.join(30)
    assert not any(each.is_alive() for each in threads)
    assert len(seen) == len(kinds)
    assert all(len(beside) == 1 for beside in seen if "training" in beside)
    assert ("tile", "tile") in seen


def test_a_task_that_fails_leaves_the_room() -> None:
    room = Room()
    for enter in (room.alone, room.together, room.alone):
        try:
            with enter():
                raise RuntimeError("broken")
        except RuntimeError:
            continue
    with room.alone():
        pass
