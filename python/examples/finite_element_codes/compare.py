"""Runs the biaxial test in several finite-element codes and lays their curves over each other.

python compare.py [HOST ...] [--workers N] [--out FOLDER]

Every host gets an environment of its own in target/finite-element-codes, from the usual package index. A host that cannot be had here is named with the
reason. With --out: finite-element-codes.csv and finite-element-codes.svg.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import biaxial

HERE = Path(__file__).resolve().parent
PLACE = biaxial.ROOT / "target" / "finite-element-codes"
WHEELS = biaxial.ROOT / "target" / "python-wheels"


class Missing(Exception):
    """Why a host cannot run here."""


@dataclass(frozen=True)
class Host:
    """How a host is started, and how well its curve must agree with that of the macro solver."""

    name: str
    script: str
    packages: tuple[str, ...] = ()
    #: Whether it needs the Python package, or the C library alone.
    needs_wheel: bool = True
    oldest: tuple[int, int] = (3, 10)
    #: Largest relative difference of a force.
    tolerance: float = 1e-8


REFERENCE = Host("macro-solver", "macro_solver.py")
HOSTS = {
    host.name: host
    for host in (
        Host("scikit-fem", "scikit_fem.py", ("scikit-fem", "scipy")),
        Host("dolfinx", "dolfinx_host.py", ("dolfinx-solver-real", "mpich", "scipy"), oldest=(3, 12)),
        Host("akantu", "akantu_host.py", ("akantu",)),
        Host("opengeosys", "opengeosys.py", ("ogs",), needs_wheel=False),
        # It prints seven digits.
        Host("calculix", "calculix.py", needs_wheel=False, tolerance=1e-6),
    )
}


def run(command, log: Path, **options) -> bool:
    """Whether a command has ended well; what it says goes to a file."""
    with log.open("a", encoding="utf-8") as room:
        return subprocess.run(command, stdout=room, stderr=subprocess.STDOUT, check=False, **options).returncode == 0


def interpreter(oldest: tuple[int, int]) -> str:
    """A Python that is new enough: this one, another on the path, or one that is installed next to this one."""
    if sys.version_info[:2] >= oldest:
        return sys.executable
    for minor in range(oldest[1], oldest[1] + 4):
        name = f"python{oldest[0]}.{minor}"
        for command in [name, *map(str, Path(sys.base_prefix).parent.glob(f"*/bin/{name}"))]:
            try:
                if subprocess.run([command, "-c", "import venv"], capture_output=True, check=False).returncode == 0:
                    return command
            except OSError:
                continue
    raise Missing(f"it needs Python {oldest[0]}.{oldest[1]} or newer")


def installs_elsewhere() -> bool:
    """Whether the installer of this environment can install into another (pip 22.3 or newer)."""
    try:
        major, minor = metadata.version("pip").split(".")[:2]
    except metadata.PackageNotFoundError:
        return False
    return (int(major), int(minor)) >= (22, 3)


def python_of(host: Host) -> str:
    """The interpreter of a host's environment, which is made if it is not there.

    Raises
    ------
    Missing
        Packages cannot be installed here.
    """
    folder = PLACE / host.name
    python, done, log = folder / "bin" / "python", folder / "complete", PLACE / f"{host.name}.log"
    wheels = sorted(WHEELS.glob("grainspan-*.whl"))
    if host.needs_wheel and not wheels:
        raise Missing(f"there is no wheel in {WHEELS}: pip wheel --no-deps --wheel-dir {WHEELS} ./python")
    PLACE.mkdir(parents=True, exist_ok=True)
    # A newer wheel makes a new environment.
    stamp = f"{wheels[-1].name} {wheels[-1].stat().st_mtime_ns}" if host.needs_wheel else "no wheel"
    if not done.exists() or done.read_text(encoding="utf-8") != stamp:
        log.unlink(missing_ok=True)
        base = interpreter(host.oldest)
        # The installer of this environment serves those of the same Python too, which takes a third of the time.
        serves = base == sys.executable and installs_elsewhere()
        if not run([base, "-m", "venv", "--clear", *(["--without-pip"] if serves else []), str(folder)], log):
            raise Missing(f"no environment can be made; see {log}")
        pip = [base, "-m", "pip", "--python", str(python)] if serves else [str(python), "-m", "pip"]
        packages = [*host.packages, *(("numpy", "pandas") if host.needs_wheel else ())]
        # Without byte code: most of what is installed is never imported.
        quiet = [*pip, "install", "--quiet", "--no-compile"]
        if packages and not run([*quiet, *packages], log):
            raise Missing(f"{', '.join(packages)} cannot be installed; see {log}")
        # Of the packages that the wheel depends on, those for drawing are left out.
        if host.needs_wheel and not run([*quiet, "--no-deps", str(wheels[-1])], log):
            raise Missing(f"{wheels[-1]} cannot be installed; see {log}")
        done.write_text(stamp, encoding="utf-8")
    return str(python)


def calculix() -> str:
    """The program `ccx`: that of GRAINSPAN_CALCULIX, or the one that has been built before, or a new one if GRAINSPAN_BUILD_CALCULIX is set.

    Raises
    ------
    Missing
        It is not there, or cannot be built.
    """
    named = os.environ.get("GRAINSPAN_CALCULIX")
    built = PLACE / "calculix" / "ccx"
    if named or built.exists():
        return named or str(built)
    if not os.environ.get("GRAINSPAN_BUILD_CALCULIX"):
        raise Missing("it is compiled only where GRAINSPAN_BUILD_CALCULIX is set, which takes minutes")
    result = subprocess.run([HERE / "build-calculix", built.parent], capture_output=True, text=True, check=False)
    if result.returncode:
        raise Missing(result.stderr.strip() or "build-calculix has failed")
    return str(built)


def curve(host: Host, workers: int = 1) -> biaxial.Curve:
    """The curve of a host.

    Raises
    ------
    Missing
        The host cannot be had here.
    RuntimeError
        It has failed.
    """
    variables = dict(os.environ)
    if host.name == "calculix":
        variables["GRAINSPAN_CALCULIX"], python = calculix(), sys.executable
    else:
        python = python_of(host)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "curve.json"
        command = [python, str(HERE / host.script), str(out), str(workers)]
        result = subprocess.run(command, capture_output=True, text=True, env=variables, check=False)
        if result.returncode:
            raise RuntimeError(f"{host.name}: {result.stdout[-2000:]}{result.stderr[-2000:]}")
        return biaxial.Curve.read(out)


def difference(found: biaxial.Curve, reference: biaxial.Curve) -> list[float]:
    """Relative differences of the forces."""
    if len(found.top_force) != len(reference.top_force):
        raise RuntimeError(f"{found.host} has {len(found.top_force)} rows, the reference {len(reference.top_force)}")
    return [one / other - 1.0 for one, other in zip(found.top_force, reference.top_force)]


def write(curves: list[biaxial.Curve], folder: Path) -> None:
    """The curves as a table and as a figure."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "hosts", "font.size": 9})
    import matplotlib.pyplot as plt

    reference = curves[0]
    with (folder / "finite-element-codes.csv").open("w", newline="", encoding="utf-8") as room:
        rows = csv.writer(room, lineterminator="\n")
        rows.writerow(["axial_compression", *(f"{one.host} {one.version} top_force_N_per_m" for one in curves)])
        rows.writerows(zip(reference.axial_compression, *(one.top_force for one in curves)))
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.6), layout="constrained")
    percent = [100.0 * one for one in reference.axial_compression]
    left.plot(percent, [-1e-3 * one for one in reference.top_force], color="0.2", label="Grainspan")
    for place, (one, mark) in enumerate(zip(curves[1:], "o^sDv")):
        # Every host marks rows of its own, so that all are seen.
        some = slice(place, None, len(curves) - 1)
        left.plot(percent[some], [-1e-3 * force for force in one.top_force[some]], mark, mfc="none", label=one.host)
        apart = [max(abs(value), 1e-16) for value in difference(one, reference)]
        right.semilogy(percent, apart, mark + "-", ms=3, lw=0.8, mfc="none", label=one.host)
    left.set(xlabel="axial compression, %", ylabel="force of the platen, kN per m")
    right.set(xlabel="axial compression, %", ylabel="relative difference from Grainspan", ylim=(1e-16, 1e-3))
    left.legend(), right.legend(ncols=2, loc="upper left")
    figure.savefig(folder / "finite-element-codes.svg", metadata={"Date": None})


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("hosts", nargs="*", default=list(HOSTS), metavar="HOST", help=", ".join(HOSTS))
    options.add_argument("--workers", type=int, default=1)
    options.add_argument("--out", type=Path)
    given = options.parse_args()
    unknown = [name for name in given.hosts if name not in HOSTS]
    if unknown:
        options.error(f"there is no host {', '.join(unknown)}; known are {', '.join(HOSTS)}")
    curves = [curve(REFERENCE, given.workers)]
    print(f"{'host':28} {'largest difference':>20} {'iterations':>10} {'points tried':>12} {'ms a point':>10} {'s in all':>8}")
    for name in [None, *given.hosts]:
        try:
            found = curves[0] if name is None else curve(HOSTS[name], given.workers)
        except Missing as reason:
            print(f"SKIPPED: {name}: {reason}")
            continue
        apart = max(map(abs, difference(found, curves[0])))
        each = 1e3 * (found.material_seconds or found.seconds) / max(found.trials, 1)
        title = f"{found.host} {found.version}"
        print(f"{title:28} {apart:20.1e} {sum(found.iterations):10} {found.trials:12} {each:10.2f} {found.seconds:8.1f}", flush=True)
        if name is not None:
            curves.append(found)
            if apart > HOSTS[name].tolerance:
                raise SystemExit(f"{name}: more than {HOSTS[name].tolerance} from the reference")
    if given.out:
        given.out.mkdir(parents=True, exist_ok=True)
        write(curves, given.out)


if __name__ == "__main__":
    main()
