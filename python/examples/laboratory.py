"""Contact parameters from a laboratory test: oedometric compression of Karlsruhe fine sand.

The test is OE12 of the database of Wichtmann and Triantafyllidis, "An experimental database for the development, calibration and
verification of constitutive models for sand with focus to cyclic loading", Acta Geotechnica 11 (2016) 739-774, two parts,
doi 10.1007/s11440-015-0402-z: a quartz sand of 0.14 mm, void ratio 0.722 before loading. data/karlsruhe-fine-sand-oe12.csv has its first
loading from 26 to 407 kPa, which is fitted, and the unloading after it, which is not: it shows what the fit is worth. Its rows equal
those of two public conversions of the authors' files (one is https://github.com/scigem/constitutive-models); void ratio and compression
agree with each other to 2e-5, and the void ratio before loading gives the relative density that is published for the test, 0.88.

    python laboratory.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

import grainspan

DATA = Path(__file__).resolve().parent / "data" / "karlsruhe-fine-sand-oe12.csv"
#: Axial stress at which the comparison begins; below it a specimen settles in its ring.
FIRST, HIGHEST = 25.852e3, 407.089e3
#: Shortening of the simulated test, beyond what the highest stress needs.
LOADING = 0.016
#: Quartz, except for its stiffness: spheres stand for angular grains, so that it is fitted too.
CONTACT = {"law": "hertz_mindlin", "poisson_ratio": 0.15, "density": 2650.0}
#: Packings at about the void ratio of the sand, 0.712 at the first stress; the friction of the preparation sets it.
RECIPE = {
    "dimension": 3,
    "number": 200,
    "pressure": 5e3,
    "stress_tolerance": 1e-3,
    "grading": {"distribution": "power_law", "smallest_radius": 5.5e-5, "largest_radius": 9.5e-5, "exponent": 1.0},
    "contact": {**CONTACT, "shear_modulus": 5.0e9, "friction": 0.25},
}


def measured() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Loading and unloading in the columns of an element test; compression counts from the first stress."""
    rows = pd.read_csv(DATA)
    compression = (rows.axial_compression_percent - rows.axial_compression_percent[0]) / 100
    curve = pd.DataFrame({"axial_stress": 1e3 * rows.axial_stress_kPa, "axial_compression": compression})
    turn = int(curve.axial_stress.idxmax())
    return curve.iloc[: turn + 1], curve.iloc[turn:].reset_index(drop=True)


def packings(seeds=(1, 2, 3)) -> list[grainspan.Packing]:
    """One packing for each seed."""
    return [grainspan.pack({**RECIPE, "seed": seed}) for seed in seeds]


def void_ratio(packing: grainspan.Packing) -> float:
    """Volume of the voids over that of the grains."""
    return abs(np.linalg.det(packing.cell_vectors)) / (4 / 3 * np.pi * packing.radii**3).sum() - 1


def oedometer(rve: grainspan.Rve) -> pd.DataFrame:
    """First loading without lateral strain. It begins below the first stress, from which compression counts, as in the laboratory."""
    return counted(rve.oedometer(axial_strain=LOADING, increments=40))


def counted(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with compression from the first stress on."""
    rows = rows.assign(axial_stress=-rows["sigma_zz"])
    loading = rows[rows["segment"] == 0]
    begin = np.interp(FIRST, loading["axial_stress"], loading["axial_compression"])
    return rows.assign(axial_compression=rows["axial_compression"] - begin)


def left_after_unloading(rve: grainspan.Rve) -> float:
    """Compression that is left when the highest stress has gone back to the first one."""
    up = oedometer(rve)
    highest = float(np.interp(HIGHEST, up["axial_stress"], up["axial_compression"] - up["axial_compression"].iloc[0]))
    down = {"increments": 40, "strain": {"zz": 0.6 * highest}}
    rows = counted(rve.path([{"increments": 40, "strain": {"zz": -highest}}, down]))
    back = rows[rows["segment"] == 1]
    return float(np.interp(FIRST, back["axial_stress"].iloc[::-1], back["axial_compression"].iloc[::-1]))


def fitted(cells: list[grainspan.Packing]) -> grainspan.Calibration:
    """Stiffness of the grains and friction."""
    guess = {"shear_modulus": (8e9, 2e9, 15e9), "friction": (0.5, 0.1, 0.9)}
    return grainspan.calibrate(
        cells, CONTACT, measured()[0], guess, oedometer, x="axial_stress", columns=("axial_compression",)
    )


if __name__ == "__main__":
    cells = packings()
    print("void ratios", ", ".join(f"{void_ratio(cell):.3f}" for cell in cells), "; of the sand 0.712")
    found = fitted(cells)
    for name, value in found.parameters.items():
        print(f"{name:14} {value:10.4g} +- {found.uncertainty[name]:.2g}")
    print(f"difference     {100 * found.error:.1f} % of the range, {found.evaluations} parameter sets")
    for tried in found.uncompared:
        print(f"no curve for   {', '.join(f'{name} {tried[name]:.4g}' for name in found.parameters)}: {tried['reason']}")
    cell = {**CONTACT, **found.parameters}
    left = np.mean([left_after_unloading(grainspan.Rve(one, cell, accuracy="draft")) for one in cells])
    print(f"after unloading {100 * left:.3f} % are left; of the sand {100 * measured()[1]['axial_compression'].iloc[-1]:.3f} %")
