"""Contact parameters from the curve of another program: the drained biaxial test of case A, computed by Yade and by LAMMPS.

Both curves come from the same packing with friction 0.5 and a normal stiffness of 1000, so that what a fit should find is known; the
programs had neither our contact detection nor our damping, and went on at a finite rate.

    python calibration.py        fits friction and stiffness to either curve
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

import grainspan

CASE = Path(__file__).resolve().parents[2] / "tests" / "data" / "case-a"
#: What the curves were computed with; dimensionless, as everything in case A.
TRUTH = {"friction": 0.5, "normal_stiffness": 1000.0}
#: Shortening up to which curves are compared: later a rounding of a position changes them by more than a per cent.
SHORTENING = 0.006


def measured(program: str) -> pd.DataFrame:
    """The curve of `yade` or `lammps` in the columns of an element test."""
    rows = pd.read_csv(CASE / f"drained-{program}.csv")
    pressure = -0.5 * (rows.sxx + rows.syy)
    curve = pd.DataFrame(
        {
            "axial_compression": 1.0 - rows.cell_yy / rows.cell_yy[0],
            "stress_ratio": (rows.sxx - rows.syy) / pressure,
            "volume_change": rows.cell_xx * rows.cell_yy / (rows.cell_xx[0] * rows.cell_yy[0]) - 1.0,
        }
    )
    return curve[curve.axial_compression < SHORTENING].iloc[1::2]


def biaxial(rve: grainspan.Rve) -> pd.DataFrame:
    """The laboratory test: shortening at a lateral stress of 1."""
    rows = rve.triaxial(SHORTENING, pressure=1.0, increments=12)
    return rows[rows["segment"] == 1]


def fitted(program: str) -> grainspan.Calibration:
    """Friction and stiffness from a first guess that is 40 % and 100 % away."""
    guess = {"friction": (0.3, 0.1, 0.9), "normal_stiffness": (2000.0, 300.0, 3000.0)}
    return grainspan.calibrate(CASE / "packing.json", {"stiffness_ratio": 0.5}, measured(program), guess, biaxial)


if __name__ == "__main__":
    for program in ("yade", "lammps"):
        found = fitted(program)
        for name, value in found.parameters.items():
            print(f"{program:8} {name:18} {value:10.4g} +- {found.uncertainty[name]:.2g}, computed with {TRUTH[name]:g}")
        print(f"{program:8} {'difference':18} {found.error:10.4f}, {found.evaluations} parameter sets")
