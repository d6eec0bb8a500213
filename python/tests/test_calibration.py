"""Parameters of a synthetic curve are found again."""

import sys

import numpy as np
import pytest
from conftest import CONTACT, DISCS, ROOT

import grainspan


def biaxial(rve):
    """The laboratory test of this file."""
    rows = rve.triaxial(0.02, pressure=1e5, increments=10)
    return rows[rows["segment"] == 1]


def test_parameters_of_a_synthetic_curve_are_recovered():
    truth = {"friction": 0.35, "modulus": 0.8e8}
    target = biaxial(grainspan.Rve(DISCS, {**CONTACT, **truth}, accuracy="draft"))
    found = grainspan.calibrate(
        DISCS,
        {"stiffness_ratio": 0.5},
        target,
        {"friction": (0.6, 0.1, 0.9), "modulus": (1.3e8, 0.4e8, 2e8)},
        biaxial,
    )
    assert found.error < 0.02, found
    assert found.parameters["friction"] == pytest.approx(0.35, rel=0.05)
    assert found.parameters["modulus"] == pytest.approx(0.8e8, rel=0.05)
    assert found.evaluations == len(found.trace) and set(found.uncertainty) == set(truth)


def test_parameters_behind_the_curve_of_another_program_are_found():
    """Case A by Yade, which was computed with friction 0.5 and a normal stiffness of 1000."""
    sys.path.insert(0, str(ROOT / "python" / "examples"))
    import calibration

    found = calibration.fitted("yade")
    for name, truth in calibration.TRUTH.items():
        assert found.parameters[name] == pytest.approx(truth, rel=0.1), found


def test_the_fit_to_a_laboratory_test_follows_its_curve():
    """With the published parameters and one packing; the fit itself takes a minute."""
    sys.path.insert(0, str(ROOT / "python" / "examples"))
    import laboratory

    (cell,) = laboratory.packings([1])
    assert laboratory.void_ratio(cell) == pytest.approx(0.708, abs=0.005)
    curve = laboratory.oedometer(
        grainspan.Rve(cell, {**laboratory.CONTACT, "shear_modulus": 7.0e9, "friction": 0.269}, accuracy="draft")
    )
    loading, unloading = laboratory.measured()
    assert len(loading) == 13 and len(unloading) == 13
    found = np.interp(loading["axial_stress"], curve["axial_stress"], curve["axial_compression"])
    assert np.abs(found - loading["axial_compression"]).max() < 0.15 * loading["axial_compression"].max()


def test_bad_requests_are_refused():
    target = biaxial(grainspan.Rve(DISCS, CONTACT, accuracy="draft"))
    with pytest.raises(grainspan.InputError, match="order of size"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.9, 0.1)}, biaxial)
    with pytest.raises(grainspan.InputError, match="at least one packing"):
        grainspan.calibrate([], CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, biaxial)
    with pytest.raises(grainspan.InputError, match="no column colour"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, biaxial, columns=["colour"])
    with pytest.raises(grainspan.InputError, match="the test gives no column stress_ratio"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, lambda rve: biaxial(rve)[["axial_compression"]])
    for wrong in (0.5, (0.5, 0.1), ("a", "b", "c")):
        with pytest.raises(grainspan.InputError, match="three numbers"):
            grainspan.calibrate(DISCS, CONTACT, target, {"friction": wrong}, biaxial)
    with pytest.raises(grainspan.InputError, match="finite"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, np.inf)}, biaxial)
    with pytest.raises(grainspan.InputError, match="no rows"):
        grainspan.calibrate(DISCS, CONTACT, target[:0], {"friction": (0.5, 0.1, 0.9)}, biaxial)
    with pytest.raises(grainspan.InputError, match="else than numbers"):
        grainspan.calibrate(DISCS, CONTACT, target.assign(stress_ratio="high"), {"friction": (0.5, 0.1, 0.9)}, biaxial)
    with pytest.raises(grainspan.InputError, match="workers = 0"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, biaxial, workers=0)
    with pytest.raises(grainspan.InputError, match="contradicts"):
        grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, biaxial, accuracy="draft", rve={"accuracy": "tight"})


def steep(rve):
    """As :func:`biaxial`; cells of more than a friction of 0.5 are unloaded from the first increment on, and have no curve over a shortening."""
    rows = biaxial(rve)
    if rve._contact["friction"] > 0.5:
        rows["axial_compression"] *= -1.0
    return rows


@pytest.mark.parametrize("first", [0.45, 0.6])
def test_a_parameter_set_without_a_curve_is_left_aside(first):
    """Such sets lie within a step of the derivatives of the first guess, or the first guess is one itself."""
    target = biaxial(grainspan.Rve(DISCS, {**CONTACT, "friction": 0.35}, accuracy="draft"))
    law = {"stiffness_ratio": 0.5, "modulus": 1e8}
    found = grainspan.calibrate(DISCS, law, target, {"friction": (first, 0.1, 0.9)}, steep, relative_step=0.2)
    assert found.parameters["friction"] == pytest.approx(0.35, rel=0.05), found
    assert found.error < 0.02 and np.isfinite(list(found.uncertainty.values())).all()
    assert found.uncompared and all(one["friction"] > 0.5 for one in found.uncompared)
    assert "axial_compression of the test does not increase" in found.uncompared[0]["reason"]
    assert [one["friction"] > 0.5 for one in found.trace] == [bool(np.isnan(one["error"])) for one in found.trace]


def test_without_any_curve_there_is_no_result():
    target = biaxial(grainspan.Rve(DISCS, CONTACT, accuracy="draft"))
    backwards = lambda rve: biaxial(rve).iloc[::-1].reset_index(drop=True)  # noqa: E731
    none = lambda rve: biaxial(rve)[:0]  # noqa: E731
    for test, reason in ((backwards, "does not increase"), (none, "no rows")):
        with pytest.raises(grainspan.InputError, match=f"no parameter set.*{reason}.*first guess"):
            grainspan.calibrate(DISCS, CONTACT, target, {"friction": (0.5, 0.1, 0.9)}, test)


def test_a_test_that_stops_counts_up_to_there():
    """Its rows are compared as far as they go; the rest counts as a difference of the size of the curve."""
    target = grainspan.Rve(DISCS, CONTACT, accuracy="draft").oedometer([2e5, 4e5], increments=5)
    # No cell bears ten gigapascals.
    found = grainspan.calibrate(
        DISCS,
        {"modulus": 1e8, "stiffness_ratio": 0.5},
        target,
        {"friction": (0.5, 0.1, 0.9)},
        lambda rve: rve.oedometer([2e5, 1e10], increments=2),
        x="axial_stress",
        columns=["axial_compression"],
        most_evaluations=1,
    )
    assert found.error > 0.3 and len(found.curve) == len(target)


def test_consolidation_is_no_part_of_the_curve():
    """Stiffer grains than those of the preparation: the cell swells when it is brought to the pressure, and its shortening runs back."""
    truth = {"friction": 0.35, "modulus": 1.6e8}

    def whole(rve):
        return rve.triaxial(0.01, pressure=1e5, increments=8)

    rows = whole(grainspan.Rve(DISCS, {"stiffness_ratio": 0.5, **truth}, accuracy="draft"))
    assert rows["axial_compression"].iloc[0] > 1e-4 and rows.attrs["begin"] == 10
    found = grainspan.calibrate(
        DISCS,
        {"stiffness_ratio": 0.5},
        rows[rows["segment"] == 1],
        {name: (value, 0.5 * value, 2.0 * value) for name, value in truth.items()},
        whole,
        most_evaluations=1,
    )
    assert found.trace[0]["error"] < 1e-12, found.trace
    with pytest.raises(grainspan.InputError, match="of the target does not increase"):
        grainspan.calibrate(DISCS, CONTACT, rows, {"friction": (0.5, 0.1, 0.9)}, whole)
    gap = rows[rows["segment"] == 1].assign(stress_ratio=np.nan)
    with pytest.raises(grainspan.InputError, match="no finite numbers"):
        grainspan.calibrate(DISCS, CONTACT, gap, {"friction": (0.5, 0.1, 0.9)}, whole)
