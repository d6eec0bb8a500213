"""Arrays as the extension module takes and returns them."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError

#: Types of the results that are no float64, and shapes behind the number of the point, by dimension d.
_TYPES = {"flags": np.uint32, "force_evaluations": np.uint64, "ramp_steps": np.uint64, "nanoseconds": np.uint64}
_TENSORS = {"stress": 2, "first_piola": 2, "fabric": 2, "tangent": 4}


def names(given: str | Iterable[str]) -> list[str]:
    """Names of observables; a single one may stand alone."""
    return [given] if isinstance(given, str) else list(given)


def whole(given: Any, name: str, least: int) -> int:
    """A whole number from ``least`` on, as machines count; an :class:`InputError` names the argument otherwise."""
    try:
        number = operator.index(given)
    except TypeError:
        number = least - 1
    if not least <= number < 1 << 63:
        raise InputError(f"{name} = {given!r}: a whole number of at least {least} and below 2^63")
    return number


def gradients(given: ArrayLike | None, deformation: ArrayLike | None, count: int, dimension: int) -> np.ndarray:
    """Displacement gradients of ``count`` points; one gradient holds for all."""
    if (given is None) == (deformation is None):
        raise InputError("give either the displacement gradients H or the deformation gradients F")
    raw = np.asarray(deformation if given is None else given)
    if np.iscomplexobj(raw):
        raise InputError("gradients are real numbers")
    target = raw.astype(np.float64)
    if given is None and target.ndim >= 2:
        target = target - np.eye(dimension) if target.shape[-2:] == (dimension, dimension) else target
    shape = (count, dimension, dimension)
    # Nothing else is spread out: a vector would fill the rows of a matrix, and (n, d) be taken for one matrix where n = d.
    if target.shape not in (shape, shape[1:], (1, *shape[1:])):
        raise InputError(f"gradients of shape {target.shape} do not fit {shape}: (points, row, column), or one matrix for all")
    return np.ascontiguousarray(np.broadcast_to(target, shape))


def ramps(given: ArrayLike, count: int) -> np.ndarray:
    """Ramp steps of ``count`` points; one number holds for all."""
    numbers = np.asarray(given)
    whole = numbers.astype(np.int64)
    if np.any(whole != numbers) or np.any(whole < 0) or numbers.shape not in ((), (1,), (count,)):
        raise InputError("ramp_steps are whole numbers from 0 on, one for all points or one for each")
    return np.ascontiguousarray(np.broadcast_to(whole, count))


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
