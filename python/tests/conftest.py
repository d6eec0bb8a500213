"""Inputs that several tests use."""

from pathlib import Path

import matplotlib
import pytest

import grainspan

matplotlib.use("Agg")

ROOT = Path(__file__).resolve().parents[2]
DISCS = ROOT / "packings" / "discs-100.json"
SPHERES = ROOT / "packings" / "spheres-100.json"
CONTACT = {"modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.5}


@pytest.fixture(scope="session")
def rve():
    """The small cell of discs, for element tests."""
    return grainspan.Rve(DISCS, CONTACT, accuracy="draft")


@pytest.fixture(scope="session")
def spheres():
    """The small cell of spheres."""
    return grainspan.Rve(SPHERES, CONTACT, accuracy="draft")


@pytest.fixture
def pool():
    """Two workers with the small cell of discs."""
    with grainspan.Pool(DISCS, CONTACT, accuracy="draft", workers=2) as opened:
        yield opened
