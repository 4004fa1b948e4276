"""How many threads an operation of torch has: a module of its own, so that inference does not depend on training."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


def keep_one_thread() -> None:
    """Make torch use one thread an operation in the calling thread from now on: for threads of a pool of ours.

    A new thread takes over the number of the process when torch first looks at it, whatever was set in the thread
    before. So this look comes first: another thread that ends ``one_thread`` may set the number of the process later.
    """
    torch.get_num_threads()
    torch.set_num_threads(1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Make torch use one thread an operation in the calling thread, and as many as before after that.

    As a decorator, for the time of each call. A thread that has one already sets nothing: what is set last is what new
    threads take over.
    """
    before = torch.get_num_threads()
    if before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
