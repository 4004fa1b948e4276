"""How the numbers of products lie in memory: as float32, or as bfloat16 by its bits.

Neither NumPy nor Numba knows bfloat16. It is the upper half of a float32, so an array of uint16 holds it. Kernels
compute in float32 whatever the storage: they read through ``widened`` and write through ``rounded``.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import torch
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray
from torch import Tensor

Flat = NDArray[np.float32]
Stored = NDArray[np.float32] | NDArray[np.uint16]
"""float32, or the bits of bfloat16."""


def _widened(_: Any, number: Any) -> tuple[Any, Any]:  # noqa: ANN401 - Numba's types, the builder of instructions
    """Return a stored number as float32."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        if signature.args[0] == types.float32:
            return arguments[0]
        bits = context.cast(builder, arguments[0], types.uint16, types.uint32)
        upper = builder.shl(bits, context.get_constant(types.uint32, 16))
        return builder.bitcast(upper, context.get_value_type(types.float32))

    return types.float32(number), build


def _rounded(_: Any, number: Any, out: Any) -> tuple[Any, Any]:  # noqa: ANN401
    """Return a float32 number as an array stores it: as it is, or the nearest bfloat16, the even one of two."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        if signature.return_type == types.float32:
            return arguments[0]
        one, half, below = (context.get_constant(types.uint32, value) for value in (1, 16, 0x7FFF))
        bits = builder.bitcast(arguments[0], context.get_value_type(types.uint32))
        odd = builder.and_(builder.lshr(bits, half), one)
        upper = builder.lshr(builder.add(builder.add(bits, below), odd), half)
        return context.cast(builder, upper, types.uint32, types.uint16)

    return out.dtype(number, out), build


# Instructions of their own rather than functions: only so are loops over them made vector instructions every time.
widened = cast(Callable[[np.float32 | np.uint16], np.float32], intrinsic(_widened))
rounded = cast(Callable[[np.float32, Stored], np.float32], intrinsic(_rounded))


def flat(tensor: Tensor) -> Flat:
    """Return the numbers of a float32 tensor as the kernels take them, sharing the memory."""
    numbers: Flat = tensor.view(-1).numpy()
    return numbers


def stored(tensor: Tensor) -> Stored:
    """As ``flat``, of a tensor of either dtype, with its axes."""
    made: Stored = tensor.view(torch.uint16).numpy() if tensor.dtype == torch.bfloat16 else tensor.numpy()
    return made
