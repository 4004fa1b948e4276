import threading

import torch

from semidense.stages.compute.threads import keep_one_thread, one_thread


def test_after_the_call_there_are_as_many_threads_as_before() -> None:
    @one_thread()
    def asked() -> int:
        return torch.get_num_threads()

    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        assert [asked(), torch.get_num_threads(), asked(), torch.get_num_threads()] == [1, 3, 1, 3]
    finally:
        torch.set_num_threads(before)


def test_a_thread_of_a_pool_keeps_one() -> None:
    found = []

    def work() -> None:
        keep_one_thread()
        found.append(torch.get_num_threads())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [1]
