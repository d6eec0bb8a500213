"""Tables of curves."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .errors import InputError

_AXES = "xyz"


class _Plot(pd.DataFrame.plot):  # type: ignore[misc, name-defined, valid-type]
    """As the ``plot`` of pandas; without arguments, the curves of the test."""

    def __call__(self, *arguments: Any, **keywords: Any):
        history = self._parent
        if arguments or keywords or history.attrs.get("curves") is None:
            return super().__call__(*arguments, **keywords)
        return draw(history)


class History(pd.DataFrame):
    """A data frame of a test or a run; ``attrs`` hold counts of the test. ``plot()`` without arguments draws its curves."""

    @property
    def _constructor(self):
        return History

    @property
    def plot(self):
        """Accessor for drawing, see :class:`pandas.DataFrame.plot`."""
        return _Plot(self)


def draw(history: pd.DataFrame, axes=None):
    """Draws the curves of a test: one diagram for each pair of columns in ``history.attrs["curves"]``.

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
        raise ImportError("drawing needs matplotlib: pip install 'grainspan[plot]'") from error
    curves = history.attrs["curves"]
    if axes is None:
        _, axes = plt.subplots(1, len(curves), figsize=(4.5 * len(curves), 3.4), squeeze=False, layout="constrained")
    axes = np.ravel(axes)
    for ax, (x, y) in zip(axes, curves):
        ax.plot(history[x], history[y])
        ax.set_xlabel(x.replace("_", " "))
        ax.set_ylabel(y.replace("_", " "))
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
        One row per accepted step; numbers have the bits of the file.
    """
    place = Path(path)
    if place.is_dir():
        place = place / "history.csv"
    try:
        return parse(place.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read the history {place}: {error}") from error


def parse(text: bytes) -> History:
    """Rows from CSV; numbers have the bits that were written."""
    names, *rows = [*csv.reader(io.StringIO(text.decode("utf-8")))] or [[]]
    columns = zip(*rows) if rows else ([] for _ in names)
    return History({name: _column(list(values)) for name, values in zip(names, columns)})


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
    rows["stress_ratio"] = rows["q"] / rows["p"].where(rows["p"] != 0)
    return rows


def _tensors(rows: pd.DataFrame, name: str, axes: str) -> np.ndarray:
    columns = [f"{name}_{i}{j}" for i in axes for j in axes]
    return rows[columns].to_numpy().reshape(-1, len(axes), len(axes))
