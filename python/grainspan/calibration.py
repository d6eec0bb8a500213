"""Fitting contact parameters to a laboratory curve."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from . import _arrays
from ._cells import PackingLike, rve_table
from .errors import ElementTestStopped, InputError, TrialRefused
from .packing import Packing
from .rve import Rve

#: Residual of a point of the curve that a test has not reached.
_MISSED = 1.0

#: Error of a parameter set whose curve cannot be compared, relative to that of the first guess or to the scale of the curve, if that is
#: larger: such a set is never taken for a better one.
_UNCOMPARED = 10.0

#: A combination of parameters that changes the curves by less than this share of what one parameter does is not determined by them.
_UNDETERMINED = 1e-7

#: Parameters with a smaller part in such a combination are determined.
_PART = 1e-4


@dataclass(frozen=True)
class Calibration:
    """Result of :func:`calibrate`.

    Attributes
    ----------
    parameters : dict of str to float
        Best values of the contact parameters.
    error : float
        Root mean square difference of the curves over their scale.
    uncertainty : dict of str to float
        Standard deviations of a linear estimate at the best values; NaN for a parameter that the curve does not determine.
    curve : pandas.DataFrame
        Target and fitted curve: ``x``, then ``COLUMN`` and ``COLUMN_target`` for each column.
    evaluations : int
        Parameter sets that were tried.
    trace : list of dict
        Every set that was tried, in order, with its ``error``; NaN for a set whose curve cannot be compared.
    uncompared : list of dict
        Sets, those of the derivatives included, whose curve cannot be compared with the target, each with the ``reason``: a packing is
        unloaded at once, for example, so that there is no curve over ``x``. The fit keeps away from them.
    """

    parameters: dict[str, float]
    error: float
    uncertainty: dict[str, float]
    curve: pd.DataFrame
    evaluations: int
    trace: list[dict[str, float]] = field(repr=False)
    uncompared: list[dict[str, Any]] = field(repr=False, default_factory=list)


class _NoCurve(Exception):
    """The rows of a test are no curve that can be compared with the target; the text says why."""


def calibrate(
    packings: PackingLike | Sequence[PackingLike],
    contact: Mapping[str, Any],
    target: pd.DataFrame,
    parameters: Mapping[str, tuple[float, float, float]],
    test: Callable[[Rve], pd.DataFrame],
    *,
    x: str = "axial_compression",
    columns: Sequence[str] = ("stress_ratio", "volume_change"),
    scales: Mapping[str, float] | None = None,
    accuracy: str | None = None,
    rve: Mapping[str, Any] | None = None,
    workers: int | None = None,
    relative_step: float = 0.1,
    tolerance: float = 1e-3,
    most_evaluations: int = 60,
) -> Calibration:
    """Fits contact parameters so that an element test follows a measured curve, by least squares.

    Curves of cells are rough: a change of a parameter by a rounding changes which contacts slide. Derivatives are therefore taken over
    ``relative_step`` of the range of a parameter and not over an infinitesimal one, and curves are averaged over all packings. A parameter
    set whose curve cannot be compared in one of the packings counts as worse than the first guess, by a constant, and the fit goes on.

    Parameters
    ----------
    packings : path, Packing, or sequence of them
        Ensemble; the mean of their curves is fitted.
    contact : mapping
        Keys of the table ``[contact]`` that stay as they are.
    target : pandas.DataFrame
        Measured curve: column ``x``, increasing, and ``columns``; at least one row.
    parameters : mapping
        For each key to be fitted first guess, smallest and largest value.
    test : callable
        The element test, for example ``lambda rve: rve.triaxial(0.05, pressure=1e5)``. Its rows count from the end of consolidation.
    x, columns : str, sequence of str, optional
        Abscissa and ordinates, columns of the test.
    scales : mapping, optional
        Size of each ordinate by which its differences are divided; its range in the target without.
    accuracy, rve : optional
        As for :class:`Rve`, but with the accuracy ``"draft"`` where neither gives one.
    workers : int, optional
        Tests that run at the same time; one per core without.
    relative_step : float, optional
        Step of the derivatives, relative to the range of a parameter.
    tolerance : float, optional
        Change of the parameters, relative to their ranges, at which the fit ends.
    most_evaluations : int, optional
        Most parameter sets besides those of the derivatives.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        An argument or the measured curve is not what it should be, the test lacks a column, or the fit finds no parameter set whose curve
        can be compared.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError as error:
        raise ImportError("calibration needs SciPy: pip install 'grainspan[calibration]'") from error
    several = [packings] if isinstance(packings, (str, os.PathLike, Packing)) else list(packings)
    if not several or not parameters:
        raise InputError("a calibration needs at least one packing and one parameter")
    names = list(parameters)
    first, lowest, highest = _bounds(parameters)
    if workers is not None:
        workers = _arrays.whole(workers, "workers", 1)
    if accuracy is None and "accuracy" not in (rve or {}):
        accuracy = "draft"
    rve_table(accuracy, rve)
    missing = [name for name in (x, *columns) if name not in target]
    if missing:
        raise InputError(f"the target has no column {', '.join(missing)}")
    if len(target) == 0:
        raise InputError("the target has no rows; give at least one point of the measured curve")
    try:
        places = target[x].to_numpy(float)
        wanted = np.array([target[name].to_numpy(float) for name in columns])
    except (TypeError, ValueError) as error:
        raise InputError(f"the target holds something else than numbers: {error}") from error
    if not (np.all(np.isfinite(places)) and np.all(np.isfinite(wanted))):
        raise InputError("the target holds values that are no finite numbers; leave their rows out")
    if not _is_increasing(places):
        raise InputError(f"the column {x} of the target does not increase; take the rows of one branch")
    ranges = np.ptp(wanted, axis=1)
    sizes = np.array([(scales or {}).get(name, size or 1.0) for name, size in zip(columns, ranges)])
    trace: list[dict[str, float]] = []
    uncompared: list[dict[str, Any]] = []
    # Curves of the sets of the fit, and of none that cannot be compared: the derivatives need that of their place again.
    known: dict[bytes, np.ndarray | None] = {}
    penalty = _UNCOMPARED

    def values_of(scaled: np.ndarray) -> dict[str, float]:
        return {name: float(value) for name, value in zip(names, lowest + scaled * (highest - lowest))}

    def residuals(curve: np.ndarray | None) -> np.ndarray:
        if curve is None:
            return np.full(wanted.size, penalty) / np.sqrt(wanted.size)
        difference = (curve - wanted) / sizes[:, None]
        # What a test has not reached counts as a difference of the size of the curve.
        return np.nan_to_num(difference, nan=_MISSED).ravel() / np.sqrt(difference.size)

    with ThreadPoolExecutor(workers or os.cpu_count()) as threads:

        def curves(sets: Sequence[np.ndarray]) -> list[np.ndarray | None]:
            """Mean curves of parameter sets at the places of the target, each (columns, places); ``None`` where there is none."""
            jobs = [(one, packing) for one in sets for packing in several]
            found = list(threads.map(lambda job: _curve(*job), jobs))
            means: list[np.ndarray | None] = []
            for number, one in enumerate(sets):
                parts = found[number * len(several) : (number + 1) * len(several)]
                reasons = [str(part) for part in parts if isinstance(part, _NoCurve)]
                if reasons:
                    uncompared.append({**values_of(one), "reason": reasons[0]})
                means.append(None if reasons else np.mean(parts, axis=0))
            return means

        def _curve(scaled: np.ndarray, packing: PackingLike) -> np.ndarray | _NoCurve:
            cell = Rve(packing, {**contact, **values_of(scaled)}, accuracy=accuracy, rve=rve)
            try:
                rows = test(cell)
            except ElementTestStopped as stopped:
                rows = stopped.history
            except TrialRefused as refused:
                return _NoCurve(str(refused))
            absent = [name for name in (x, *columns) if name not in rows]
            if absent and len(rows):
                raise InputError(f"the test gives no column {', '.join(absent)}")
            try:
                rows = _branch(rows, x)
            except _NoCurve as reason:
                return reason
            # The last row may lie a rounding before the end of the target.
            reached = places <= rows[x].iloc[-1] + 1e-9 * np.ptp(places)
            return np.array([np.where(reached, np.interp(places, rows[x], rows[name]), np.nan) for name in columns])

        def difference_of(scaled: np.ndarray) -> np.ndarray:
            nonlocal penalty
            (curve,) = curves([scaled])
            known[scaled.tobytes()] = curve
            error = np.nan if curve is None else float(np.linalg.norm(residuals(curve)))
            if not trace and curve is not None:
                penalty = _UNCOMPARED * max(1.0, error)
            trace.append({**values_of(scaled), "error": error})
            return residuals(curve)

        def derivatives(scaled: np.ndarray, *_: Any) -> np.ndarray:
            steps = relative_step * np.eye(len(names))
            upper, lower = np.minimum(scaled + steps, 1.0), np.maximum(scaled - steps, 0.0)
            found = curves([*upper, *lower])
            place = known[scaled.tobytes()]
            columns_of = [
                _derivative((above, one[number]), (place, scaled[number]), (below, other[number]), residuals)
                for number, (above, one, below, other) in enumerate(zip(found, upper, found[len(names) :], lower))
            ]
            return np.transpose(columns_of)

        begin = (first - lowest) / (highest - lowest)
        fit = least_squares(
            difference_of, begin, derivatives, bounds=(0.0, 1.0), xtol=tolerance, ftol=1e-6, max_nfev=most_evaluations
        )
    best = known[fit.x.tobytes()]
    if best is None:
        raise InputError(
            f"no parameter set was found whose curve can be compared with the target: {uncompared[0]['reason']}; take the rows of one "
            "branch in the test, or another first guess"
        )
    curve = pd.DataFrame({x: places})
    for name, fitted, measured in zip(columns, best, wanted):
        curve[name], curve[f"{name}_target"] = fitted, measured
    spread = _deviations(fit.jac, fit.fun) * (highest - lowest)
    return Calibration(
        parameters=values_of(fit.x),
        error=float(np.linalg.norm(fit.fun)),
        uncertainty={name: float(value) for name, value in zip(names, spread)},
        curve=curve,
        evaluations=len(trace),
        trace=trace,
        uncompared=uncompared,
    )


def _bounds(parameters: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First guesses, smallest and largest values of the parameters to be fitted."""
    try:
        first, lowest, highest = np.array([[float(part) for part in parameters[name]] for name in parameters]).T
    except (TypeError, ValueError) as error:
        raise InputError("each parameter needs three numbers: (first guess, smallest, largest)") from error
    if not (np.all(lowest < highest) and np.all(lowest <= first) and np.all(first <= highest)):
        raise InputError("each parameter needs (first guess, smallest, largest), in their order of size")
    if not np.all(np.isfinite([lowest, highest])):
        raise InputError("the bounds of each parameter are finite numbers")
    return first, lowest, highest


def _derivative(
    above: tuple[np.ndarray | None, float],
    place: tuple[np.ndarray | None, float],
    below: tuple[np.ndarray | None, float],
    residuals: Callable[[np.ndarray | None], np.ndarray],
) -> np.ndarray:
    """Derivative of the residuals by one parameter from three curves and where they were computed: the difference of the outer two. If one
    of them cannot be compared, the middle one takes its place, though it may be no curve itself: then the way out is towards the other one.
    Zero if neither can."""
    ends = [end for end in (above, below) if end[0] is not None]
    if len(ends) == 1:
        ends.append(place)
    if not ends or ends[0][1] == ends[1][1]:
        return np.zeros_like(residuals(None))
    return (residuals(ends[0][0]) - residuals(ends[1][0])) / (ends[0][1] - ends[1][1])


def _branch(rows: pd.DataFrame, x: str) -> pd.DataFrame:
    """The rows of a test from where its strains are zero on: consolidation runs ``x`` the other way where the packing has to swell."""
    if len(rows) == 0:
        raise _NoCurve("the test gives no rows")
    begin = rows.attrs.get("begin", 0)
    if np.any(np.diff(rows[x].to_numpy(float)) < 0.0):
        rows = rows[rows.index >= begin]
    values = rows[x].to_numpy(float)
    if not np.all(np.isfinite(values)):
        raise _NoCurve(f"the column {x} of the test holds values that are no finite numbers")
    if len(values) == 0 or not _is_increasing(values):
        raise _NoCurve(f"the column {x} of the test does not increase")
    return rows.assign(**{x: np.maximum.accumulate(values)})


def _is_increasing(values: np.ndarray) -> bool:
    """Whether there is a curve over an abscissa: it does not run back. Controlled stresses may waver by their tolerance."""
    return bool(np.max(np.maximum.accumulate(values) - values) <= 1e-2 * np.ptp(values))


def _deviations(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Standard deviations of the parameters of a linear fit; NaN for those that the residuals do not determine."""
    rows, count = jacobian.shape
    sizes = np.linalg.norm(jacobian, axis=0)
    # Columns of length 1: parameters of any scale are undetermined by the same measure.
    scaled = jacobian / np.where(sizes > 0.0, sizes, 1.0)
    _, singular, directions = np.linalg.svd(scaled, full_matrices=False)
    kept = singular > _UNDETERMINED
    covariance = (directions[kept].T / singular[kept] ** 2) @ directions[kept]
    variance = np.diag(covariance) * (residual @ residual) / max(1, rows - count)
    # A parameter that has a part in a combination that changes nothing can have any value.
    free = (np.abs(directions[~kept]) > _PART).any(axis=0) | (sizes == 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(free, np.nan, np.sqrt(variance) / sizes)
