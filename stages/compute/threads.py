"""How many threads an operation of torch has: a module of its own, so that inference does not depend on training."""

import torch


def one_thread() -> None:
    """Make torch use one thread an operation in the calling thread."""
    torch.set_num_threads(1)
