"""Segments of the paths of element tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import InputError

_AXES = "xyz"

#: A segment as `Rve.path` takes it.
Segment = dict[str, Any]


def _normal(axis: int) -> str:
    return _AXES[axis] * 2


def isotropic_segment(dimension: int, pressure: float, increments: int) -> Segment:
    """All normal stresses go to a pressure; no shear strain."""
    stress = {_normal(axis): -float(pressure) for axis in range(dimension)}
    return {"increments": increments, "stress": stress}


def lateral_stresses(dimension: int, pressure: float | None, initial: np.ndarray) -> dict[str, float]:
    """Lateral normal stresses: a pressure, or those of the packing."""
    chosen = np.diag(initial) if pressure is None else np.full(dimension, -float(pressure))
    return {_normal(axis): float(chosen[axis]) for axis in range(dimension - 1)}


def axial_segment(dimension: int, strain: float, lateral: dict[str, float], increments: int) -> Segment:
    """An axial strain, tension positive, under lateral stresses."""
    return {"increments": increments, "strain": {_normal(dimension - 1): strain}, "stress": lateral}


def isochoric_segment(dimension: int, axial_strain: float, increments: int) -> Segment:
    """A shortening at constant volume: equal logarithmic strains in every increment, so that the volume is kept exactly."""
    axial = np.log1p(-axial_strain) / increments
    lateral = np.expm1(-axial / (dimension - 1))
    strain = {_normal(axis): float(lateral) for axis in range(dimension - 1)}
    strain[_normal(dimension - 1)] = float(np.expm1(axial))
    return {"increments": 1, "repeat": increments, "strain": strain}


def oedometric_segments(
    dimension: int, stresses: np.ndarray | None, axial_strain: float | None, increments: int
) -> list[Segment]:
    """Axial stresses one after the other, or one shortening, without lateral strain."""
    axial = _normal(dimension - 1)
    if stresses is None:
        return [{"increments": increments, "strain": {axial: -float(axial_strain or 0.0)}}]
    return [{"increments": increments, "stress": {axial: -float(one)}} for one in stresses]


def shear_segment(dimension: int, shear: float, axial_stress: float | None, increments: int) -> Segment:
    """A shear strain under a normal stress, tension positive, or at constant height."""
    segment: Segment = {"increments": increments, "strain": {f"x{_AXES[dimension - 1]}": shear}}
    if axial_stress is not None:
        segment["stress"] = {_normal(dimension - 1): float(axial_stress)}
    return segment


def cyclic_segments(
    dimension: int,
    amplitude: float,
    cycles: int,
    increments: int,
    shear: bool,
    constant_volume: bool,
    axial_stress: float,
    lateral: dict[str, float],
) -> list[Segment]:
    """Quarter, half, half, ..., quarter: from zero to plus, to minus, ... and back to zero."""
    if cycles < 1:
        raise InputError(f"cycles = {cycles}: at least one")
    if not np.isfinite(amplitude) or not (shear or abs(amplitude) < 1.0):
        raise InputError(f"amplitude = {amplitude}: a finite number, and as a relative shortening below 1")
    if increments < 1:
        raise InputError(f"increments = {increments}: at least one")
    turns = [0.0, *[amplitude, -amplitude] * cycles, 0.0]
    segments = []
    for begin, end in zip(turns, turns[1:]):
        quarters = 1 if 0.0 in (begin, end) else 2
        count = quarters * increments
        if shear:
            segments.append(shear_segment(dimension, end - begin, None if constant_volume else axial_stress, count))
            continue
        # Strains of a segment are relative to its beginning.
        shortening = 1.0 - (1.0 - end) / (1.0 - begin)
        if constant_volume:
            segments.append(isochoric_segment(dimension, shortening, count))
        else:
            segments.append(axial_segment(dimension, -shortening, lateral, count))
    return segments
