"""Control of a mean stress by the lateral strain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .errors import ElementTestStopped, TrialRefused
from .history import History, warn_of, with_invariants
from .result import (
    DAMPING_CHANGED,
    LARGE_OVERLAP,
    NO_LOAD_BEARING_CONTACTS,
    NOT_EQUILIBRATED,
    TANGENT_FALLBACK,
    TANGENT_REGULARISED,
)

if TYPE_CHECKING:
    from .result import TrialResult
    from .rve import Rve

#: Most trials of one search, and how often an increment is halved when its search fails.
_MOST_TRIALS = 30
_MOST_HALVINGS = 6

#: Largest distance of the mean stress from its target, relative to it, at which a cell that snaps across the target is accepted.
_LARGEST_JUMP = 0.05

#: What an accepted trial may fall short of, by the names of the counts of other tests.
_FLAGGED = {
    "not_equilibrated": NOT_EQUILIBRATED,
    "no_load": NO_LOAD_BEARING_CONTACTS,
    "large_overlap": LARGE_OVERLAP,
    "damping_changed": DAMPING_CHANGED,
    "tangent_fallbacks": TANGENT_FALLBACK,
    "tangents_regularised": TANGENT_REGULARISED,
}

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

    An increment of no axial strain comes first where the packing has another mean stress. An increment whose search fails is taken in
    halves; at the smallest part the nearest state is accepted where the cell snaps across the target (``stress_jumps`` in the counts).
    """
    dimension = cell.dimension
    deformation = np.eye(dimension)
    rows = [_row(0, deformation, _trial(cell, np.zeros(dimension), 0), 0)]
    counts = dict.fromkeys(("rows", "trials", "dem_steps", "stress_jumps", "cut_increments", *_FLAGGED), 0)
    counts |= {"rows": 1, "trials": 1}
    steps: list[float | None] = [np.log1p(-axial_strain) / increments] * increments
    begin, reached = 0, cell.initial_pressure
    if abs(reached - pressure) > tolerance * pressure:
        # The packing changes its size alone, then its axis is shortened.
        steps.insert(0, None)
        begin = 1
    lateral = 0.0
    for axial in steps:
        done, part, start = 0.0, 1.0, reached
        # Searches that fail count with their row.
        before = counts["dem_steps"]
        while done < 1.0:
            aim = start + (done + part) * (pressure - start)
            is_smallest = part <= 0.5**_MOST_HALVINGS
            strain = None if axial is None else part * axial
            found = _increment(cell, aim, strain, part * lateral, tolerance, is_smallest, counts)
            if found is None:
                if is_smallest:
                    message = (
                        f"increment {len(rows)}: the mean stress {aim:.6e} Pa was not kept, as the cell snaps across it; "
                        "use more increments, or a packing of more grains"
                    )
                    raise ElementTestStopped(message, _table(rows, dimension, begin, counts))
                cell.rollback()
                part *= 0.5
                continue
            gradient, change, result = found
            cell.commit()
            deformation = (np.eye(dimension) + np.diag(gradient)) @ deformation
            # An increment without axial strain says nothing about those with one.
            lateral = 0.0 if axial is None else change / part
            done += part
        counts["cut_increments"] += part < 1.0
        reached = pressure
        rows.append(_row(len(rows), deformation, result, counts["dem_steps"] - before))
        counts["rows"] += 1
        for name, flags in _FLAGGED.items():
            counts[name] += bool(result.has(flags)[0])
    warn_of(counts)
    return _table(rows, dimension, begin, counts)


def _trial(cell: Rve, gradient: np.ndarray, ramp_steps: int) -> TrialResult:
    return cell.trial(np.diag(gradient), observables=_OBSERVABLES, ramp_steps=ramp_steps)


def _gradient(dimension: int, axial: float | None, lateral: float) -> np.ndarray:
    strains = np.full(dimension, lateral)
    if axial is not None:
        strains[-1] = axial
    return np.expm1(strains)


def _increment(
    cell: Rve,
    pressure: float,
    axial: float | None,
    lateral: float,
    tolerance: float,
    is_last_resort: bool,
    counts: dict[str, int],
):
    """Newton's method by the tangent, then secants; the bracket is kept once there is one. ``None`` if the search has failed."""
    dimension = cell.dimension
    direction = _gradient(dimension, None if axial is None else 0.0, 1.0) != 0.0
    samples: list[tuple[float, float]] = []
    ramp_steps = 0
    while len(samples) < _MOST_TRIALS:
        gradient = _gradient(dimension, axial, lateral)
        try:
            result = _trial(cell, gradient, ramp_steps)
        except TrialRefused as refused:
            if not refused.curable:
                raise
            break
        counts["trials"] += 1
        counts["dem_steps"] += int(result.force_evaluations[0])
        # The first trial chooses the ramp for all: the stress would jump with its length otherwise.
        ramp_steps = ramp_steps or int(result.ramp_steps[0])
        error = -float(np.trace(result.stress[0])) / dimension - pressure
        if abs(error) <= tolerance * pressure:
            return gradient, lateral, result
        samples.append((lateral, error))
        lateral = _next(samples, _slope(result, gradient, direction))
    if not (is_last_resort and samples):
        return None
    lateral, error = min(samples, key=lambda sample: abs(sample[1]))
    if abs(error) > _LARGEST_JUMP * pressure:
        return None
    counts["stress_jumps"] += 1
    gradient = _gradient(dimension, axial, lateral)
    result = _trial(cell, gradient, ramp_steps)
    counts["trials"] += 1
    counts["dem_steps"] += int(result.force_evaluations[0])
    return gradient, lateral, result


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


def _table(rows: list[dict[str, float]], dimension: int, begin: int, counts: dict[str, int]) -> History:
    # The rows on the way to the pressure, and those after it; a test may have stopped on the way.
    before = min(begin, len(rows) - 1)
    lengths = [before] * (before > 0) + [len(rows) - 1 - before]
    table = with_invariants(History(rows), dimension, begin, lengths)
    table.attrs["counts"] = dict(counts)
    return table
