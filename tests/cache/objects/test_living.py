"""Signs of life, written by several threads."""

import threading

from semidense.cache.objects.living import take
from semidense.cache.objects.requests import connect


def test_threads_that_renew_at_a_time_do_not_take_each_other_for_somebody_else() -> None:
    objects, found = connect("memory://living"), list[bool]()
    living, start = take(objects, "claims/x"), threading.Barrier(4)
    assert living

    def renew() -> None:
        start.wait()
        found.extend(living.renew() for _ in range(50))

    threads = [threading.Thread(target=renew) for _ in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    living.release()
    assert found == [True] * 200
    assert not living.renew()
