"""What hosts of the C library get: the library, the cell, and the variables by which the library finds its workers."""

import os
import sys
from pathlib import Path

import biaxial


def library() -> Path:
    """`libgrainspan_pool.so` as `cargo build --release -p grainspan -p grainspan-pool-c` leaves it, or GRAINSPAN_POOL_LIBRARY."""
    named = os.environ.get("GRAINSPAN_POOL_LIBRARY")
    path = Path(named) if named else biaxial.ROOT / "target" / "release" / "libgrainspan_pool.so"
    if not path.is_file():
        raise SystemExit(f"{path} is missing: cargo build --release -p grainspan -p grainspan-pool-c")
    return path.resolve()


def program() -> Path:
    """The executable next to the library, or GRAINSPAN_PROGRAM."""
    named = os.environ.get("GRAINSPAN_PROGRAM")
    path = Path(named) if named else library().with_name("grainspan")
    if not path.is_file():
        raise SystemExit(f"{path} is missing: cargo build --release -p grainspan -p grainspan-pool-c")
    return path.resolve()


def variables(folder: Path, workers: int) -> dict[str, str]:
    """The environment of the host, with the cell written into a folder."""
    cell = folder / "cell.toml"
    cell.write_text(biaxial.cell_text(), encoding="utf-8")
    return {
        **os.environ,
        "GRAINSPAN_PROGRAM": str(program()),
        "GRAINSPAN_CELL": str(cell),
        "GRAINSPAN_WORKERS": str(workers),
        "GRAINSPAN_RAMP_STEPS": str(biaxial.RAMP_STEPS),
    }


def ended(name: str, result, log: Path) -> None:
    """Stops with the end of its log if a host has failed."""
    if result.returncode:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()[-25:]
        sys.exit(f"{name} ended with {result.returncode}:\n" + "\n".join(lines))
