"""Packings: assemblies of grains in a periodic cell."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import _toml
from ._program import end_with_parent, executable, not_started
from .errors import InputError


def _plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as JSON takes them."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written to a packing file")


class Packing:
    """An assembly of discs or spheres in a periodic cell.

    Parameters
    ----------
    data : mapping
        Content of a packing file, see docs/reference/formats.md. It may be changed: cells are made of what it holds then.
    path : path, optional
        The file.
    report : str, optional
        Acceptance report of its preparation.
    """

    def __init__(self, data: Mapping[str, Any], path: Path | None = None, report: str = "") -> None:
        self.data = dict(data)
        self.path = path
        self.report = report

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Packing:
        """Reads a packing file.

        Raises
        ------
        InputError
            It cannot be read or is no JSON. Everything else is checked where the packing is used.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"cannot read the packing {path}: {error}") from error
        if not isinstance(content, dict):
            raise InputError(f"cannot read the packing {path}: it is not an object of JSON")
        return cls(content, Path(path).absolute())

    @property
    def dimension(self) -> int:
        """2 for discs, 3 for spheres."""
        return int(self.data["dimension"])

    @property
    def positions(self) -> np.ndarray:
        """Centres of the grains, m, shape (n, dimension)."""
        return np.array(self.data["grains"])[:, : self.dimension]

    @property
    def radii(self) -> np.ndarray:
        """Radii of the grains, m."""
        return np.array(self.data["grains"])[:, self.dimension]

    @property
    def cell_vectors(self) -> np.ndarray:
        """Vectors of the periodic cell, each a row, m."""
        return np.array(self.data["periodicity"])

    def __len__(self) -> int:
        return len(self.data["grains"])

    def __repr__(self) -> str:
        kind = "discs" if self.dimension == 2 else "spheres"
        return f"<Packing of {len(self)} {kind}{f' in {self.path}' if self.path else ''}>"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the packing to a file, which is its file from then on."""
        self.write(path)
        self.path = Path(path).absolute()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the packing to a file."""
        Path(path).write_text(json.dumps(self.data, default=_plain), encoding="utf-8")

    def is_as_in_its_file(self) -> bool:
        """Whether the file that the packing was read from, or saved to, still holds the same."""
        if self.path is None:
            return False
        try:
            return json.loads(self.path.read_text(encoding="utf-8")) == self.data
        except (OSError, ValueError):
            return False

    def plot(self, ax=None):
        """Draws the discs of a plane packing with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw.

        Returns
        -------
        matplotlib.axes.Axes
        """
        if self.dimension != 2:
            raise InputError("only discs are drawn; spheres can be shown with PyVista")
        import matplotlib.pyplot as plt
        from matplotlib.collections import EllipseCollection

        if ax is None:
            _, ax = plt.subplots()
        diameters = 2 * self.radii
        discs = EllipseCollection(
            diameters, diameters, 0, units="xy", offsets=self.positions, offset_transform=ax.transData,
            facecolor="0.8", edgecolor="0.3", linewidth=0.4,
        )
        ax.add_collection(discs)
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) @ self.cell_vectors
        ax.plot(*corners.T, color="0.3", linewidth=0.8)
        ax.set_aspect("equal")
        return ax


def pack(recipe: str | os.PathLike[str] | Mapping[str, Any], out: str | os.PathLike[str] | None = None, **keys: Any) -> Packing:
    """Prepares a packing from a recipe.

    Parameters
    ----------
    recipe : path or mapping
        Recipe file (TOML), or its keys: ``number``, ``seed``, ``pressure``, ``grading``, ``contact`` ...; all are described in
        docs/reference/keys-packing.md.
    out : path, optional
        Packing file to write.
    **keys
        Keys of the recipe to override, with dots replaced by two underscores: ``seed=7``, ``contact__friction=0.1``.

    Returns
    -------
    Packing
        With the acceptance report in ``report``.

    Raises
    ------
    InputError
        The recipe is not sound, or its targets cannot be reached.
    """
    # Known before the packing is made, which may take minutes.
    if out is not None and not Path(out).parent.is_dir():
        raise InputError(f"there is no folder {Path(out).parent} to write {Path(out).name} to")
    with tempfile.TemporaryDirectory(prefix="grainspan-") as folder:
        if isinstance(recipe, Mapping):
            source = Path(folder) / "recipe.toml"
            source.write_text(_toml.write(recipe), encoding="utf-8")
        else:
            source = Path(recipe)
        made = Path(folder) / "packing.json"
        command = [str(executable()), "pack", str(source), "--out", str(made)]
        for key, value in keys.items():
            command += ["--set", f"{key.replace('__', '.')}={_toml._value(value)}"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=end_with_parent)
        except OSError as error:
            raise not_started(command[0], error) from error
        if done.returncode != 0:
            raise InputError(done.stderr.strip())
        packing = Packing(json.loads(made.read_text(encoding="utf-8")), report=(done.stdout + done.stderr).strip())
    if out is not None:
        packing.save(out)
    return packing
