"""Build hooks for `pip install .` at the root of a clone: those of the package, in its folder."""

import os
from pathlib import Path

os.chdir(Path(__file__).resolve().parents[1])

from grainspan_build import *  # noqa: E402, F403 (maturin looks for its settings in the current folder)
