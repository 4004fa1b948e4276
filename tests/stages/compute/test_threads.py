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


def test_a_thread_of_a_pool_keeps_one_when_another_thread_ends_its_call() -> None:
    found, ready, ended = [], threading.Event(), threading.Event()

    def work() -> None:
        keep_one_thread()
        ready.set()
        ended.wait(60)
        found.append(torch.get_num_threads())

    before = torch.get_num_threads()
    thread = threading.Thread(target=work)
    thread.start()
    try:
        ready.wait(60)
        torch.set_num_threads(3)  # as a call of one_thread does at its end
        ended.set()
        thread.join()
    finally:
        torch.set_num_threads(before)
    assert found == [1]


def test_calls_that_overlap_leave_new_threads_as_many_as_before() -> None:
    found, inside, ended = [], threading.Event(), threading.Event()

    def overlap() -> None:
        with one_thread():
            inside.set()
            ended.wait(60)

    def count() -> None:
        found.append(torch.get_num_threads())

    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        with one_thread():
            thread = threading.Thread(target=overlap)
            thread.start()
            inside.wait(60)
        ended.set()
        thread.join()
        new = threading.Thread(target=count)
        new.start()
        new.join()
    finally:
        torch.set_num_threads(before)
    assert found == [3]
