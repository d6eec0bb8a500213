"""What an RVE is made of: packing, contact law and solver options, as a run sends them."""

from dataclasses import dataclass

import msgpack
import numpy

from .content import name_of
from .errors import DefinitionRefused

#: Strain per ramp step and force tolerance of the named accuracies of ``docs/reference/scene.md``.
ACCURACIES = {"draft": (5e-6, 1e-2), "default": (1e-6, 1e-3), "tight": (1e-7, 1e-7)}

#: Version of packings that hold nothing but what every engine reads, and what engines say that read the next one too.
PACKING_VERSION, ROLLING_MOMENTS = 1, "packing.rolling_moments"


def _given(table, key, default):
    """The value of a key; the default where it is missing or nil, which is how a definition leaves it open. Zero is a value."""
    value = table.get(key)
    return default if value is None else value


@dataclass(frozen=True)
class Definition:
    """A definition, read. SI units; in the plane, lengths per ``thickness``."""

    #: Hash of the bytes: the name under which the run knows it.
    id: bytes
    #: Space dimension, 2 or 3.
    dimension: int
    #: Out-of-plane thickness, m; stress is force sum over (cell area x thickness).
    thickness: float
    #: Periodicity vectors, each a row, m.
    cell: numpy.ndarray
    #: Grain centres, m, one row each.
    positions: numpy.ndarray
    #: Grain radii, m.
    radii: numpy.ndarray
    #: Contacts that already carry a tangential force: (i, j, cell shift of j, force). In the plane the force is one
    #: number along e rotated by +90 degrees, e from i to j, acting on i.
    contacts: list
    #: The table ``[contact]`` of the scene.
    contact: dict
    #: The table ``[rve]`` of the scene.
    options: dict

    @classmethod
    def read(cls, content, features=()):
        """Reads the bytes of a definition for an engine with these features; raises :class:`DefinitionRefused`."""
        try:
            parts = msgpack.unpackb(content, raw=False)
            packing = parts["packing"]
            version = int(packing["version"])
            if version != PACKING_VERSION and ROLLING_MOMENTS not in features:
                raise DefinitionRefused(
                    f"this engine reads packings of version {PACKING_VERSION}, this one is of version {version}: take a "
                    "packing without rolling_moments"
                )
            dimension = int(packing["dimension"])
            grains = numpy.array(packing["grains"], dtype=float)
            contacts = []
            for i, j, *rest in packing.get("contacts") or []:
                shift = tuple(int(value) for value in rest[:dimension])
                force = rest[dimension] if len(rest) == dimension + 1 else numpy.array(rest[dimension:], dtype=float)
                contacts.append((int(i), int(j), shift, force))
            return cls(
                id=name_of(content),
                dimension=dimension,
                thickness=float(packing["thickness"]),
                cell=numpy.array(packing["periodicity"], dtype=float),
                positions=grains[:, :dimension].copy(),
                radii=grains[:, dimension].copy(),
                contacts=contacts,
                contact=parts["contact"],
                options=parts.get("options") or {},
            )
        except DefinitionRefused:
            raise
        except Exception as error:
            raise DefinitionRefused(f"these bytes are not a definition of grains: {error!r}") from error

    @property
    def law(self):
        """Keyword of the contact law."""
        return _given(self.contact, "law", "linear")

    @property
    def friction(self):
        """Coulomb coefficient."""
        return float(self.contact["friction"])

    @property
    def stiffness_ratio(self):
        """k_t / k_n of the linear law."""
        return float(_given(self.contact, "stiffness_ratio", 0.0))

    @property
    def cohesion(self):
        """Cohesive overlap C of f_n = -k_n (overlap - C), m."""
        return float(_given(self.contact, "cohesion", 0.0))

    @property
    def rotations_free(self):
        """Whether grains rotate."""
        return _given(self.contact, "rotations", "free") == "free"

    @property
    def density(self):
        """Density of the grain material, kg/m3; quasi-static results do not depend on it."""
        return float(_given(self.contact, "density", 2650.0))

    @property
    def modulus(self):
        """E of k_n = 2 E R1 R2 / (R1 + R2), Pa; None when the stiffness is constant."""
        return self.contact.get("modulus")

    def normal_stiffness(self, first, second):
        """k_n of the linear law for grains of two radii (numbers or arrays), N/m."""
        if self.modulus is None:
            return self.contact["normal_stiffness"] + 0.0 * (first + second)
        return 2.0 * self.modulus * first * second / (first + second)

    @property
    def _named_accuracy(self):
        """Strain per ramp step and force tolerance of the accuracy."""
        return ACCURACIES[_given(self.options, "accuracy", "default")]

    @property
    def strain_per_step(self):
        """Largest strain component of one ramp step."""
        return _given(self.options, "strain_per_step", self._named_accuracy[0])

    @property
    def tolerance(self):
        """Value that the equilibrium criterion must reach. Energies are quadratic in the forces, and so are the named values then."""
        named = self._named_accuracy[1]
        return _given(self.options, "tolerance", named**2 if self.options.get("criterion") == "energy" else named)

    @property
    def max_steps(self):
        """Most relaxation steps after the ramp."""
        return _given(self.options, "max_steps", 20_000)

    @property
    def largest_target(self):
        """Largest strain of one trial."""
        return _given(self.options, "largest_target", 0.2)

    def ramp_steps(self, strain, ask):
        """Number of ramp increments for a strain: what the run asks, else by the strain per step."""
        if ask.ramp_steps:
            return ask.ramp_steps
        return max(5, int(numpy.ceil(numpy.abs(strain).max() / self.strain_per_step)))
