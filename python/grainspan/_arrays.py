"""Arrays as the extension module takes and returns them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError

#: Types of the results that are no float64, and shapes behind the number of the point, by dimension d.
_TYPES = {"flags": np.uint32, "force_evaluations": np.uint64, "ramp_steps": np.uint64, "nanoseconds": np.uint64}
_TENSORS = {"stress": 2, "first_piola": 2, "fabric": 2, "tangent": 4}


def gradients(given: ArrayLike | None, deformation: ArrayLike | None, count: int, dimension: int) -> np.ndarray:
    """Displacement gradients of ``count`` points; one gradient holds for all."""
    if (given is None) == (deformation is None):
        raise InputError("give either the displacement gradients H or the deformation gradients F")
    if given is None:
        target = np.asarray(deformation, dtype=np.float64) - np.eye(dimension)
    else:
        target = np.asarray(given, dtype=np.float64)
    shape = (count, dimension, dimension)
    try:
        return np.ascontiguousarray(np.broadcast_to(target, shape))
    except ValueError:
        raise InputError(f"gradients of shape {target.shape} do not fit {shape}: (points, row, column)") from None


def results(raw: dict[str, bytearray], dimension: int) -> dict[str, np.ndarray]:
    """Arrays over the memory of the extension module, which nothing else uses."""
    found: dict[str, Any] = {}
    for name, memory in raw.items():
        array = np.frombuffer(memory, dtype=_TYPES.get(name, np.float64))
        if name in _TENSORS:
            array = array.reshape(-1, *(dimension,) * _TENSORS[name])
        elif name == "mean_rotation":
            array = array.reshape(-1, 3)
        found[name] = array
    return found
