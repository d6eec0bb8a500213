"""Control of a mean stress by the lateral strain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .errors import ElementTestStopped
from .history import History, with_invariants

if TYPE_CHECKING:
    from .result import TrialResult
    from .rve import Rve

#: Most trials of one increment.
_MOST_TRIALS = 30

#: Observables that rows of an element test have.
_OBSERVABLES = ("coordination_number_no_rattlers", "fabric", "sliding_fraction", "energy")

_SCALARS = (
    "void_ratio",
    "coordination_number",
    "coordination_number_no_rattlers",
    "fabric_anisotropy",
    "sliding_fraction",
    "unbalanced_force_ratio",
    "max_overlap_ratio",
)


def follow_mean_stress(cell: Rve, pressure: float, axial_strain: float, increments: int, tolerance: float) -> History:
    """Shortens a cell in its initial state along its axis while the mean stress is kept, in equal logarithmic strains.

    An increment of no axial strain comes first where the packing has another mean stress.
    """
    dimension = cell.dimension
    deformation = np.eye(dimension)
    rows = [_row(0, deformation, _trial(cell, np.zeros(dimension), 0), 0)]
    steps = [np.log1p(-axial_strain) / increments] * increments
    begin = 0
    if abs(cell.initial_pressure - pressure) > tolerance * pressure:
        steps.insert(0, None)
        begin = 1
    lateral = 0.0
    for axial in steps:
        # The packing changes its size alone, then its axis is shortened.
        found = _increment(cell, pressure, axial, lateral, tolerance)
        if found is None:
            message = f"increment {len(rows)}: the mean stress {pressure:.6e} Pa was not kept; use more increments"
            raise ElementTestStopped(message, _table(rows, dimension, begin))
        gradient, lateral, result, cost = found
        cell.commit()
        deformation = (np.eye(dimension) + np.diag(gradient)) @ deformation
        rows.append(_row(len(rows), deformation, result, cost))
        if axial is None:
            lateral = 0.0
    return _table(rows, dimension, begin)


def _trial(cell: Rve, gradient: np.ndarray, ramp_steps: int) -> TrialResult:
    return cell.trial(np.diag(gradient), observables=_OBSERVABLES, ramp_steps=ramp_steps)


def _gradient(dimension: int, axial: float | None, lateral: float) -> np.ndarray:
    strains = np.full(dimension, lateral)
    if axial is not None:
        strains[-1] = axial
    return np.expm1(strains)


def _increment(cell: Rve, pressure: float, axial: float | None, lateral: float, tolerance: float):
    """Newton's method by the tangent, then secants; the bracket is kept once there is one."""
    dimension = cell.dimension
    direction = _gradient(dimension, None if axial is None else 0.0, 1.0) != 0.0
    samples: list[tuple[float, float]] = []
    ramp_steps, cost = 0, 0
    for _ in range(_MOST_TRIALS):
        gradient = _gradient(dimension, axial, lateral)
        result = _trial(cell, gradient, ramp_steps)
        # The first trial chooses the ramp for all: the stress would jump with its length otherwise.
        ramp_steps = ramp_steps or int(result.ramp_steps[0])
        cost += int(result.force_evaluations[0])
        error = -float(np.trace(result.stress[0])) / dimension - pressure
        if abs(error) <= tolerance * pressure:
            return gradient, lateral, result, cost
        samples.append((lateral, error))
        lateral = _next(samples, _slope(result, gradient, direction))
    return None


def _slope(result: TrialResult, gradient: np.ndarray, direction: np.ndarray) -> float:
    """Change of the pressure with the logarithmic lateral strain, by the tangent."""
    moduli = result.tangent_by_gradient(np.diag(gradient))[0]
    by_strain = np.einsum("iikk,k,k->", moduli, direction.astype(float), 1.0 + gradient)
    return -float(by_strain) / len(gradient)


def _next(samples: list[tuple[float, float]], slope: float) -> float:
    """The next lateral strain: pressure falls as it grows."""
    above = [strain for strain, error in samples if error > 0]
    below = [strain for strain, error in samples if error < 0]
    last, error = samples[-1]
    if len(samples) > 1 and samples[-2][0] != last:
        secant = (error - samples[-2][1]) / (last - samples[-2][0])
        slope = secant if secant < 0 else slope
    step = -error / slope if slope < 0 else np.sign(error) * 1e-4
    proposed = last + step
    if above and below:
        low, high = max(above), min(below)
        if not min(low, high) < proposed < max(low, high):
            proposed = 0.5 * (low + high)
    return proposed


def _row(number: int, deformation: np.ndarray, result: TrialResult, cost: int) -> dict[str, float]:
    axes = "xyz"[: len(deformation)]
    row: dict[str, float] = {"increment": number}
    for name, tensor in (("F", deformation), ("sigma", result.stress[0])):
        row |= {f"{name}_{a}{b}": tensor[i, j] for i, a in enumerate(axes) for j, b in enumerate(axes)}
    row |= {name: result.observables[name][0] for name in _SCALARS}
    row["dem_steps"] = cost
    row |= {name: result.observables[name][0] for name in ("elastic_energy", "frictional_dissipation")}
    fabric = result.observables["fabric"][0]
    row |= {f"fabric_{a}{b}": fabric[i, j] for i, a in enumerate(axes) for j, b in enumerate(axes) if i <= j}
    return row


def _table(rows: list[dict[str, float]], dimension: int, begin: int) -> History:
    lengths = [begin] * (begin > 0) + [len(rows) - 1 - begin]
    return with_invariants(History(rows), dimension, begin, lengths)
