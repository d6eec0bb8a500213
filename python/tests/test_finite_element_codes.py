"""One biaxial test in several finite-element codes: one curve. A host that cannot be had here is skipped with the reason."""

import os
import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "python" / "examples" / "finite_element_codes"))
import compare  # noqa: E402

#: Hosts that must be there, by name.
REQUIRED = os.environ.get("GRAINSPAN_REQUIRE_HOSTS", "").split(",")


@pytest.fixture(scope="module")
def reference():
    try:
        return compare.curve(compare.REFERENCE)
    except compare.Missing as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize("name", compare.HOSTS)
def test_a_host_has_the_curve_of_the_macro_solver(name, reference):
    host = compare.HOSTS[name]
    try:
        found = compare.curve(host)
    except compare.Missing as reason:
        assert name not in REQUIRED, f"{name} is required: {reason}"
        pytest.skip(f"{name}: {reason}")
    apart = max(map(abs, compare.difference(found, reference)))
    assert apart < host.tolerance, f"{apart} from the reference"
