"""Overhead of a batch of trials from Python: 64 points of 400 discs, relative to the evaluation itself.

    python overhead.py [--points 64] [--repeats 15]

With one worker the time of a call is the sum of: the cells and their tangents (as the worker measures them), messages and bookkeeping of
the pool, and Python with the conversion of arrays. The last line is what a call from Python adds to a call from Rust.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

import numpy as np

import grainspan

ROOT = Path(__file__).resolve().parents[2]


def measured(points: int, repeats: int, accuracy: str) -> dict[str, float]:
    """Medians over the repeats, s."""
    contact = {"modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.5}
    rows = []
    with grainspan.Pool(ROOT / "packings" / "discs-400.json", contact, accuracy=accuracy, workers=1) as pool:
        states = pool.states(points)
        share = 1.0 + 0.01 * np.arange(points)[:, None, None]
        for repeat in range(repeats + 1):
            # Another target every time: nothing is answered from memory.
            H = share * (1.0 + 0.001 * repeat) * np.array([[3e-5, 1e-5], [0.0, -1e-4]])
            inside = pool.statistics["wall_s"]
            begin = time.perf_counter()
            result = pool.trial(states, H, observables=["fabric", "sliding_fraction"])
            total = time.perf_counter() - begin
            rows.append((total, pool.statistics["wall_s"] - inside, result.seconds.sum()))
    # The first call sends the definition and fills caches.
    total, inside, cells = (statistics.median(column) for column in zip(*rows[1:]))
    return {"total": total, "pool": inside - cells, "python": total - inside, "cells": cells}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=15)
    arguments = parser.parse_args()
    for accuracy in ("draft", "default"):
        found = measured(arguments.points, arguments.repeats, accuracy)
        print(f"{arguments.points} points of 400 discs, accuracy {accuracy}: {1e3 * found['total']:.2f} ms a call")
        for name in ("cells", "pool", "python"):
            print(f"  {name:8} {1e3 * found[name]:9.3f} ms  {100 * found[name] / found['cells']:7.3f} % of the cells")


if __name__ == "__main__":
    main()
