"""Each case runs in a process of its own with a time limit: a fork from the test's own process could hang the test."""

import os
import subprocess
import sys

import numpy as np
import pytest

from semidense.cache import Store
from tests.cache.conftest import Make

LIMIT = 60
"""Seconds."""
READ = """
import multiprocessing, sys
from pathlib import Path
from semidense.cache import Store
opened = Store(Path(sys.argv[1])).open(sys.argv[2])
total = lambda: float(sum(array.sum() for array in opened.data_vars.values()))
print(total())
"""
FORKED = """
queue = multiprocessing.get_context("fork").SimpleQueue()
child = multiprocessing.get_context("fork").Process(target=lambda: queue.put(total()))
child.start()
child.join(20)
hangs = child.is_alive()
child.kill()
print("hangs" if hangs else queue.get())
"""
OTHER_LIMIT = """
import dask
with dask.config.set(num_workers=3):
    total()
"""
LOCKED = """
import dask.threaded
dask.threaded.pools_lock.acquire()
"""
LOADER = """
import torch
class Totals(torch.utils.data.Dataset):
    def __len__(self): return 1
    def __getitem__(self, index): return total()
loader = torch.utils.data.DataLoader(Totals(), num_workers=1, timeout=20, multiprocessing_context="fork")
print(next(iter(loader)).item())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.parametrize(
    "code",
    [
        pytest.param(FORKED, id="multiprocessing"),
        pytest.param(FORKED + FORKED, id="twice"),
        pytest.param(OTHER_LIMIT + FORKED, id="after a read with another number of threads"),
        pytest.param(LOCKED + FORKED, id="while a thread asks Dask for its pool"),
        pytest.param(LOADER, id="a DataLoader with a worker"),
    ],
)
def test_an_opened_entry_can_be_read_in_a_fork_after_a_read(
    code: str, store: Store, make: Make, values: np.ndarray
) -> None:
    entry = make(store, values)
    command = [sys.executable, "-c", READ + code, str(store.root), entry.key]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert ran.returncode == 0, ran.stderr
    first, *forked = ran.stdout.split()
    assert forked
    assert set(forked) == {first}
