import numpy as np
import pytest
import torch

from semidense.stages.compute.kernel import kernel
from semidense.stages.matching.winograd.storage import Flat, Stored, rounded, stored, widened


@kernel
def kept(numbers: Flat, out: Stored) -> None:
    for i in range(len(numbers)):
        out[i] = rounded(numbers[i], out)


@kernel
def read(numbers: Stored, out: Flat) -> None:
    for i in range(len(numbers)):
        out[i] = widened(numbers[i])


TIES = [1 + 2**-8, 1 + 3 * 2**-8, -1 - 2**-8, 2**-130, 3.4e38, -0.0, np.inf, -np.inf]
NUMBERS = np.append(np.random.default_rng(0).normal(size=5000) * 10.0 ** np.arange(5000) ** 0.4, TIES).astype(
    np.float32
)
DTYPES = [pytest.param(dtype, id=str(dtype)) for dtype in (torch.float32, torch.bfloat16)]


@pytest.mark.parametrize("dtype", DTYPES)
def test_numbers_are_stored_as_torch_stores_them(dtype: torch.dtype) -> None:
    made = torch.empty(len(NUMBERS), dtype=dtype)
    kept(NUMBERS, stored(made))
    assert torch.equal(made, torch.from_numpy(NUMBERS).to(dtype))


@pytest.mark.parametrize("dtype", DTYPES)
def test_numbers_are_read_as_torch_reads_them(dtype: torch.dtype) -> None:
    given = torch.from_numpy(NUMBERS).to(dtype)
    made = np.empty(len(NUMBERS), np.float32)
    read(stored(given), made)
    assert np.array_equal(made, given.float().numpy())


def test_what_is_not_a_number_stays_none() -> None:
    made = torch.empty(1, dtype=torch.bfloat16)
    kept(np.array([np.nan], np.float32), stored(made))
    assert made.isnan().all()
