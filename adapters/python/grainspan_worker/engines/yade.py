"""Yade as an engine: ``python -m grainspan_worker.engines.yade --run RUN``.

Needs the interpreter for which Yade was built (Debian: ``/usr/bin/python3`` or a virtual environment made of it with
``--system-site-packages``). Plane problems with the linear law; snapshots are Yade's own scene files.

Masses are fictitious, proportional to the contact stiffness, so that every grain allows the same time step, which is 1.
A trial strains the cell in equal steps at the rate that the run asks for, holds it, and waits until Yade's own measure
of unbalanced force is below the tolerance.
"""

import glob
import math
import os
import struct
import sys
import tempfile
from pathlib import Path

import msgpack
import numpy

from grainspan_worker import Answer, NotFinite, main
from grainspan_worker.engines.frame import root
from grainspan_worker.engines.opaque_state import OpaqueStateRve
from grainspan_worker.engines.plane import anisotropy

#: Cundall's non-viscous damping of the grains' own motion.
DAMPING = 0.3
#: Mass over stiffness: ten times below the stability limit for seven contacts.
INERTIA = 10.0
#: Steps between two looks at the unbalanced force.
ROUND = 10


def _import_yade():
    """Yade lives outside the module path; YADE_PATH names its folder when it is not where Debian puts it."""
    # Sums over threads have no fixed order; workers are the parallelism.
    os.environ["OMP_NUM_THREADS"] = "1"
    found = glob.glob("/usr/lib/*/yade/py") + glob.glob("/usr/lib/*/yade-double/py")
    sys.path += [os.environ["YADE_PATH"]] if "YADE_PATH" in os.environ else found[:1]
    # What it says while it loads must not mix with the capabilities on standard output.
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    # A package of this very name must not be found in its place.
    here = str(Path(__file__).parent)
    sys.path[:] = [entry for entry in sys.path if entry != here]
    try:
        import yade
        import yade.utils
        import yade.wrapper
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
    return yade


yade = _import_yade()
wrapper, utils = yade.wrapper, yade.utils


class YadeRve(OpaqueStateRve):
    """One periodic cell of discs in Yade. Yade holds one scene at a time, so every trial loads the one it starts from."""

    engine = "yade"
    version = "2023.02"
    observables = ("fabric", "fabric_anisotropy", "sliding_fraction", "elastic_energy", "mean_rotation")

    def __init__(self, definition):
        super().__init__(definition)
        self.depth = 4.0 * float(definition.radii.max())
        self._build()
        self.committed = msgpack.packb([0.0, _save()])
        self.latest = None

    def trial(self, gradient, ask):
        """Loads the committed scene, strains it, relaxes it."""
        self.latest = None
        angle, scene = msgpack.unpackb(self.committed)
        strain, frame = self.stretch(angle, gradient)
        _load(scene)
        flags, ramp_steps, begun = set(), 0, wrapper.Omega().iter
        if gradient.any():
            ramp_steps = self.made_of.ramp_steps(strain, ask)
            if not self._move(strain, ramp_steps):
                flags.add("not_equilibrated")
            self.latest = msgpack.packb([frame.angle, _save()])
        else:
            flags.add("skipped_null_target")
            _look()
            self.latest = self.committed
        return self._answer(frame, ask, flags, ramp_steps, wrapper.Omega().iter - begun)

    def _build(self):
        """The packing as a scene: contacts are found without moving a grain, listed forces are set."""
        omega, made_of = wrapper.Omega(), self.made_of
        omega.reset()
        omega.periodic = True
        (ax, ay), (bx, by) = made_of.cell
        omega.cell.hSize = utils.Matrix3(ax, bx, 0, ay, by, 0, 0, 0, self.depth)
        material = wrapper.FrictMat(
            young=made_of.modulus or 1.0,
            poisson=made_of.stiffness_ratio,
            frictionAngle=math.atan(made_of.friction),
            density=made_of.density,
        )
        omega.materials.append(material)
        for (x, y), radius in zip(made_of.positions, made_of.radii):
            body = utils.sphere((x, y, 0.5 * self.depth), radius, material=material)
            body.state.blockedDOFs = "zXY"
            mass = INERTIA * float(made_of.normal_stiffness(radius, radius))
            body.state.mass = mass
            inertia = 0.5 * mass * radius**2
            body.state.inertia = utils.Vector3(inertia, inertia, inertia)
            omega.bodies.append(body)
        if made_of.modulus is None:
            stiffness = made_of.contact["normal_stiffness"]
            physics = wrapper.Ip2_FrictMat_FrictMat_FrictPhys(
                kn=utils.MatchMaker(algo="val", val=stiffness),
                ks=utils.MatchMaker(algo="val", val=made_of.stiffness_ratio * stiffness),
            )
        else:
            physics = wrapper.Ip2_FrictMat_FrictMat_FrictPhys()
        omega.dt = 1.0
        engines = [
            wrapper.ForceResetter(),
            wrapper.InsertionSortCollider(
                [wrapper.Bo1_Sphere_Aabb()],
                allowBiggerThanPeriod=True,
                verletDist=0.05 * float(made_of.radii.mean()),
            ),
            wrapper.InteractionLoop(
                # Lever arms end at the contact, as in docs/concepts/theory.md, not at the surface.
                [wrapper.Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False)],
                [physics],
                [wrapper.Law2_ScGeom_FrictPhys_CundallStrack()],
            ),
            wrapper.NewtonIntegrator(damping=DAMPING, dead=True),
        ]
        omega.engines = engines
        omega.step()
        self._set_listed_forces()
        engines[-1].dead = False

    def _set_listed_forces(self):
        listed = {}
        for i, j, _, force in self.made_of.contacts:
            listed[min(i, j), max(i, j)] = force
        for contact in wrapper.Omega().interactions:
            force = listed.get((min(contact.id1, contact.id2), max(contact.id1, contact.id2)))
            if contact.isReal and force is not None:
                limit = self.made_of.friction * contact.phys.normalForce.norm()
                force = min(max(force, -limit), limit)
                normal = contact.geom.normal
                # The shear force of Yade acts on the other grain.
                contact.phys.shearForce = utils.Vector3(force * normal[1], -force * normal[0], 0)

    def _move(self, strain, ramp_steps):
        """Strains in equal steps, then relaxes; False when the steps allowed did not suffice."""
        omega = wrapper.Omega()
        _rest()
        rate = numpy.zeros((3, 3))
        rate[:2, :2] = root(numpy.eye(2) + strain, ramp_steps)
        omega.cell.velGrad = utils.Matrix3(*rate.ravel())
        omega.run(ramp_steps, True)
        omega.cell.velGrad = utils.Matrix3.Zero
        tolerance, left = self.made_of.tolerance, self.made_of.max_steps
        while True:
            omega.run(ROUND, True)
            left -= ROUND
            unbalanced = utils.unbalancedForce(useMaxForce=True)
            if not math.isfinite(unbalanced) and _contacts():
                raise NotFinite(omega.iter)
            if unbalanced <= tolerance or not _contacts():
                return True
            if left <= 0:
                return False

    def _answer(self, frame, ask, flags, ramp_steps, steps):
        omega, made_of = wrapper.Omega(), self.made_of
        contacts = _contacts()
        stress = numpy.zeros((2, 2))
        if contacts:
            full = utils.getStress() * (self.depth / made_of.thickness)
            stress = numpy.array([[full[row, column] for column in range(2)] for row in range(2)])
        cell = omega.cell.hSize
        area = cell[0, 0] * cell[1, 1] - cell[0, 1] * cell[1, 0]
        overlap = [
            contact.geom.penetrationDepth / (2.0 * min(contact.geom.refR1, contact.geom.refR2)) for contact in contacts
        ]
        largest = max(overlap, default=0.0)
        if not contacts:
            flags.add("no_load_bearing_contacts")
        if largest > 0.1:
            flags.add("large_overlap")
        observed = {}
        if ask.wants("fabric") and contacts:
            directions = numpy.array([[contact.geom.normal[0], contact.geom.normal[1]] for contact in contacts])
            fabric = directions.T @ directions / len(contacts)
            observed["fabric"], observed["fabric_anisotropy"] = frame.to_lab(fabric), anisotropy(fabric)
        if ask.wants("sliding_fraction") and contacts:
            held = made_of.friction * (1.0 - 1e-3)
            sliding = [contact.phys.shearForce.norm() >= held * contact.phys.normalForce.norm() for contact in contacts]
            observed["sliding_fraction"] = sum(sliding) / len(sliding)
        if ask.wants("elastic_energy"):
            stored = 0.0
            for contact in contacts:
                physics = contact.phys
                stored += 0.5 * physics.normalForce.squaredNorm() / physics.kn
                if physics.ks > 0.0:
                    stored += 0.5 * physics.shearForce.squaredNorm() / physics.ks
            observed["elastic_energy"] = stored / (area * made_of.thickness)
        if ask.wants("mean_rotation"):
            turns = [body.state.rot()[2] for body in omega.bodies]
            observed["mean_rotation"] = sum(turns) / len(turns) + frame.angle
        return Answer(
            stress=frame.to_lab(stress),
            void_ratio=area / (math.pi * float((made_of.radii**2).sum())) - 1.0,
            coordination_number=2.0 * len(contacts) / len(made_of.radii),
            unbalanced_force_ratio=utils.unbalancedForce(useMaxForce=True) if contacts else 0.0,
            max_overlap_ratio=largest,
            volume_ratio=area / self.initial_area,
            observed=observed,
            flags=flags,
            force_evaluations=max(1, steps),
            ramp_steps=ramp_steps,
        )


def _contacts():
    return [contact for contact in wrapper.Omega().interactions if contact.isReal]


def _look():
    """One evaluation of the forces; nothing moves. A loaded scene has contacts but no forces."""
    newton = wrapper.Omega().engines[-1]
    newton.dead = True
    wrapper.Omega().step()
    newton.dead = False


def _rest():
    """Every trial starts from rest: velocities are no part of a quasi-static state."""
    for body in wrapper.Omega().bodies:
        body.state.vel, body.state.angVel = utils.Vector3.Zero, utils.Vector3.Zero


def _save():
    with tempfile.TemporaryDirectory(dir="/dev/shm", prefix="grainspan-yade-") as folder:
        path = os.path.join(folder, "scene.yade")
        wrapper.Omega().save(path, quiet=True)
        scene = Path(path).read_bytes()
    # The scene holds its steps per second, right behind its time: a clock has no place in a state.
    time, speed = (struct.pack("<d", value) for value in (wrapper.Omega().time, wrapper.Omega().speed))
    return scene.replace(time + speed, time + bytes(8), 1)


def _load(scene):
    with tempfile.TemporaryDirectory(dir="/dev/shm", prefix="grainspan-yade-") as folder:
        path = os.path.join(folder, "scene.yade")
        Path(path).write_bytes(scene)
        wrapper.Omega().load(path, quiet=True)


if __name__ == "__main__":
    main(YadeRve)
