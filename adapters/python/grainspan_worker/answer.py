"""What a trial is to deliver, and what it delivers."""

from dataclasses import dataclass, field

import numpy

from .layout import FLAGS, OBSERVABLES, REPLY


#: Groups in which jobs ask for optional results, where they are not named as the results are.
_GROUPS = {
    "fabric_anisotropy": "fabric",
    "coordination_number_no_rattlers": "coordination_no_rattlers",
    "elastic_energy": "energy",
    "frictional_dissipation": "energy",
    "damping_work": "energy",
    "mean_rotation": "rotation",
}


@dataclass(frozen=True)
class TrialOptions:
    """What a trial should deliver beside the stress."""

    #: Keyword of the tangent operator wanted; ``"none"`` for the stress alone.
    tangent: str = "none"
    #: Increments in which the deformation is to be applied; 0 = the engine chooses.
    ramp_steps: int = 0
    #: Bits of optional results wanted; use :meth:`wants`.
    observables: int = 0

    def wants(self, observable):
        """Whether an optional result is wanted, by its name among those of ``observed``, or by that of its group in scenes: ``"fabric"``,
        ``"elastic_energy"`` or ``"energy"``."""
        group = _GROUPS.get(observable, observable)
        if group not in OBSERVABLES:
            known = ", ".join(sorted({*OBSERVABLES, *_GROUPS}))
            raise ValueError(f"there is no optional result {observable!r}; there are {known}")
        return bool(self.observables & OBSERVABLES[group])


@dataclass
class Answer:
    """The answer to a trial. SI units, stress tension positive; lengths of arrays as on the wire."""

    #: Cauchy stress at the end, Pa, 3x3 (or 2x2 for a plane problem).
    stress: numpy.ndarray
    #: ``d sigma_ij / d F_kl`` with F relative to the end state, Pa, 9x9 (or 4x4); None without one.
    tangent: numpy.ndarray = None
    #: Keyword of the tangent delivered; None = the one asked for.
    tangent_kind: str = None
    #: Void volume over grain volume. This number and the next three are part of every answer: one that the engine leaves out is 0 in the
    #: results, because messages hold no NaN.
    void_ratio: float = 0.0
    #: 2 x contacts over grains.
    coordination_number: float = 0.0
    #: Value of the engine's equilibrium criterion.
    unbalanced_force_ratio: float = 0.0
    #: Largest overlap over the smaller diameter of its contact.
    max_overlap_ratio: float = 0.0
    #: Cell volume over initial cell volume.
    volume_ratio: float = 1.0
    #: Optional results by wire name (``fabric``, ``elastic_energy``, ...); only what was asked for need be there, and only
    #: what is among :attr:`Rve.observables` is read. With the flag ``no_load_bearing_contacts``, what is left out is 0.
    observed: dict = field(default_factory=dict)
    #: Shortcuts taken, by name: see ``FLAGS``.
    flags: set = field(default_factory=set)
    #: Contact-force evaluations (DEM steps).
    force_evaluations: int = 0
    #: Ramp increments used.
    ramp_steps: int = 0
    #: Time in the solver and in the tangent operator, ns; the worker fills the first if it is 0.
    solve_nanoseconds: int = 0
    tangent_nanoseconds: int = 0

    def write(self, reply):
        """Fills the wire record."""
        reply["stress"] = _tensor2(self.stress)
        if self.tangent is not None:
            reply["tangent"] = _tensor4(self.tangent)
        for name in ("void_ratio", "coordination_number", "unbalanced_force_ratio", "max_overlap_ratio", "volume_ratio"):
            reply[f"scalars.{name}"] = getattr(self, name)
        for name in ("force_evaluations", "ramp_steps", "solve_nanoseconds", "tangent_nanoseconds"):
            cost = getattr(self, name)
            if cost < 0 or cost != int(cost):
                raise ValueError(f"{name} is a whole number of 0 or more, and not {cost}")
            reply[f"cost.{name}"] = int(cost)
        for name, value in self.observed.items():
            shape = REPLY[f"observed.{name}"].shape
            if name == "mean_rotation" and shape == (3,) and numpy.ndim(value) == 0:
                # A plane rotation is one about the third axis.
                value = [0.0, 0.0, value]
            reply[f"observed.{name}"] = _tensor2(value) if shape == (9,) else value
        unknown = [name for name in self.flags if name not in FLAGS]
        if unknown:
            raise ValueError(f"there is no flag {', '.join(map(repr, unknown))}; known: {', '.join(FLAGS)}")
        reply["flags"] = sum(FLAGS[name] for name in self.flags)


def not_delivered(answer, declared, options):
    """Optional results that are declared and asked for and that the answer lacks. Without contacts those left out are zero."""
    if "no_load_bearing_contacts" in answer.flags:
        return []
    return [name for name in declared if name not in answer.observed and options.wants(name)]


def _real(value):
    value = numpy.asarray(value)
    if numpy.iscomplexobj(value):
        raise ValueError("stresses, tangents and other results are real numbers; one has an imaginary part")
    return value.astype(float)


def _tensor2(value):
    value = _real(value)
    if value.shape == (2, 2):
        full = numpy.zeros((3, 3))
        full[:2, :2] = value
        value = full
    if value.size != 9:
        raise ValueError(f"a tensor has the shape (3, 3), or (2, 2) in the plane, and not {value.shape}")
    return value.reshape(9)


def _tensor4(value):
    value = _real(value)
    if value.shape in ((4, 4), (2, 2, 2, 2)):
        full = numpy.zeros((3, 3, 3, 3))
        full[:2, :2, :2, :2] = value.reshape(2, 2, 2, 2)
        value = full
    if value.size != 81:
        raise ValueError(f"a tangent has the shape (9, 9), or (4, 4) in the plane, and not {value.shape}")
    return value.reshape(81)


def finite(reply):
    """Whether every number of the wire record is finite: the check at the process border."""
    return all(
        numpy.isfinite(reply[name]).all()
        for name in REPLY.names
        if name in ("stress", "tangent") or name.startswith(("scalars.", "observed."))
    )
