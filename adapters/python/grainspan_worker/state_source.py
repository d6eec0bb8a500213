"""Where states of one definition come from: snapshots, or the path of committed targets.

A source solves a request "from this state, by this target" and returns the answer with the bytes of the trial state.
The bytes are all that the run ever sees of a state, so a run, its checkpoints and other workers treat both kinds alike.
"""

from collections import OrderedDict

import msgpack
import numpy

from . import snapshot
from .answer import TrialOptions
from .content import name_of, short
from .errors import RveError, SnapshotRefused


class SnapshotSource:
    """States are the engine's own snapshots; one living RVE is enough."""

    def __init__(self, rve_class, definition):
        self._rve_class, self._definition = rve_class, definition
        self._rve = rve_class(definition)
        #: Bytes and name of the initial state.
        self.initial = self._sealed()
        self.initial_name = self._committed = name_of(self.initial)
        self._trial = None

    def solve(self, wanted, content, gradient, ask):
        """Answers from the state named ``wanted`` whose bytes are ``content``."""
        try:
            self._go_to(wanted, content)
            answer = self._rve.trial(gradient, ask)
            state = self._sealed()
        except RveError:
            # Whatever the engine has half done is not trusted: the next request restores.
            self._committed = self._trial = None
            raise
        except Exception:
            self.close()
            raise
        self._trial = name_of(state)
        return answer, state

    def close(self):
        """Ends the RVE; the next request builds a new one."""
        if self._rve is not None:
            rve, self._rve = self._rve, None
            rve.release()

    def _go_to(self, wanted, content):
        if self._rve is None:
            self._rve = self._rve_class(self._definition)
            self._committed, self._trial = self.initial_name, None
        if self._trial is not None and self._trial == wanted:
            self._rve.commit()
        elif self._committed != wanted or not self._rolled_back():
            self._rve.restore(self._opened(content))
        self._committed, self._trial = wanted, None

    def _rolled_back(self):
        if self._trial is None:
            return True
        try:
            self._rve.rollback()
        except NotImplementedError:
            return False
        return True

    def _sealed(self):
        return snapshot.seal(self._rve_class.engine, self._definition.id + self._rve.snapshot())

    def _opened(self, content):
        payload = snapshot.unseal(self._rve_class.engine, content)
        if payload[:16] != self._definition.id:
            raise SnapshotRefused(
                f"state of definition {short(payload)}, but this RVE is {short(self._definition.id)}"
            )
        return payload[16:]


class PathSource:
    """States are paths of committed targets; a state that no living RVE is at is solved again from the start.

    Keeps several RVEs alive, each at the end of one path, because going back costs a replay: as many as the worker
    serves Gauss points is best.
    """

    def __init__(self, rve_class, definition, most_alive):
        self._rve_class, self._definition, self._most_alive = rve_class, definition, most_alive
        self.initial = self._sealed(())
        self.initial_name = name_of(self.initial)
        #: Living RVEs, the least recently used first: path -> (rve, last step of its trial or None).
        self._alive = OrderedDict()
        self._alive[()] = (rve_class(definition), None)
        #: Trials that were solved again to rebuild a state.
        self.replayed = 0

    def solve(self, wanted, content, gradient, ask):
        """Answers from the state whose bytes are ``content``."""
        path = self._opened(content)
        rve = self._at(path)
        try:
            answer = rve.trial(gradient, ask)
        except RveError:
            # What the engine has half done is not trusted.
            rve.release()
            raise
        except Exception:
            rve.release()
            raise
        step = (numpy.ascontiguousarray(gradient, dtype="<f8").tobytes(), ask.ramp_steps)
        # Another one may have been left at this place, from a step that was taken back.
        if path in self._alive:
            self._alive.pop(path)[0].release()
        self._alive[path] = (rve, step)
        return answer, self._sealed(path + (step,))

    def close(self):
        """Ends all RVEs."""
        while self._alive:
            self._alive.popitem()[1][0].release()

    def _at(self, path):
        """Takes an RVE out of the living ones that stands at the end of ``path``."""
        if path and path[:-1] in self._alive and self._alive[path[:-1]][1] == path[-1]:
            rve, _ = self._alive.pop(path[:-1])
            try:
                rve.commit()
            except Exception:
                rve.release()
                raise
            return rve
        if path in self._alive:
            rve, trial = self._alive.pop(path)
            if trial is None:
                return rve
            try:
                rve.rollback()
                return rve
            except NotImplementedError:
                rve.release()
            except Exception:
                rve.release()
                raise
        while len(self._alive) >= self._most_alive:
            self._alive.popitem(last=False)[1][0].release()
        rve = self._rve_class(self._definition)
        try:
            for target, ramp_steps in path:
                rve.trial(numpy.frombuffer(target, "<f8").reshape(3, 3), TrialOptions(ramp_steps=ramp_steps))
                rve.commit()
                self.replayed += 1
        except Exception:
            rve.release()
            raise
        return rve

    def _sealed(self, path):
        steps = [[target, ramp_steps] for target, ramp_steps in path]
        return snapshot.seal(self._rve_class.engine, msgpack.packb([self._definition.id, steps], use_bin_type=True))

    def _opened(self, content):
        payload = snapshot.unseal(self._rve_class.engine, content)
        try:
            definition, steps = msgpack.unpackb(payload, raw=False)
            path = tuple((bytes(target), int(ramp_steps)) for target, ramp_steps in steps)
        except Exception as error:
            raise SnapshotRefused(f"not a path of committed targets: {error}") from error
        if definition != self._definition.id:
            raise SnapshotRefused(
                f"path of definition {short(definition)}, but this RVE is {short(self._definition.id)}"
            )
        if any(len(target) != 72 for target, _ in path):
            raise SnapshotRefused("a target of a path does not have nine components")
        return path
