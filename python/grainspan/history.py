"""Tables of curves."""

from __future__ import annotations

import csv
import io
import json
import os
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .errors import InputError

_AXES = "xyz"

#: The folder of the package, as in the frames of its functions.
_PACKAGE = os.path.dirname(sys._getframe().f_code.co_filename)

#: Columns of element tests that have a unit, by how their names begin; all others are numbers without one.
_UNITS = {
    "sigma_": "Pa",
    "C_": "Pa",
    "axial_stress": "Pa",
    "shear_stress": "Pa",
    "p": "Pa",
    "q": "Pa",
    "deviator": "Pa",
    "elastic_energy": "J/m3",
    "frictional_dissipation": "J/m3",
    "work": "J/m3",
    "damping_work": "J/m3",
}

#: Columns that pictures show in per cent.
_PER_CENT = {"axial_compression", "volume_change", "shear"}

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))


#: Counts of a test that its user has to know of.
_FALLS_SHORT = {
    "not_equilibrated": "whose grains did not come to rest",
    "stress_jumps": "in which the cell snaps across the stress that is kept",
    "relaxed_increments": "in which the search for the stress that is kept failed, mostly for a snap, and the cell was relaxed to it",
    "no_load": "without load-bearing contacts",
    "large_overlap": "with overlaps above 10 %",
    "negative_void_ratio": "whose grains have more volume than their cell",
}


#: The same of the packing that it began with.
_OF_PACKING = {
    "settled": "the packing, or the frame cut out of it, was not at rest under this contact law and was brought to rest before the first increment",
    "begins_with_motion": "the packing, or the frame cut out of it, was not at rest under this contact law: the first increment begins with its motion",
    "far_from_targets": "the stress of the packing and the first stresses of the path differ more than tenfold: check units, thickness and modulus",
}


def _level_of_the_caller() -> int:
    """The ``stacklevel`` of a warning, raised by the function that calls this, that names the first line outside of the package."""
    frame, level = sys._getframe(1), 1
    while frame is not None and os.path.dirname(frame.f_code.co_filename) == _PACKAGE:
        frame, level = frame.f_back, level + 1
    return level


def warn_of(counts: Mapping[str, int], of_packing: str | None = None) -> None:
    """Warns of what a test fell short of; ``of_packing`` is a further warning about the packing. Warnings name the line of the user."""
    level = _level_of_the_caller()
    for words in [*(words for name, words in _OF_PACKING.items() if counts.get(name)), *filter(None, [of_packing])]:
        warnings.warn(words, RuntimeWarning, stacklevel=level)
    found = [f"{counts[name]} {words}" for name, words in _FALLS_SHORT.items() if counts.get(name)]
    if found:
        warnings.warn(f"increments {', '.join(found)}; attrs['counts'] has all counts", RuntimeWarning, stacklevel=level)


def unit_of(column: str) -> str:
    """Unit of a column of an element test; ``-`` for numbers without one."""
    return next((unit for name, unit in _UNITS.items() if column == name or (name[-1] == "_" and column.startswith(name))), "-")


def _shown(values: pd.Series, unit: str) -> tuple[pd.Series, str]:
    """Values as a picture shows them, and their label."""
    words = str(values.name).replace("_", " ")
    if unit == "-":
        return (100.0 * values, f"{words}, %") if values.name in _PER_CENT else (values, words)
    largest = float(values.abs().max())
    size, prefix = next(((size, prefix) for size, prefix in _PREFIXES if largest >= size), (1.0, ""))
    return values / size, f"{words}, {prefix}{unit}"


class _Plot(pd.DataFrame.plot):  # type: ignore[misc, name-defined, valid-type]
    """As the ``plot`` of pandas; without arguments, the curves of the test."""

    def __call__(self, *arguments: Any, **keywords: Any):
        history = self._parent
        if arguments or keywords or history.attrs.get("curves") is None:
            return super().__call__(*arguments, **keywords)
        return draw(history)


class History(pd.DataFrame):
    """A data frame of a test or a run; ``plot()`` without arguments draws the curves of a test.

    ``attrs`` hold ``units`` (column to unit, ``-`` for numbers without one; SI) and, of a test, ``counts`` and ``begin``: the row at which
    its strains are zero, behind consolidation.
    """

    @property
    def _constructor(self):
        return History

    @property
    def plot(self):
        """Accessor for drawing, see :class:`pandas.DataFrame.plot`."""
        return _Plot(self)


def draw(history: pd.DataFrame, axes=None):
    """Draws the curves of a test: one diagram for each pair of columns in ``history.attrs["curves"]``, with units.

    Parameters
    ----------
    history : History
        Result of an element test.
    axes : sequence of matplotlib.axes.Axes, optional
        Where to draw; new ones without.

    Returns
    -------
    numpy.ndarray
        The axes.
    """
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("drawing needs matplotlib: pip install matplotlib") from error
    curves, units = history.attrs["curves"], history.attrs.get("units", {})
    if axes is None:
        _, axes = plt.subplots(1, len(curves), figsize=(4.5 * len(curves), 3.4), squeeze=False, layout="constrained")
    axes = np.ravel(axes)
    for ax, (x, y) in zip(axes, curves):
        (across, across_label), (up, up_label) = (_shown(history[name], units.get(name, unit_of(name))) for name in (x, y))
        ax.plot(across, up)
        ax.set_xlabel(across_label)
        ax.set_ylabel(up_label)
        ax.grid(True, linewidth=0.3)
    return axes


def read_history(path: str | os.PathLike[str]) -> History:
    """Reads the history of a run, or the rows of an element test or of a specimen.

    Parameters
    ----------
    path : path
        Output folder of a run, or a CSV file.

    Returns
    -------
    History
        One row per accepted step; numbers have the bits of the file. Units of the columns are in ``attrs["units"]``.
    """
    place = Path(path)
    is_run = place.is_dir()
    if is_run:
        place = place / "history.csv"
    try:
        rows = parse(place.read_bytes())
        # Beside the history of a run, whichever way it was named, lie its units.
        if (is_run or place.name == "history.csv") and (place.parent / "units.json").exists():
            rows.attrs["units"] |= json.loads((place.parent / "units.json").read_text(encoding="utf-8"))["history"]
        return rows
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the history {place}: {error}") from error


def parse(text: bytes) -> History:
    """Rows from CSV; numbers have the bits that were written. A last row that was cut is left out; another one is a ``ValueError``."""
    names, *rows = [*csv.reader(io.StringIO(text.decode("utf-8")))] or [[]]
    if rows and not text.endswith(b"\n"):
        # The process that wrote it has ended, or is about to write the rest.
        rows.pop()
    ragged = next((number for number, row in enumerate(rows, 2) if len(row) != len(names)), None)
    if ragged is not None:
        raise ValueError(f"line {ragged} has not the {len(names)} columns of the header")
    columns = zip(*rows) if rows else ([] for _ in names)
    # A header may hold units: `top_force [N/m]`.
    plain = [name.split(" [")[0] for name in names]
    table = History({name: _column(list(values)) for name, values in zip(plain, columns)})
    table.attrs["units"] = {
        short: name[len(short) + 2 : -1] if name != short else unit_of(short) for short, name in zip(plain, names)
    }
    return table


def _column(values: list[str]) -> np.ndarray | list[str]:
    """Whole numbers, numbers (an empty field is NaN), or text."""
    for kind in (int, float):
        try:
            return np.array([kind(value) if value or kind is int else np.nan for value in values], dtype=kind)
        except ValueError:
            continue
    return values


def with_invariants(rows: History, dimension: int, begin: int, lengths: list[int]) -> History:
    """Adds what curves are drawn of; strains are relative to row ``begin``, segments have ``lengths`` rows.

    The axis of a test is y for discs and z for spheres. Compression is positive in ``p``, ``q``, ``deviator`` and
    ``axial_compression``.
    """
    if rows.empty:
        return rows
    axes = _AXES[:dimension]
    tensors = {name: _tensors(rows, name, axes) for name in ("F", "sigma")}
    begin = min(begin, len(rows) - 1)
    relative = tensors["F"] @ np.linalg.inv(tensors["F"][begin])
    stress = tensors["sigma"]
    pressure = -np.trace(stress, axis1=1, axis2=2) / dimension
    deviation = stress + pressure[:, None, None] * np.eye(dimension)
    deviation = 0.5 * (deviation + deviation.transpose(0, 2, 1))
    # The difference of the principal stresses of a plane, the von Mises stress in space.
    factor = 2.0 if dimension == 2 else 1.5
    lateral = np.mean([stress[:, axis, axis] for axis in range(dimension - 1)], axis=0)
    numbers = np.concatenate([[0], np.repeat(np.arange(len(lengths)), lengths)])
    rows.insert(1, "segment", numbers[: len(rows)])
    rows["axial_compression"] = 1.0 - relative[:, -1, -1]
    rows["shear"] = relative[:, 0, -1]
    rows["volume_change"] = np.linalg.det(relative) - 1.0
    rows["p"] = pressure
    rows["q"] = np.sqrt(factor * np.einsum("nij,nij->n", deviation, deviation))
    rows["deviator"] = lateral - stress[:, -1, -1]
    # Not by `where` of pandas, which has Python forget the warnings that it has shown.
    rows["stress_ratio"] = np.divide(rows["q"], pressure, out=np.full(len(rows), np.nan), where=pressure != 0)
    rows.attrs["units"] = {name: unit_of(name) for name in (*rows.columns, "axial_stress", "shear_stress")}
    rows.attrs["begin"] = begin
    return rows


def _tensors(rows: pd.DataFrame, name: str, axes: str) -> np.ndarray:
    columns = [f"{name}_{i}{j}" for i in axes for j in axes]
    return rows[columns].to_numpy().reshape(-1, len(axes), len(axes))
