"""The biaxial test that every host computes: a block between rough platens under lateral pressure, with a cell of grains behind each of its
quadrature points. Small strains, four-node elements, two by two points, SI units, tension positive.

Here is what all hosts need: the numbers of the test, the cell, and the file that a host leaves. Newton's method goes to 1e-9 of the
reactions: the cell relaxes to 1e-9, and a step is one increment of the cell, so that no host depends on how another predicts its steps.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

#: Width and height, m, and elements along them.
SIZE, ELEMENTS = (0.05, 0.10), (2, 4)
#: Lateral pressure, Pa, on the initial sides.
PRESSURE = 1e5
#: Downward displacement of the upper platen per step, m, and number of steps. The first row of a curve is the rest before them.
STEP, STEPS = 1.5e-5, 20
#: Largest out-of-balance force over the largest reaction.
TOLERANCE = 1e-9

ROOT = Path(__file__).resolve().parents[3]
PACKING = ROOT / "packings" / "discs-100.json"
CONTACT = {"modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.5}
RVE = {"strain_per_step": 0.01, "tolerance": 1e-9}
#: Increments in which a cell applies the strain of a step. In all hosts the same.
RAMP_STEPS = 1
SCENE = ROOT / "scenes" / "biaxial-small.toml"


def cell_text() -> str:
    """The cell as a TOML file, for hosts that read it through the environment variable GRAINSPAN_CELL."""
    table = lambda values: "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"  # noqa: E731
    return f"packing = '{PACKING}'\ncontact = {table(CONTACT)}\nrve = {table(RVE)}\n"


@dataclass
class Curve:
    """What a host leaves: shortening over height, force of the upper platen (N per metre of thickness), and its cost.

    ``trials`` counts evaluations of points; ``material_seconds`` is spent in them, as the host sees it.
    """

    host: str
    version: str
    axial_compression: list[float] = field(default_factory=list)
    top_force: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    trials: int = 0
    material_seconds: float = 0.0
    seconds: float = 0.0

    def add(self, step: int, force: float, iterations: int) -> None:
        """A row at the end of a step."""
        self.axial_compression.append(step * STEP / SIZE[1])
        self.top_force.append(float(force))
        self.iterations.append(int(iterations))

    def write(self, path: str | Path) -> None:
        """Writes everything as JSON."""
        Path(path).write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: str | Path) -> Curve:
        """Reads what ``write`` has written."""
        return cls(**json.loads(Path(path).read_text(encoding="utf-8")))


class Grains:
    """The points of a host in Python: a batch of trials in a call, counted and timed."""

    def __init__(self, points: int, workers: int, tangent: str = "truss_like_slip") -> None:
        import grainspan

        self.tangent = tangent
        self.pool = grainspan.Pool(PACKING, CONTACT, rve=RVE, workers=workers)
        self.states = self.pool.states(points)
        self.trials, self.seconds = 0, 0.0

    def evaluate(self, strains):
        """Stresses (n, 2, 2) and moduli (n, 2, 2, 2, 2) for the strains of the step, (n, 2, 2)."""
        begin = time.perf_counter()
        result = self.pool.trial(self.states, strains, tangent=self.tangent, ramp_steps=RAMP_STEPS)
        moduli = result.tangent_by_gradient(strains)
        self.seconds += time.perf_counter() - begin
        self.trials += len(self.states)
        return result.stress, moduli

    def commit(self) -> None:
        """Ends the step."""
        self.pool.commit(self.states)
