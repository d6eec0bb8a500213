"""Fitting contact parameters to a laboratory curve."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from ._cells import PackingLike
from .errors import ElementTestStopped, InputError
from .packing import Packing
from .rve import Rve

#: Residual of a point of the curve that a test has not reached.
_MISSED = 1.0

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
        Every set that was tried, in order, with its ``error``.
    """

    parameters: dict[str, float]
    error: float
    uncertainty: dict[str, float]
    curve: pd.DataFrame
    evaluations: int
    trace: list[dict[str, float]] = field(repr=False)


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
    accuracy: str | None = "draft",
    rve: Mapping[str, Any] | None = None,
    workers: int | None = None,
    relative_step: float = 0.1,
    tolerance: float = 1e-3,
    most_evaluations: int = 60,
) -> Calibration:
    """Fits contact parameters so that an element test follows a measured curve, by least squares.

    Curves of cells are rough: a change of a parameter by a rounding changes which contacts slide. Derivatives are therefore taken over
    ``relative_step`` of the range of a parameter and not over an infinitesimal one, and curves are averaged over all packings.

    Parameters
    ----------
    packings : path, Packing, or sequence of them
        Ensemble; the mean of their curves is fitted.
    contact : mapping
        Keys of the table ``[contact]`` that stay as they are.
    target : pandas.DataFrame
        Measured curve: column ``x``, increasing, and ``columns``.
    parameters : mapping
        For each key to be fitted first guess, smallest and largest value.
    test : callable
        The element test, for example ``lambda rve: rve.triaxial(0.05, pressure=1e5)``. Its rows count from the end of consolidation.
    x, columns : str, sequence of str, optional
        Abscissa and ordinates, columns of the test.
    scales : mapping, optional
        Size of each ordinate by which its differences are divided; its range in the target without.
    accuracy, rve : optional
        As for :class:`Rve`.
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
    """
    try:
        from scipy.optimize import least_squares
    except ImportError as error:
        raise ImportError("calibration needs SciPy: pip install 'grainspan[calibration]'") from error
    several = [packings] if isinstance(packings, (str, os.PathLike, Packing)) else list(packings)
    if not several or not parameters:
        raise InputError("a calibration needs at least one packing and one parameter")
    names = list(parameters)
    first, lowest, highest = np.array([parameters[name] for name in names], dtype=float).T
    if not (np.all(lowest < highest) and np.all(lowest <= first) and np.all(first <= highest)):
        raise InputError("each parameter needs (first guess, smallest, largest), in their order of size")
    missing = [name for name in (x, *columns) if name not in target]
    if missing:
        raise InputError(f"the target has no column {', '.join(missing)}")
    places = target[x].to_numpy(float)
    wanted = np.array([target[name].to_numpy(float) for name in columns])
    if not (np.all(np.isfinite(places)) and np.all(np.isfinite(wanted))):
        raise InputError("the target holds values that are no finite numbers; leave their rows out")
    _increasing(places, f"the column {x} of the target")
    ranges = np.ptp(wanted, axis=1)
    sizes = np.array([(scales or {}).get(name, size or 1.0) for name, size in zip(columns, ranges)])
    trace: list[dict[str, float]] = []

    with ThreadPoolExecutor(workers or os.cpu_count()) as threads:

        def curves(sets: np.ndarray) -> np.ndarray:
            """Mean curves of parameter sets (n, parameters) at the places of the target: (n, columns, places)."""
            jobs = [(one, packing) for one in sets for packing in several]
            found = list(threads.map(lambda job: _curve(*job), jobs))
            return np.mean(np.reshape(found, (len(sets), len(several), *wanted.shape)), axis=1)

        def _curve(scaled: np.ndarray, packing: PackingLike) -> np.ndarray:
            values = dict(zip(names, lowest + scaled * (highest - lowest)))
            cell = Rve(packing, {**contact, **values}, accuracy=accuracy, rve=rve)
            try:
                rows = test(cell)
            except ElementTestStopped as stopped:
                rows = stopped.history
            absent = [name for name in (x, *columns) if name not in rows]
            if absent:
                raise InputError(f"the test gives no column {', '.join(absent)}")
            rows = _branch(rows, x)
            # The last row may lie a rounding before the end of the target.
            reached = places <= rows[x].iloc[-1] + 1e-9 * np.ptp(places)
            return np.array([np.where(reached, np.interp(places, rows[x], rows[name]), np.nan) for name in columns])

        def residuals(curve: np.ndarray) -> np.ndarray:
            difference = (curve - wanted) / sizes[:, None]
            # What a test has not reached counts as a difference of the size of the curve.
            return np.nan_to_num(difference, nan=_MISSED).ravel() / np.sqrt(difference.size)

        def difference_of(scaled: np.ndarray) -> np.ndarray:
            found = residuals(curves(scaled[None])[0])
            values = lowest + scaled * (highest - lowest)
            trace.append({**dict(zip(names, values)), "error": float(np.linalg.norm(found))})
            return found

        def derivatives(scaled: np.ndarray, *_: Any) -> np.ndarray:
            upper = np.minimum(scaled + relative_step * np.eye(len(names)), 1.0)
            lower = np.maximum(scaled - relative_step * np.eye(len(names)), 0.0)
            found = np.array([residuals(curve) for curve in curves(np.concatenate([upper, lower]))])
            change = found[: len(names)] - found[len(names) :]
            return (change / np.diag(upper - lower)[:, None]).T

        begin = (first - lowest) / (highest - lowest)
        fit = least_squares(
            difference_of, begin, derivatives, bounds=(0.0, 1.0), xtol=tolerance, ftol=1e-6, max_nfev=most_evaluations
        )
        best = curves(fit.x[None])[0]
    values = lowest + fit.x * (highest - lowest)
    curve = pd.DataFrame({x: places})
    for name, fitted, measured in zip(columns, best, wanted):
        curve[name], curve[f"{name}_target"] = fitted, measured
    spread = _deviations(fit.jac, fit.fun) * (highest - lowest)
    return Calibration(
        parameters={name: float(value) for name, value in zip(names, values)},
        error=float(np.linalg.norm(fit.fun)),
        uncertainty={name: float(value) for name, value in zip(names, spread)},
        curve=curve,
        evaluations=len(trace),
        trace=trace,
    )


def _branch(rows: pd.DataFrame, x: str) -> pd.DataFrame:
    """The rows of a test from where its strains are zero on: consolidation runs ``x`` the other way where the packing has to swell."""
    begin = rows.attrs.get("begin", 0)
    if np.any(np.diff(rows[x].to_numpy(float)) < 0.0):
        rows = rows[rows.index >= begin]
    values = rows[x].to_numpy(float)
    _increasing(values, f"the column {x} of the test")
    return rows.assign(**{x: np.maximum.accumulate(values)})


def _increasing(values: np.ndarray, what: str) -> None:
    """Refuses an abscissa that runs back: there is no curve over it. Controlled stresses may waver by their tolerance."""
    if len(values) and np.max(np.maximum.accumulate(values) - values) > 1e-2 * np.ptp(values):
        raise InputError(f"{what} does not increase; take the rows of one branch")


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
