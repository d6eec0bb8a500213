"""Fields and grains of runs."""

from __future__ import annotations

import base64
import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from .errors import InputError

_TYPES = {"Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "Int32": "<i4", "UInt64": "<u8", "UInt32": "<u4", "UInt8": "u1"}


@dataclass(frozen=True)
class Fields:
    """Fields of one step, from a file for ParaView.

    Attributes
    ----------
    path : pathlib.Path
        The file.
    time : float
        Time of the step.
    points : pandas.DataFrame
        One row per node (or grain): coordinates ``x``, ``y``, ``z``, and its fields. Components of vectors and tensors are columns
        ``name_x``, ``name_y``, ``name_z`` and ``name_xx``, ``name_xy`` ...
    elements : pandas.DataFrame
        One row per element, empty for grains.
    """

    path: Path
    time: float
    points: pd.DataFrame
    elements: pd.DataFrame

    def to_pyvista(self):
        """The mesh of PyVista, which has to be installed."""
        try:
            import pyvista
        except ImportError as error:
            raise ImportError("this needs PyVista: pip install 'grainspan[fields]'") from error
        return pyvista.read(self.path)


def read_fields(folder: str | os.PathLike[str], step: int = -1, *, kind: str = "fields") -> Fields:
    """Reads the fields of one recorded step.

    Parameters
    ----------
    folder : path
        Output folder of a run, or a ``.vtu`` or ``.vtp`` file.
    step : int, optional
        Place among the recorded steps; the last without.
    kind : {"fields", "gauss_points"}, optional
        Nodes and elements, or Gauss points (if the scene records them).

    Returns
    -------
    Fields
    """
    place = Path(folder)
    if place.is_file():
        return _read(place, float("nan"))
    return _of_collection(place / f"{kind}.pvd", step)


def read_grains(folder: str | os.PathLike[str], point: int | None = None, step: int = -1) -> Fields:
    """Reads the grains of a Gauss point at one recorded step.

    Parameters
    ----------
    folder : path
        Output folder of a run whose scene records grains (``output.grains``).
    point : int, optional
        Number of the Gauss point; the first recorded one without.
    step : int, optional
        Place among the recorded steps; the last without.

    Returns
    -------
    Fields
        ``points`` has one row per grain: position, ``radius``, ``rotation``, ``contacts``, ``rattler``.
    """
    grains = Path(folder) / "grains"
    if point is None:
        known = sorted(grains.glob("point-*.pvd"))
        if not known:
            raise InputError(f"{folder} has no grains; record them with output.grains = [0] in the scene")
        return _of_collection(known[0], step)
    return _of_collection(grains / f"point-{point:04}.pvd", step)


def _of_collection(collection: Path, step: int) -> Fields:
    try:
        entries = ElementTree.parse(collection).getroot().findall("Collection/DataSet")
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"cannot read {collection}: {error}") from error
    try:
        entry = entries[step]
    except IndexError:
        raise InputError(f"{collection} has {len(entries)} steps, counted from 0; there is no {step}") from None
    try:
        name, time = entry.attrib["file"], float(entry.attrib["timestep"])
    except (KeyError, ValueError) as error:
        raise InputError(f"{collection} is no collection of a run: {error} in step {step}") from error
    return _read(collection.parent / name, time)


def _read(path: Path, time: float) -> Fields:
    try:
        piece = ElementTree.parse(path).getroot().find("*/Piece")
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"cannot read {path}: {error}") from error
    if piece is None:
        raise InputError(f"{path} is no file of a run")
    places = piece.find("Points/DataArray")
    coordinates = pd.DataFrame(_numbers(places).reshape(-1, 3), columns=list("xyz"))
    points = pd.concat([coordinates, _columns(piece.find("PointData"))], axis=1)
    return Fields(path, time, points, _columns(piece.find("CellData")))


def _columns(data: ElementTree.Element | None) -> pd.DataFrame:
    columns = {}
    for array in data if data is not None else ():
        name, width = array.attrib["Name"], int(array.attrib.get("NumberOfComponents", "1"))
        numbers = _numbers(array)
        if width == 1:
            columns[name] = numbers
        else:
            columns |= {f"{name}_{part}": of for part, of in zip(_components(width), numbers.reshape(-1, width).T)}
    return pd.DataFrame(columns)


def _components(width: int) -> list[str]:
    """Names of the components of a vector, a tensor (row by row), or anything else."""
    if width == 3:
        return list("xyz")
    if width == 9:
        return [a + b for a in "xyz" for b in "xyz"]
    return [str(number) for number in range(width)]


def _numbers(array: ElementTree.Element | None) -> np.ndarray:
    """Numbers of an array: base64 of a length in bytes (UInt64) and the numbers, or text."""
    if array is None or not array.text:
        return np.zeros(0)
    kind = np.dtype(_TYPES[array.attrib["type"]])
    if array.attrib.get("format") == "ascii":
        return np.array(array.text.split(), dtype=kind)
    return np.frombuffer(base64.b64decode(array.text), dtype=kind, offset=8)
