"""One cell of grains in this process, and element tests."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays, _native
from ._cells import CellText, ContactLike, PackingLike, contact_table, rve_table
from ._paths import (
    Segment,
    axial_segment,
    cyclic_segments,
    isochoric_segment,
    isotropic_segment,
    lateral_stresses,
    oedometric_segments,
    shear_segment,
)
from ._servo import follow_mean_stress
from .errors import ElementTestStopped, InputError
from .history import History, parse, warn_of, with_invariants
from .packing import Packing
from .result import TrialResult, assembled

#: Increments of a change of the isotropic stress before a test.
_CONSOLIDATION = 10


def _checked_shortening(axial_strain: float, pressure: float | None, increments: int) -> None:
    """Refuses what no test can follow."""
    if not (np.isfinite(axial_strain) and axial_strain < 1.0):
        raise InputError(f"axial_strain = {axial_strain}: a relative shortening below 1")
    if pressure is not None and not (np.isfinite(pressure) and pressure > 0.0):
        raise InputError(f"pressure = {pressure}: compression positive, above 0")
    if increments < 1:
        raise InputError(f"increments = {increments}: at least one")


class Rve:
    """One cell of grains (RVE) in this process.

    Element tests start from the packing as given and leave the cell alone. ``trial``, ``commit``, ``rollback``, ``snapshot`` and
    ``restore`` act on the committed state of the cell as those of :class:`Pool` do, with the same bits.

    Axes are x and y for discs, and x, y and z for spheres; the axis of the tests is the last one. Stresses and strains that are passed
    to the tests are positive in compression; columns ``F_ij`` and ``sigma_ij`` of the results are tension positive.

    Parameters
    ----------
    packing : path or Packing
        The packing.
    contact : path or mapping
        Contact law: keys of the table ``[contact]``, or an input file that has one.
    accuracy : {"draft", "default", "tight"}, optional
        Accuracy of the grain solver.
    rve : mapping, optional
        Further keys of the table ``[rve]``.

    Raises
    ------
    InputError
        The packing or a table is not what it should be.

    Examples
    --------
    >>> rve = grainspan.Rve("packings/discs-400.json", {"modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.5})
    >>> rve.triaxial(0.02).plot()
    """

    def __init__(
        self,
        packing: PackingLike,
        contact: ContactLike,
        *,
        accuracy: str | None = None,
        rve: Mapping[str, Any] | None = None,
    ) -> None:
        # Wherever the program goes: tests read the packing again.
        self._packing = packing if isinstance(packing, Packing) else Path(packing).absolute()
        self._contact = dict(contact_table(contact))
        self._table = rve_table(accuracy, rve)
        self._initial: np.ndarray | None = None
        with CellText() as text:
            self._native = _native.Rve(text.cell(packing, self._contact, self._table), os.getcwd())

    @property
    def dimension(self) -> int:
        """2 for discs, 3 for spheres."""
        return self._native.dimension

    @property
    def grains(self) -> int:
        """Number of grains."""
        return self._native.grains

    @property
    def bulk_density(self) -> float:
        """Mass of the grains over the volume of the cell, kg/m3."""
        return self._native.bulk_density

    @property
    def strain_per_step(self) -> float:
        """Strain that the cell takes in one ramp step."""
        return self._native.strain_per_step

    # Trials

    def trial(
        self,
        H: ArrayLike | None = None,
        *,
        F: ArrayLike | None = None,
        tangent: str = "truss_like_slip",
        observables: str | Iterable[str] = (),
        ramp_steps: int = 0,
    ) -> TrialResult:
        """Deforms the cell from its committed state, as :meth:`Pool.trial` does for one point.

        Returns
        -------
        TrialResult
            With one entry.
        """
        target = _arrays.gradients(H, F, 1, self.dimension)
        ramp_steps = int(_arrays.ramps(ramp_steps, 1)[0])
        raw = self._native.trial(target.tobytes(), tangent, _arrays.names(observables), ramp_steps)
        return assembled(_arrays.results(raw, self.dimension))

    def commit(self) -> None:
        """Makes the trial the committed state."""
        self._native.commit()

    def rollback(self) -> None:
        """Drops the trial."""
        self._native.rollback()

    def snapshot(self) -> bytes:
        """The committed state as bytes."""
        return self._native.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Replaces the committed state and drops the trial."""
        self._native.restore(snapshot)

    @property
    def initial_stress(self) -> np.ndarray:
        """Cauchy stress of the packing as given, Pa, tension positive, shape (d, d)."""
        if self._initial is None:
            with CellText() as text:
                fresh = _native.Rve(text.cell(self._packing, self._contact, self._table), os.getcwd())
            zero = np.zeros((self.dimension, self.dimension)).tobytes()
            raw = fresh.trial(zero, "none", [], 0)
            self._initial = _arrays.results(raw, self.dimension)["stress"][0]
        return self._initial

    @property
    def initial_pressure(self) -> float:
        """Mean stress of the packing as given, Pa, compression positive."""
        return float(-np.trace(self.initial_stress) / self.dimension)

    # Element tests

    def path(
        self,
        segments: Sequence[Mapping[str, Any]],
        *,
        tangent: str = "none",
        stress_tolerance: float = 1e-3,
        begin: int = 0,
    ) -> History:
        """Takes the cell along any path of prescribed strains and stresses.

        Parameters
        ----------
        segments : sequence of mappings
            Each with ``increments``, and ``strain`` and ``stress``: mappings from components (``xx``, ``xy`` ...) to values. Strains are
            displacement gradients over the segment, relative to its beginning, tension positive; components that are in neither are
            zero strains. Stresses are reached linearly, Pa, tension positive. ``repeat`` does a segment several times.
        tangent : str, optional
            Tangent operator to add as columns ``C_ijkl``.
        stress_tolerance : float, optional
            Largest difference of a controlled stress from its target, relative to the mean pressure.
        begin : int, optional
            Segment whose begin is the origin of ``axial_compression``, ``shear`` and ``volume_change``.

        Returns
        -------
        History
            The rows of ``grainspan element``, and ``segment``, ``axial_compression``, ``shear``, ``volume_change``, ``p``, ``q``,
            ``deviator`` and ``stress_ratio``; counts in ``attrs["counts"]``, and a ``RuntimeWarning`` for those that matter.

        Raises
        ------
        InputError
            The path is not sound.
        ElementTestStopped
            The cell or the control of the stresses could not follow; the rows before are in its ``history``.
        """
        with CellText() as text:
            test = text.cell(
                self._packing, self._contact, self._table, stress_tolerance=stress_tolerance, path=list(segments)
            )
            csv, counts, of_packing, stopped = _native.element_test(test, os.getcwd(), tangent)
        lengths = [int(segment["increments"]) * int(segment.get("repeat", 1)) for segment in segments]
        rows = with_invariants(parse(csv), self.dimension, sum(lengths[:begin]), lengths)
        rows.attrs["counts"] = counts = dict(counts)
        if stopped is not None:
            raise ElementTestStopped(stopped, rows)
        warn_of(counts, of_packing)
        return rows

    def isotropic(self, pressure: float | Sequence[float], *, increments: int = 50, **options: Any) -> History:
        """Isotropic compression from the packing's own stress to one pressure after the other.

        Parameters
        ----------
        pressure : float or sequence of float
            Pressures, Pa, compression positive.
        increments : int, optional
            Increments to each of them.
        **options
            As for :meth:`path`.
        """
        segments = [isotropic_segment(self.dimension, one, increments) for one in np.atleast_1d(pressure)]
        return self._test(segments, 0, [("p", "volume_change"), ("p", "void_ratio")], options)

    def triaxial(
        self,
        axial_strain: float = 0.05,
        *,
        pressure: float | None = None,
        increments: int = 100,
        constant_volume: bool = False,
        **options: Any,
    ) -> History:
        """Triaxial compression, for discs a biaxial one: drained at constant lateral stress, or at constant volume (undrained).

        Parameters
        ----------
        axial_strain : float, optional
            Relative shortening along the axis; negative for extension.
        pressure : float, optional
            Lateral stress, Pa, compression positive; the cell is brought there isotropically first. Without it, that of the packing.
        increments : int, optional
            Increments of the shearing.
        constant_volume : bool, optional
            Volume is kept instead of the lateral stress; both lateral strains of spheres are equal.
        **options
            As for :meth:`path`.
        """
        segments = self._consolidation(pressure)
        if constant_volume:
            segments.append(isochoric_segment(self.dimension, axial_strain, increments))
        else:
            lateral = lateral_stresses(self.dimension, pressure, self.initial_stress)
            segments.append(axial_segment(self.dimension, -axial_strain, lateral, increments))
        if constant_volume:
            curves = [("axial_compression", "q"), ("p", "q")]
        else:
            curves = [("axial_compression", "stress_ratio"), ("axial_compression", "volume_change")]
        return self._test(segments, len(segments) - 1, curves, options)

    def undrained(self, axial_strain: float = 0.05, **options: Any) -> History:
        """Triaxial compression at constant volume, see :meth:`triaxial`."""
        return self.triaxial(axial_strain, constant_volume=True, **options)

    def oedometer(
        self,
        stress: float | Sequence[float] | None = None,
        *,
        axial_strain: float | None = None,
        increments: int = 50,
        **options: Any,
    ) -> History:
        """One-dimensional compression without lateral strain.

        Parameters
        ----------
        stress : float or sequence of float, optional
            Axial stresses to be reached one after the other, Pa, compression positive; smaller ones unload.
        axial_strain : float, optional
            Relative shortening, in place of stresses.
        increments : int, optional
            Increments to each of them.
        **options
            As for :meth:`path`.
        """
        if (stress is None) == (axial_strain is None):
            raise InputError("give either the axial stresses or the axial strain")
        stresses = None if stress is None else np.atleast_1d(stress)
        segments = oedometric_segments(self.dimension, stresses, axial_strain, increments)
        curves = [("axial_stress", "axial_compression"), ("axial_stress", "void_ratio")]
        return self._test(segments, 0, curves, options)

    def simple_shear(
        self,
        shear_strain: float = 0.1,
        *,
        normal_stress: float | None = None,
        increments: int = 100,
        constant_volume: bool = False,
        **options: Any,
    ) -> History:
        """Simple shear under constant normal stress, as in a direct shear box, or at constant volume.

        Parameters
        ----------
        shear_strain : float, optional
            Shear displacement over height.
        normal_stress : float, optional
            Stress along the axis, Pa, compression positive; the cell is brought there isotropically first. Without it, that of the
            packing.
        increments : int, optional
            Increments of the shearing.
        constant_volume : bool, optional
            The height is kept instead of the normal stress.
        **options
            As for :meth:`path`.
        """
        segments = self._consolidation(normal_stress)
        axial = self.initial_stress[-1, -1] if normal_stress is None else -normal_stress
        segments.append(shear_segment(self.dimension, shear_strain, None if constant_volume else axial, increments))
        return self._test(segments, len(segments) - 1, [("shear", "shear_stress"), ("shear", "volume_change")], options)

    direct_shear = simple_shear

    def constant_mean_stress(
        self,
        axial_strain: float = 0.05,
        *,
        pressure: float | None = None,
        increments: int = 100,
        stress_tolerance: float = 1e-3,
    ) -> History:
        """Triaxial compression at constant mean stress; both lateral strains of spheres are equal.

        The columns are those of the other tests but for the anisotropies of the forces (``a_c``, ``a_n``, ``a_t``), ``work`` and
        ``damping_work``. Increments that fail
        are taken in parts, and where a cell snaps across the mean stress the nearest state is accepted, up to 5 % away; both are in
        ``attrs["counts"]``.

        Parameters
        ----------
        axial_strain : float, optional
            Relative shortening along the axis; negative for extension.
        pressure : float, optional
            Mean stress, Pa, compression positive; the cell is brought there first. Without it, that of the packing.
        increments : int, optional
            Increments of the shearing.
        stress_tolerance : float, optional
            Largest difference of the mean stress from its target, relative to it.

        Raises
        ------
        ElementTestStopped
            The mean stress could not be kept.
        """
        _checked_shortening(axial_strain, pressure, increments)
        cell = Rve(self._packing, self._contact, rve=self._table)
        target = self.initial_pressure if pressure is None else pressure
        curves = [("axial_compression", "stress_ratio"), ("axial_compression", "volume_change")]
        return self._finished(lambda: follow_mean_stress(cell, target, axial_strain, increments, stress_tolerance), curves)

    def cyclic(
        self,
        amplitude: float,
        cycles: int = 10,
        *,
        pressure: float | None = None,
        increments: int = 20,
        shear: bool = False,
        constant_volume: bool = False,
        **options: Any,
    ) -> History:
        """Strain cycles between plus and minus an amplitude, about the state after consolidation.

        Parameters
        ----------
        amplitude : float
            Axial shortening, or shear displacement over the height at the turn before with ``shear``: where the specimen settles, turns are
            nearer to the state after consolidation by as much.
        cycles : int, optional
            Number of cycles.
        pressure : float, optional
            Lateral stress (normal stress with ``shear``), Pa, compression positive, which is kept. Without it, that of the packing.
        increments : int, optional
            Increments of a quarter of a cycle.
        shear : bool, optional
            Simple shear instead of triaxial compression and extension.
        constant_volume : bool, optional
            Volume is kept instead of the stress.
        **options
            As for :meth:`path`.
        """
        segments = self._consolidation(pressure)
        begin = len(segments)
        axial = self.initial_stress[-1, -1] if pressure is None else -pressure
        lateral = lateral_stresses(self.dimension, pressure, self.initial_stress)
        segments += cyclic_segments(self.dimension, amplitude, cycles, increments, shear, constant_volume, axial, lateral)
        abscissa, ordinate = ("shear", "shear_stress") if shear else ("axial_compression", "deviator")
        return self._test(segments, begin, [(abscissa, ordinate), ("p", ordinate)], options)

    def _consolidation(self, pressure: float | None) -> list[Segment]:
        """The segment to an isotropic pressure; none without one."""
        return [] if pressure is None else [isotropic_segment(self.dimension, pressure, _CONSOLIDATION)]

    def _test(
        self, segments: Sequence[Segment], begin: int, curves: Sequence[tuple[str, str]], options: Mapping[str, Any]
    ) -> History:
        """A path with the columns and curves of its test."""
        return self._finished(lambda: self.path(segments, begin=begin, **options), curves)

    def _finished(self, test: Callable[[], History], curves: Sequence[tuple[str, str]]) -> History:
        """The rows of a test with the columns that its curves need; also those of a test that stops before its end."""
        try:
            return self._with_curves(test(), curves)
        except ElementTestStopped as stopped:
            self._with_curves(stopped.history, curves)
            raise

    def _with_curves(self, history: History, curves: Sequence[tuple[str, str]]) -> History:
        axis = "xyz"[self.dimension - 1]
        needed = {name for curve in curves for name in curve}
        if not history.empty and "axial_stress" in needed:
            history["axial_stress"] = -history[f"sigma_{axis}{axis}"]
        if not history.empty and "shear_stress" in needed:
            history["shear_stress"] = history[f"sigma_x{axis}"]
        history.attrs["curves"] = list(curves)
        return history
