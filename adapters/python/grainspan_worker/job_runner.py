"""Where jobs are done: the RVEs built so far, the states at hand, and the engine behind a guard.

An answer depends on the job alone, never on what was done before it; an engine that raises costs one failed answer, not
the worker; no number that is not finite leaves.
"""

import time
import traceback
from collections import OrderedDict

import msgpack
import numpy

from . import answer as answers
from .answer import TrialOptions
from .content import NONE, name_of, short
from .definition import Definition
from .errors import (
    DefinitionRefused,
    EngineFault,
    NotFinite,
    RveError,
    SnapshotRefused,
    TargetInverted,
    TargetNotFinite,
    Unsupported,
)
from .layout import REPLY, STATUSES, TANGENT_NAMES, TANGENTS
from .state_source import PathSource, SnapshotSource


#: Largest component of a target that rounding may hide in the state behind it, as for the run.
UNSEEN_STRAIN = 1e-9


class StateCache:
    """A bounded set of snapshots by name; the least recently used one leaves first."""

    def __init__(self, capacity):
        self._capacity, self._kept = max(capacity, 1), OrderedDict()

    def get(self, name):
        """The snapshot, or None; counts as a use."""
        if name in self._kept:
            self._kept.move_to_end(name)
        return self._kept.get(name)

    def keep(self, name, content):
        """Keeps a snapshot; counts as a use."""
        self._kept[name] = content
        self._kept.move_to_end(name)
        while len(self._kept) > self._capacity:
            self._kept.popitem(last=False)


class JobRunner:
    """Does jobs with one engine."""

    def __init__(self, rve_class, state_cache=64, replay=False, most_alive=64):
        self._rve_class = rve_class
        self._by_path = replay or not rve_class.has_snapshots()
        self._most_alive = most_alive
        self._sources, self._states = {}, StateCache(state_cache)
        # Faults of the engine over definitions, by their names.
        self._broken = {}
        #: Jobs answered.
        self.jobs = 0

    def define(self, content):
        """Builds an RVE; one that is already known is left alone.

        Raises the engine's refusal, an :class:`RveError`. An engine that breaks down over a definition says nothing about it, and a refusal
        would end the run: jobs that need it fail with the fault, as after a fault in a trial.
        """
        name = name_of(content)
        if name in self._sources:
            return
        definition = Definition.read(content, self._rve_class.features)
        if definition.dimension not in self._rve_class.dimensions:
            raise DefinitionRefused(
                f"engine `{self._rve_class.engine}` does not serve {definition.dimension} dimensions"
            )
        if definition.law not in self._rve_class.laws:
            raise DefinitionRefused(f"engine `{self._rve_class.engine}` does not serve the law `{definition.law}`")
        try:
            if self._by_path:
                self._sources[name] = PathSource(self._rve_class, definition, self._most_alive)
            else:
                self._sources[name] = SnapshotSource(self._rve_class, definition)
        except EngineFault as fault:
            self._broken[name] = fault
        except RveError:
            raise
        except Exception as error:
            self._broken[name] = _fault(error)
        else:
            self._broken.pop(name, None)

    def answer(self, job, carried=b""):
        """Does one job; returns the wire record and its (state, error) bytes."""
        begun, replayed = time.perf_counter_ns(), self.replayed
        try:
            reply, state, error = self._try(job, carried)
        except RveError as refusal:
            reply, state, error = bare(job, "failed"), b"", msgpack.packb(refusal.wire())
        reply["replayed"] = self.replayed - replayed
        reply["state_length"], reply["error_length"] = len(state), len(error)
        solving = int(reply["cost.solve_nanoseconds"]) + int(reply["cost.tangent_nanoseconds"])
        reply["overhead_nanoseconds"] = max(0, time.perf_counter_ns() - begun - solving)
        self.jobs += 1
        return reply, (state, error)

    def close(self):
        """Releases every RVE."""
        for source in self._sources.values():
            source.close()

    @property
    def replayed(self):
        """Trials solved again to rebuild states."""
        return sum(getattr(source, "replayed", 0) for source in self._sources.values())

    def _try(self, job, carried):
        ask = self._ask(job)
        gradient = _checked(job["target"])
        wanted = job["state"].tobytes()
        if carried:
            if name_of(carried) != wanted:
                raise SnapshotRefused(f"the snapshot sent for state {short(wanted)} was damaged on its way")
            self._states.keep(wanted, carried)
        definition = job["definition"].tobytes()
        source = self._sources.get(definition)
        if source is None:
            if definition in self._broken:
                raise self._broken[definition]
            return bare(job, "need_definition"), b"", b""
        if wanted in (NONE, source.initial_name):
            wanted, content = source.initial_name, source.initial
        else:
            content = self._states.get(wanted)
        if content is None:
            return bare(job, "need_state"), b"", b""
        begun = time.perf_counter_ns()
        try:
            answer, state = source.solve(wanted, content, gradient, ask)
            if not answer.solve_nanoseconds:
                answer.solve_nanoseconds = max(0, time.perf_counter_ns() - begun - answer.tangent_nanoseconds)
            # What the engine has put into its answer is as much its own as the solve.
            reply = self._done(job, ask, answer, state)
            self._check_that_it_moved(source, wanted, gradient, reply)
            return reply, state, b""
        except RveError:
            raise
        except Exception as error:
            raise _fault(error) from error

    @staticmethod
    def _check_that_it_moved(source, wanted, gradient, reply):
        """Refuses a reply whose state is the initial one although the stress has changed.

        The run compares states by their names and sees the same behind all later ones; the initial state has no name there.
        """
        strain = numpy.abs(gradient).max()
        if wanted != source.initial_name or reply["state"].tobytes() != wanted or strain <= UNSEEN_STRAIN:
            return
        # An engine whose stress does not change may well stay as it is. A new RVE tells: in this one nothing marks the initial state any more.
        source.close()
        at_rest, _ = source.solve(wanted, source.initial, numpy.zeros((3, 3)), TrialOptions())
        unmoved = numpy.zeros((), REPLY)
        at_rest.write(unmoved)
        if not numpy.array_equal(unmoved["stress"], reply["stress"]):
            raise EngineFault(
                f"the state behind a strain of {strain:.1e} is the initial one: the snapshots of the engine do not hold its state"
            )

    def _done(self, job, ask, answer, state):
        reply = bare(job, "done")
        lacking = answers.not_delivered(answer, self._rve_class.observables, ask)
        if lacking:
            raise EngineFault(
                f"the answer lacks {', '.join(f'`{name}`' for name in lacking)}, which `observables` of the engine declares: put it into "
                "`observed` wherever it is asked for, or do not declare it"
            )
        answer.write(reply)
        if not answers.finite(reply):
            raise NotFinite(answer.force_evaluations)
        if ask.tangent != "none":
            if answer.tangent is None:
                raise EngineFault(f"the tangent `{ask.tangent}` was asked for and did not come")
            reply["tangent_kind"] = TANGENTS[answer.tangent_kind or ask.tangent]
        name = name_of(state)
        reply["state"] = numpy.frombuffer(name, "u1")
        self._states.keep(name, state)
        return reply

    def _ask(self, job):
        tangent = TANGENT_NAMES.get(int(job["tangent"]))
        if tangent is None:
            raise Unsupported(f"tangent kind number {int(job['tangent'])}")
        if tangent != "none" and tangent not in self._rve_class.tangents:
            raise Unsupported(f"the tangent `{tangent}`")
        if job["friction_reduction"] != 0.0:
            raise Unsupported("friction that changes during the run")
        return TrialOptions(tangent, int(job["ramp_steps"]), int(job["observables"]))


def bare(job, status):
    """An empty reply with a status."""
    reply = numpy.zeros((), REPLY)
    reply["job"], reply["point"], reply["status"] = job["job"], job["point"], STATUSES[status]
    return reply


def _checked(target):
    gradient = numpy.array(target, dtype=float).reshape(3, 3)
    if not numpy.isfinite(gradient).all():
        raise TargetNotFinite()
    determinant = numpy.linalg.det(numpy.eye(3) + gradient)
    if determinant <= 0.0:
        raise TargetInverted(determinant)
    return gradient


def _fault(error):
    place = traceback.extract_tb(error.__traceback__)[-1]
    return EngineFault(f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})")
