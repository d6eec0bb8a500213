"""The reference engine: periodic cells of discs in NumPy, small enough to be read in one sitting.

Linear contacts with Coulomb friction, in the conventions of ``docs/concepts/theory.md``: a contact joins an origin and an end
grain, ``b`` leads from centre to centre, ``e = b / |b|``, ``t`` is ``e`` turned by +90 degrees, and the end grain exerts
``f = f_n e + f_t t`` on the origin, ``f_n < 0`` in compression. Masses are fictitious and the time step is 1: only the
end of the motion matters. Serve a run with it by ``python -m grainspan_worker.engines.reference --run RUN``.
"""

import msgpack
import numpy

from grainspan_worker import Answer, NotFinite, Rve, TargetTooLarge, Unsupported, main
from grainspan_worker.engines.plane import anisotropy, lasting, polar, rotation

#: Local damping: a force that drives a grain is lessened by this share, one that brakes it is raised.
DAMPING = 0.5
#: Inertia in units of a grain's contact stiffness. Seven contacts on one grain keep the step below the stability limit.
INERTIA = 10.0
#: Pairs are listed up to this gap, in mean radii, and listed anew when grains may have closed it.
SKIN = 0.1
#: Share of the Coulomb limit from which on a contact counts as sliding.
AT_LIMIT = 1.0 - 1e-3


class State:
    """Everything that can influence later answers."""

    def __init__(self, cell, positions, angles, pairs, tangential, dissipation):
        self.cell = cell  # periodicity vectors, rows
        self.positions = positions  # centres, not wrapped
        self.angles = angles  # rotations since the start
        self.pairs = pairs  # touching pairs: origin, end, and the cell shift of the end, rows in order
        self.tangential = tangential  # their tangential forces
        self.dissipation = dissipation  # work lost to friction since the start, J

    def to_bytes(self):
        """All arrays, bit for bit."""
        parts = [self.cell, self.positions, self.angles, self.pairs, self.tangential, numpy.array(self.dissipation)]
        return msgpack.packb([part.tobytes() for part in parts], use_bin_type=True)

    @classmethod
    def from_bytes(cls, content):
        """The reverse."""
        cell, positions, angles, pairs, tangential, dissipation = msgpack.unpackb(content)
        return cls(
            numpy.frombuffer(cell).reshape(2, 2),
            numpy.frombuffer(positions).reshape(-1, 2),
            numpy.frombuffer(angles),
            numpy.frombuffer(pairs, int).reshape(-1, 4),
            numpy.frombuffer(tangential),
            float(numpy.frombuffer(dissipation)[0]),
        )


class ReferenceRve(Rve):
    """One periodic cell of discs."""

    engine = "reference"
    version = "1"
    #: The work of the damping is not counted.
    observables = (
        "first_piola",
        "fabric",
        "fabric_anisotropy",
        "coordination_number_no_rattlers",
        "sliding_fraction",
        "elastic_energy",
        "frictional_dissipation",
        "mean_rotation",
    )

    def __init__(self, definition):
        if not definition.rotations_free:
            raise Unsupported("rotations = \"blocked\"")
        self.made_of = definition
        self.radii, self.thickness = definition.radii, definition.thickness
        self.initial_area = numpy.linalg.det(definition.cell)
        listed = sorted(_canonical(*contact) for contact in definition.contacts)
        pairs = numpy.array([contact[:4] for contact in listed], int).reshape(-1, 4)
        tangential = numpy.array([contact[4] for contact in listed], float)
        given = State(definition.cell, definition.positions, numpy.zeros(len(self.radii)), pairs, tangential, 0.0)
        # One evaluation finds the contacts and cuts listed forces to the Coulomb limit; nothing moves.
        self.committed = Motion(self, given).state()
        self.latest = None

    def trial(self, gradient, ask):
        """Stretches the cell in small steps, lets the grains relax, turns the result."""
        self.latest = None
        if not numpy.array_equal(gradient[2], [0, 0, 0]) or gradient[:2, 2].any():
            raise Unsupported("deformation out of the plane")
        angle, strain = polar(gradient)
        if numpy.linalg.norm(strain) > self.made_of.largest_target:
            raise TargetTooLarge(numpy.linalg.norm(strain), self.made_of.largest_target)
        motion = Motion(self, self.committed)
        flags, steps = set(), 0
        if gradient.any():
            steps = self.made_of.ramp_steps(strain, ask)
            for step in range(steps):
                before = numpy.eye(2) + (step / steps) * strain
                motion.step(numpy.eye(2) + strain / steps @ numpy.linalg.inv(before))
            if not motion.relax(self.made_of.tolerance, self.made_of.max_steps):
                flags.add("not_equilibrated")
            motion.turn(angle)
        else:
            flags.add("skipped_null_target")
        self.latest = motion.state()
        return self._answer(motion, gradient, ask, flags, steps)

    def commit(self):
        """The trial state becomes the committed state."""
        self.committed, self.latest = self.latest, None

    def rollback(self):
        """Nothing but the trial state is dropped: the committed state was never touched."""
        self.latest = None

    def snapshot(self):
        """Bytes of the latest state."""
        return (self.latest or self.committed).to_bytes()

    def restore(self, content):
        """Takes over a committed state."""
        self.committed, self.latest = State.from_bytes(content), None

    def _answer(self, motion, gradient, ask, flags, ramp_steps):
        area, count = motion.area(), len(self.radii)
        touching = len(motion.overlap)
        if touching == 0:
            flags.add("no_load_bearing_contacts")
        overlap_ratio = (motion.overlap / (2.0 * motion.smaller_radius)).max(initial=0.0)
        if overlap_ratio > 0.1:
            flags.add("large_overlap")
        grains = numpy.pi * (self.radii**2).sum()
        stress = motion.stress()
        observed = {}
        if ask.wants("first_piola"):
            f = numpy.eye(2) + gradient[:2, :2]
            observed["first_piola"] = numpy.linalg.det(f) * stress @ numpy.linalg.inv(f).T
        if ask.wants("fabric") and touching:
            fabric = motion.direction.T @ motion.direction / touching
            observed["fabric"], observed["fabric_anisotropy"] = fabric, anisotropy(fabric)
        if ask.wants("sliding_fraction") and touching:
            observed["sliding_fraction"] = float(motion.at_limit().mean())
        if ask.wants("elastic_energy"):
            volume = area * self.thickness
            observed["elastic_energy"] = motion.elastic_energy() / volume
            observed["frictional_dissipation"] = motion.dissipation / volume
        if ask.wants("mean_rotation"):
            observed["mean_rotation"] = motion.angles.mean()
        if ask.wants("coordination_number_no_rattlers"):
            alive, kept = lasting(count, motion.origin, motion.end)
            observed["coordination_number_no_rattlers"] = 2.0 * kept.sum() / max(1, alive.sum())
        return Answer(
            stress=stress,
            void_ratio=area / grains - 1.0,
            coordination_number=2.0 * touching / count,
            unbalanced_force_ratio=motion.unbalanced(),
            max_overlap_ratio=overlap_ratio,
            volume_ratio=area / self.initial_area,
            observed=observed,
            flags=flags,
            force_evaluations=motion.evaluations,
            ramp_steps=ramp_steps,
        )


class Motion:
    """Grains on their way from one state to another; ends as a state."""

    def __init__(self, rve, state):
        self.rve, self.made_of, self.radii = rve, rve.made_of, rve.radii
        self.cell, self.positions, self.angles = state.cell.copy(), state.positions.copy(), state.angles.copy()
        self.dissipation, self.evaluations = state.dissipation, 0
        self.velocity, self.spin = numpy.zeros_like(self.positions), numpy.zeros_like(self.angles)
        stiffness = self.made_of.normal_stiffness(self.radii, self.radii.mean())
        self.mass = INERTIA * stiffness
        self.inertia = 0.5 * self.mass * self.radii**2
        self._list_pairs()
        # History of the listed pairs: tangential force, and the direction at the last evaluation if they touched then.
        self.history, self.last_direction = self._history(state.pairs, state.tangential, None), None
        self._evaluate()

    def step(self, affine):
        """One increment: the affine motion of the cell, and each grain's own motion beside it."""
        force, moment = self.force, self.moment
        # Damping acts on a grain's own motion only: damping the affine part would resist the strain.
        self.velocity += (force - DAMPING * numpy.abs(force) * numpy.sign(self.velocity)) / self.mass[:, None]
        self.spin += (moment - DAMPING * numpy.abs(moment) * numpy.sign(self.spin)) / self.inertia
        self.positions = self.positions @ affine.T + self.velocity
        self.cell = self.cell @ affine.T
        self.angles = self.angles + self.spin
        self._wander(affine)
        self._evaluate()

    def relax(self, tolerance, most_steps):
        """Holds the cell until the grains are in balance; False when the steps did not suffice."""
        still = numpy.eye(2)
        for step in range(most_steps):
            if step >= 10 and self.unbalanced() <= tolerance:
                return True
            self.step(still)
        return self.unbalanced() <= tolerance

    def turn(self, angle):
        """Turns everything; no force changes but its direction."""
        if angle != 0.0:
            turned = rotation(angle)
            self.positions, self.cell = self.positions @ turned.T, self.cell @ turned.T
            self.angles = self.angles + angle
            self.branch, self.direction = self.branch @ turned.T, self.direction @ turned.T

    def state(self):
        """Where the motion has come to."""
        pairs = numpy.column_stack([self.origin, self.end, self.shift])
        parts = self.cell, self.positions, self.angles, pairs, self.tangential, self.dissipation
        return State(*(numpy.array(part) if isinstance(part, numpy.ndarray) else part for part in parts))

    def area(self):
        """Cell area, m2."""
        return numpy.linalg.det(self.cell)

    def stress(self):
        """Mean Cauchy stress, Pa: sum of f x b over the contacts, per volume."""
        normal = numpy.column_stack([-self.direction[:, 1], self.direction[:, 0]])
        force = self.normal[:, None] * self.direction + self.tangential[:, None] * normal
        return force.T @ self.branch / (self.area() * self.rve.thickness)

    def unbalanced(self):
        """Largest unbalanced force, or moment over radius, over the mean normal contact force."""
        if len(self.normal) == 0:
            return 0.0
        largest = max(numpy.hypot(*self.force.T).max(), (numpy.abs(self.moment) / self.radii).max())
        if not numpy.isfinite(largest):
            raise NotFinite(self.evaluations)
        return 0.0 if largest == 0.0 else largest / numpy.abs(self.normal).mean()

    def at_limit(self):
        """Which contacts slide."""
        return numpy.abs(self.tangential) >= AT_LIMIT * self.made_of.friction * self.stiffness * self.overlap

    def elastic_energy(self):
        """Energy stored in the contacts, J."""
        adhesion = self.stiffness * self.made_of.cohesion
        stored = 0.5 * (self.normal**2 - adhesion**2) / self.stiffness
        if self.made_of.stiffness_ratio > 0.0:
            stored = stored + 0.5 * self.tangential**2 / (self.made_of.stiffness_ratio * self.stiffness)
        return stored.sum()

    def _evaluate(self):
        """All contact forces: finds the touching pairs and carries their tangential forces along."""
        origin, end = self.listed[:, 0], self.listed[:, 1]
        branch = self.positions[end] + self.listed[:, 2:] @ self.cell - self.positions[origin]
        length = numpy.hypot(branch[:, 0], branch[:, 1])
        overlap = self.radii[origin] + self.radii[end] - length
        direction = branch / length[:, None]
        stiffness = self.listed_stiffness
        arms = self.radii[origin] - 0.5 * overlap, self.radii[end] - 0.5 * overlap
        tangential = numpy.where(numpy.isnan(self.history), 0.0, self.history)
        if self.last_direction is not None:
            # A pair that touched before has slid by the turn of its branch less the rolling of its grains.
            last = self.last_direction
            slip = length * (last[:, 0] * direction[:, 1] - last[:, 1] * direction[:, 0])
            slip -= arms[0] * self.spin[origin] + arms[1] * self.spin[end]
            slip[numpy.isnan(self.history)] = 0.0
            tangential = tangential + self.made_of.stiffness_ratio * stiffness * slip
        limit = self.made_of.friction * stiffness * numpy.maximum(overlap, 0.0)
        held = numpy.clip(tangential, -limit, limit)
        touching = overlap > 0.0
        if self.made_of.stiffness_ratio > 0.0:
            lost = (tangential - held) * held / (self.made_of.stiffness_ratio * stiffness)
            self.dissipation += float(lost[touching].sum()) if self.evaluations else 0.0
        # What does not touch has no history (NaN) and no direction to remember.
        self.history = numpy.where(touching, held, numpy.nan)
        self.last_direction = direction
        self.origin, self.end, self.shift = origin[touching], end[touching], self.listed[touching, 2:]
        self.branch, self.direction, self.overlap = branch[touching], direction[touching], overlap[touching]
        self.stiffness, self.tangential = stiffness[touching], held[touching]
        self.normal = -self.stiffness * (self.overlap - self.made_of.cohesion)
        self.smaller_radius = numpy.minimum(self.radii[self.origin], self.radii[self.end])
        self._sum_loads(arms[0][touching], arms[1][touching])
        self.evaluations += 1

    def _sum_loads(self, origin_arm, end_arm):
        count = len(self.radii)
        force = self.normal[:, None] * self.direction
        force[:, 0] -= self.tangential * self.direction[:, 1]
        force[:, 1] += self.tangential * self.direction[:, 0]
        self.force = numpy.column_stack(
            [
                numpy.bincount(self.origin, force[:, axis], count) - numpy.bincount(self.end, force[:, axis], count)
                for axis in range(2)
            ]
        )
        self.moment = numpy.bincount(self.origin, self.tangential * origin_arm, count)
        self.moment += numpy.bincount(self.end, self.tangential * end_arm, count)

    def _wander(self, affine):
        """Lists the pairs anew when the gap that the list allows for may have been closed."""
        gap = SKIN * self.radii.mean()
        stretch = numpy.abs(affine - numpy.eye(2)).sum() * (2.0 * self.radii.max() + gap)
        self.wandered += 2.0 * numpy.hypot(*self.velocity.T).max() + stretch
        if not numpy.isfinite(self.wandered):
            raise NotFinite(self.evaluations)
        if self.wandered > gap:
            touched = ~numpy.isnan(self.history)
            pairs, history, direction = self.listed[touched], self.history[touched], self.last_direction[touched]
            self._list_pairs()
            self.history = self._history(pairs, history, direction)

    def _list_pairs(self):
        """All pairs, images included, whose gap is below the skin, in order."""
        reach = 2.0 * self.radii.max() + SKIN * self.radii.mean()
        widths = self.area() / numpy.hypot(*self.cell[::-1].T)
        fractions = self.positions @ numpy.linalg.inv(self.cell)
        spread = numpy.floor(fractions).astype(int)
        inside = fractions - spread
        around = [int(numpy.ceil(reach / width)) + 1 for width in widths]
        count, found = len(self.radii), []
        for first in range(-around[0], around[0] + 1):
            for second in range(-around[1], around[1] + 1):
                separation = (inside[None, :, :] + [first, second] - inside[:, None, :]) @ self.cell
                near = numpy.hypot(separation[..., 0], separation[..., 1])
                gap = near - self.radii[:, None] - self.radii[None, :]
                i, j = numpy.nonzero(gap < SKIN * self.radii.mean())
                shift = numpy.array([first, second]) - spread[j] + spread[i]
                # Each pair once: the lower grain is the origin; of a grain's own images, the upper half.
                own = (i == j) & ((shift[:, 0] > 0) | ((shift[:, 0] == 0) & (shift[:, 1] > 0)))
                once = (i < j) | own
                found.append(numpy.column_stack([i, j, shift])[once])
        listed = numpy.concatenate(found)
        self.listed = listed[numpy.lexsort(listed.T[::-1])]
        self.listed_stiffness = self.made_of.normal_stiffness(
            self.radii[self.listed[:, 0]], self.radii[self.listed[:, 1]]
        )
        self.wandered = 0.0

    def _history(self, pairs, tangential, direction):
        """History of the listed pairs from that of some pairs; those that are not among them have none."""
        known = {tuple(pair): place for place, pair in enumerate(pairs.tolist())}
        history = numpy.full(len(self.listed), numpy.nan)
        if direction is not None:
            self.last_direction = numpy.zeros((len(self.listed), 2))
        for row, pair in enumerate(map(tuple, self.listed.tolist())):
            place = known.get(pair)
            if place is not None:
                history[row] = tangential[place]
                if direction is not None:
                    self.last_direction[row] = direction[place]
        return history


def _canonical(i, j, shift, force):
    """The pair with the lower grain first; the tangential component is the same seen from either grain."""
    if i < j or (i == j and shift > (0, 0)):
        return (i, j, *shift, force)
    return (j, i, -shift[0], -shift[1], force)


if __name__ == "__main__":
    main(ReferenceRve)
