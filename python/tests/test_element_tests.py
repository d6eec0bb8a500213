"""Element tests: the same bytes as the program, and the conditions that each test promises."""

import subprocess
import sys
import warnings

import numpy as np
import pytest
from conftest import CONTACT, DISCS, SPHERES

import grainspan

PRESSURE = 1.2e5


def test_rows_are_those_of_the_program(rve, tmp_path):
    (tmp_path / "test.toml").write_text(
        f"""packing = '{DISCS}'
contact = {{ modulus = 1e8, stiffness_ratio = 0.5, friction = 0.5 }}
rve = {{ accuracy = 'draft' }}
[[path]]
increments = 5
strain = {{ yy = -0.002 }}
stress = {{ xx = -1e5 }}
"""
    )
    command = [grainspan.executable(), "element", tmp_path / "test.toml", "--tangent", "truss_like", "--quiet"]
    expected = subprocess.run(command, check=True, capture_output=True).stdout
    segment = {"increments": 5, "strain": {"yy": -0.002}, "stress": {"xx": -1e5}}
    found = rve.path([segment], tangent="truss_like")
    written = grainspan.history.parse(expected)
    np.testing.assert_array_equal(found[written.columns].to_numpy(), written.to_numpy())


def test_drained_biaxial_keeps_the_lateral_stress(rve):
    rows = rve.triaxial(0.01, pressure=PRESSURE, increments=10)
    shearing = rows[rows["segment"] == 1]
    np.testing.assert_allclose(-shearing["sigma_xx"], PRESSURE, rtol=2e-3)
    assert len(shearing) == 10
    assert rows["axial_compression"].iloc[-1] == pytest.approx(0.01)
    assert rows["stress_ratio"].iloc[-1] > 0.3
    assert rows["axial_compression"].iloc[10] == pytest.approx(0.0, abs=1e-15), "origin: the end of the consolidation"


def test_constant_volume_is_kept(rve, spheres):
    for cell in (rve, spheres):
        rows = cell.undrained(0.005, increments=5)
        np.testing.assert_allclose(rows["volume_change"], 0.0, atol=1e-14)
        assert rows["axial_compression"].iloc[-1] == pytest.approx(0.005)
        assert rows["q"].iloc[-1] > rows["q"].iloc[0]


def test_triaxial_of_spheres_keeps_both_lateral_stresses(spheres):
    rows = spheres.triaxial(0.004, increments=4)
    for component in ("sigma_xx", "sigma_yy"):
        np.testing.assert_allclose(rows[component], rows[component].iloc[0], rtol=5e-3)
    assert rows["deviator"].iloc[-1] > 0 and len(rows["F_zz"]) == 5


def test_oedometer_has_no_lateral_strain_and_unloads_stiffer(rve):
    rows = rve.oedometer([2e5, 1.5e5], increments=5)
    np.testing.assert_array_equal(rows["F_xx"], 1.0)
    assert rows["axial_stress"].iloc[5] == pytest.approx(2e5, rel=5e-3)
    loading = rows["axial_compression"].iloc[5]
    recovered = loading - rows["axial_compression"].iloc[-1]
    assert 0 < recovered < 0.6 * loading
    assert rve.oedometer(axial_strain=1e-3, increments=2)["axial_compression"].iloc[-1] == pytest.approx(1e-3)


def test_simple_shear_keeps_the_normal_stress_or_the_height(rve):
    drained = rve.simple_shear(0.01, normal_stress=PRESSURE, increments=8)
    sheared = drained[drained["segment"] == 1]
    np.testing.assert_allclose(-sheared["sigma_yy"], PRESSURE, rtol=5e-3)
    assert sheared["shear_stress"].iloc[-1] > 0.2 * PRESSURE
    kept = rve.direct_shear(0.01, increments=4, constant_volume=True)
    np.testing.assert_array_equal(kept["F_yy"], 1.0)


def test_isotropic_compression_is_isotropic(rve):
    rows = rve.isotropic([1.5e5, 1.2e5], increments=4)
    assert rows["p"].iloc[4] == pytest.approx(1.5e5, rel=2e-3)
    assert rows["p"].iloc[-1] == pytest.approx(1.2e5, rel=2e-3)
    assert rows["q"].max() < 0.01 * 1.5e5


def test_mean_stress_is_kept(rve, spheres):
    for cell in (rve, spheres):
        pressure = 1.1 * cell.initial_pressure
        rows = cell.constant_mean_stress(0.004, pressure=pressure, increments=5)
        np.testing.assert_allclose(rows["p"].iloc[1:], pressure, rtol=1.001e-3)
        assert rows["axial_compression"].iloc[-1] == pytest.approx(0.004)
        assert rows["stress_ratio"].iloc[-1] > 0.2


def test_mean_stress_is_kept_where_cells_snap():
    """Loose discs and Hertzian spheres past the peak: increments are taken in parts, and jumps are counted."""
    hertz = {"law": "hertz_mindlin", "shear_modulus": 2.9e9, "poisson_ratio": 0.2, "friction": 0.5}
    for packing, contact in ((SPHERES, hertz), (DISCS, {**CONTACT, "friction": 0.3})):
        cell = grainspan.Rve(packing, contact, accuracy="draft")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            rows = cell.constant_mean_stress(0.03, pressure=1e5, increments=40)
        np.testing.assert_allclose(rows["p"].iloc[1:], 1e5, rtol=0.05)
        counts = rows.attrs["counts"]
        assert len(rows) == counts["rows"] and counts["trials"] > 40
        assert counts["dem_steps"] >= rows["dem_steps"].sum(), "trials of searches that failed count too"
        # Whoever is not looking at the counts is told.
        said = " ".join(str(warning.message) for warning in caught)
        assert ("snaps across" in said) == (counts["stress_jumps"] > 0)
        assert ("come to rest" in said) == (counts["not_equilibrated"] > 0)
        assert {"stress_jumps", "cut_increments"} <= set(counts)


def test_cycles_return_and_dissipate(rve):
    rows = rve.cyclic(1e-3, 2, increments=3)
    assert len(rows) == 1 + 3 * 8
    assert rows["axial_compression"].max() == pytest.approx(1e-3)
    assert rows["axial_compression"].min() == pytest.approx(-1e-3)
    assert rows["axial_compression"].iloc[-1] == pytest.approx(0.0, abs=1e-12)
    work = np.trapezoid(rows["deviator"], rows["axial_compression"])
    assert work > 0
    sheared = rve.cyclic(1e-3, 1, increments=2, shear=True, constant_volume=True)
    assert sheared["shear"].abs().max() == pytest.approx(1e-3)


def test_a_path_that_cannot_be_followed_keeps_its_rows(rve):
    far = {"increments": 3, "strain": {"yy": -0.01}, "stress": {"xx": -1e10}}
    with pytest.raises(grainspan.ElementTestStopped, match="use more increments") as stopped:
        rve.path([{"increments": 2, "strain": {"yy": -1e-4}}, far])
    assert len(stopped.value.history) == 3
    counts = stopped.value.history.attrs["counts"]
    assert counts["rows"] == 3 and counts["trials"] > 0 and counts["dem_steps"] > 0
    # A test by name has its own columns up to there, so that what was reached can be drawn and fitted.
    with pytest.raises(grainspan.ElementTestStopped) as stopped:
        rve.oedometer([2e5, 4e9], increments=4)
    reached = stopped.value.history
    assert reached["axial_stress"].iloc[4] == pytest.approx(2e5, rel=2e-3)
    assert len(reached.plot()) == 2


def test_input_errors_name_key_and_remedy(rve):
    with pytest.raises(grainspan.InputError, match="frictoin"):
        grainspan.Rve(DISCS, {**CONTACT, "frictoin": 0.5})
    with pytest.raises(grainspan.InputError, match="packing"):
        grainspan.Rve("none.json", CONTACT)
    with pytest.raises(grainspan.InputError, match="out of the plane"):
        rve.path([{"increments": 1, "strain": {"zz": -0.1}}])
    with pytest.raises(ValueError, match="choose one of none, truss_like"):
        rve.path([{"increments": 1, "strain": {"yy": -1e-5}}], tangent="stiff")


def test_what_no_test_can_follow_is_refused(rve):
    for wrong in ({"axial_strain": np.nan}, {"axial_strain": 1.5}, {"pressure": -1e5}, {"increments": 0}):
        with pytest.raises(grainspan.InputError, match=next(iter(wrong))):
            rve.constant_mean_stress(**wrong)
    with pytest.raises(grainspan.InputError, match="cycles"):
        rve.cyclic(1e-3, 0)
    for wrong in (1.0, -1.0, np.nan):
        with pytest.raises(grainspan.InputError, match="amplitude"):
            rve.cyclic(wrong)
    with pytest.raises(grainspan.InputError, match="increments"):
        rve.cyclic(1e-3, increments=0)


def test_a_half_turn_of_spheres_is_no_strain(spheres):
    # Against a quarter turn, in the axes of the cell: as given the packing is not quite at rest under this law.
    turns = np.diag([1.0, -1.0, -1.0]), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    half, quarter = (turn.T @ spheres.trial(F=turn).stress[0] @ turn for turn in turns)
    np.testing.assert_allclose(half, quarter, atol=1e-5 * np.abs(quarter).max())


def test_a_cell_answers_trials_and_keeps_its_state(rve):
    cell = grainspan.Rve(DISCS, DISCS.parents[1] / "scenes" / "biaxial-small.toml", accuracy="draft")
    H = [[0.0, 1e-4], [0.0, -2e-4]]
    before = cell.snapshot()
    result = cell.trial(H, observables=["fabric", "energy"])
    assert result.stress.shape == (1, 2, 2) and result.tangent.shape == (1, 2, 2, 2, 2)
    assert result.observables["fabric"].shape == (1, 2, 2) and result.observables["elastic_energy"][0] > 0
    assert cell.snapshot() == before
    cell.commit()
    after = cell.snapshot()
    cell.restore(before)
    np.testing.assert_array_equal(cell.trial(H).stress, result.stress)
    assert after != before
    F = np.eye(2) + H
    np.testing.assert_allclose(cell.trial(F=F).stress, result.stress, rtol=1e-6)


def test_the_tangent_by_the_gradient_is_the_derivative(rve):
    """Differences of the elastic response of lattice-like small steps, at the accuracy of a granular tangent."""
    cell = grainspan.Rve(DISCS, {**CONTACT, "friction": 1e6}, accuracy="tight")
    H = np.array([[1e-5, 0.0], [0.0, -2e-5]])
    moduli = cell.trial(H, tangent="truss_like", ramp_steps=200)
    step = 1e-8
    for k, m in np.ndindex(2, 2):
        change = np.zeros((2, 2))
        change[k, m] = step
        ends = [cell.trial(H + sign * change, tangent="none", ramp_steps=200).stress[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * step)
        found = moduli.tangent_by_gradient(H)[0, :, :, k, m]
        assert np.abs(found - difference).max() < 0.02 * np.abs(moduli.tangent).max()


def test_curves_are_drawn(rve):
    rows = rve.triaxial(1e-3, increments=2)
    axes = rows.plot()
    assert [ax.get_xlabel() for ax in axes] == ["axial compression, %"] * 2
    assert [ax.get_ylabel() for ax in axes] == ["stress ratio", "volume change, %"]
    assert axes[0].get_lines()[0].get_xdata()[-1] == pytest.approx(0.1)
    assert rve.oedometer([1.2e5], increments=2).plot()[0].get_xlabel() == "axial stress, kPa"
    assert rows.plot(x="axial_compression", y="q") is not None


def test_a_packing_that_is_not_at_rest_is_told():
    """The packing was made with the modulus of `CONTACT`; half of it leaves the cell far from rest."""
    cell = grainspan.Rve(DISCS, {**CONTACT, "modulus": 0.5 * CONTACT["modulus"]}, accuracy="draft")
    with pytest.warns(RuntimeWarning, match="brought to rest before the first increment"):
        rows = cell.path([{"increments": 1, "strain": {"yy": -1e-4}}])
    assert rows.attrs["counts"]["settled"] == 1


WARNED = """
import grainspan
cell = grainspan.Rve({discs!r}, {contact!r}, accuracy="draft")
for number in range(3):
    cell.oedometer(axial_strain=1e-4, increments=1)  # here
"""


def test_warnings_name_the_line_of_the_user_and_are_said_once(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(WARNED.format(discs=str(DISCS), contact={**CONTACT, "modulus": 0.5 * CONTACT["modulus"]}))
    done = subprocess.run([sys.executable, "-W", "default", script], capture_output=True, text=True, check=True)
    warned, line = done.stderr.strip().splitlines()
    assert warned.startswith(f"{script}:5: RuntimeWarning: the packing, or the frame cut out of it, was not at rest") and line.endswith("# here")


def test_a_test_that_stops_on_its_way_to_the_pressure_has_a_table(rve):
    from grainspan import _servo

    row = _servo._row(0, np.eye(2), _servo._trial(rve, np.zeros(2), 0), 0)
    table = _servo._table([row], 2, 1, {"rows": 1})
    assert len(table) == 1 and table.attrs["counts"] == {"rows": 1}
