"""Examples and notebooks run, and the coupling agrees with the program."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

EXAMPLES = ROOT / "python" / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def test_a_coupled_finite_element_code_agrees_with_the_program(tmp_path):
    """Same specimen, small strains, cells and ramps; both in balance within 1e-9 of the reactions."""
    pytest.importorskip("skfem")
    sys.path.insert(0, str(EXAMPLES))
    import coupled_biaxial

    own, reference = coupled_biaxial.compared(ROOT / "scenes" / "biaxial-small.toml", tmp_path / "out")
    np.testing.assert_allclose(own, reference, rtol=1e-8, atol=1e-12)


def test_a_step_that_every_cell_refuses_is_not_halved_for_ever(monkeypatch):
    pytest.importorskip("skfem")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import coupled_biaxial

    import grainspan

    steps = []

    def refuse(self, shortening, guess, tolerance):
        steps.append(shortening)
        raise grainspan.TrialRefused("inside out", 0, True)

    monkeypatch.setattr(coupled_biaxial.Coupling, "step", refuse)
    coupling = object.__new__(coupled_biaxial.Coupling)
    with pytest.raises(RuntimeError, match="smaller steps do not help: inside out"):
        coupling.divided(1.0, None, 1e-9)
    # The whole step and eight halves of it.
    assert steps == [0.5**number for number in range(9)]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(notebook: Path):
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    pytest.importorskip("skfem")
    book = nbformat.read(notebook, as_version=4)
    client.NotebookClient(book, timeout=300, resources={"metadata": {"path": str(EXAMPLES)}}).execute()


def test_notebooks_are_found():
    assert len(NOTEBOOKS) >= 3
    for notebook in NOTEBOOKS:
        text = notebook.read_text(encoding="utf-8")
        assert '"output_type": "error"' not in text and "/site-packages/" not in text
        assert '"execution_count": null' not in text, "notebooks are committed with their results"
