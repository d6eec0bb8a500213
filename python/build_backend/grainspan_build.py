"""Build hooks of the package: those of maturin, after the executable of the workers has been built and laid into the package.

The executable and the extension module come from one Cargo workspace and one target folder, so that they share all compiled crates.
"""

import json
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import (
    get_requires_for_build_editable,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

_PACKAGE = Path(__file__).resolve().parents[1]
_WORKSPACE = _PACKAGE.parent


def _cargo(*arguments, **options):
    """Runs Cargo in the workspace."""
    try:
        return subprocess.run(["cargo", *arguments], cwd=_WORKSPACE, check=True, **options)
    except FileNotFoundError:
        raise SystemExit("building grainspan needs the Rust toolchain: there is no `cargo` on the path") from None


def _lay_executable():
    """Builds the program and copies it into the package."""
    _cargo("build", "--release", "--locked", "--package", "grainspan")
    metadata = _cargo("metadata", "--format-version", "1", "--no-deps", "--locked", capture_output=True)
    target = Path(json.loads(metadata.stdout)["target_directory"])
    place = _PACKAGE / "grainspan" / "bin" / "grainspan"
    place.parent.mkdir(exist_ok=True)
    place.unlink(missing_ok=True)
    shutil.copy2(target / "release" / "grainspan", place)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds a wheel that carries the executable."""
    _lay_executable()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds an editable wheel; the executable lies in the source folder of the package."""
    _lay_executable()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)
