"""What the installed package carries."""

import importlib.metadata
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import grainspan


def test_the_executable_is_of_the_same_build():
    said = subprocess.run([grainspan.executable(), "--version"], capture_output=True, text=True, check=True).stdout
    assert said.split()[-1] == grainspan.__version__ == grainspan.build["version"]


def test_the_package_is_typed_and_documented():
    folder = Path(grainspan.__file__).parent
    assert (folder / "py.typed").exists() and (folder / "_native.pyi").exists()
    for name in grainspan.__all__:
        thing = getattr(grainspan, name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), name
            if thing.__module__.startswith("grainspan") and inspect.isclass(thing):
                methods = inspect.getmembers(thing, inspect.isfunction)
                own = [m for n, m in methods if not n.startswith("_") and m.__module__.startswith("grainspan")]
                assert all(method.__doc__ for method in own), name


def test_the_module_runs_as_the_program():
    command = [sys.executable, "-m", "grainspan", "explain", "contact.friction"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "Coulomb" in said


def test_a_missing_executable_is_named(monkeypatch):
    monkeypatch.setenv("GRAINSPAN_PROGRAM", "/nonexistent/grainspan")
    with pytest.raises(grainspan.StartError, match="/nonexistent/grainspan"):
        grainspan.executable()


def test_what_is_no_program_is_refused(monkeypatch, tmp_path):
    """A folder, a file that may not be executed, and one that the system does not start."""
    plain, text = tmp_path / "plain", tmp_path / "text"
    plain.touch()
    text.write_text("no program")
    text.chmod(0o755)
    for named, said in ((tmp_path, "a folder and no program"), (plain, "may not be executed"), (text, "cannot be started")):
        monkeypatch.setenv("GRAINSPAN_PROGRAM", str(named))
        for call in (lambda: grainspan.run({}, out=tmp_path / "out"), lambda: grainspan.pack({})):
            with pytest.raises(grainspan.StartError, match=said):
                call()


def test_an_installed_wheel_holds_executable_and_extension():
    try:
        files = importlib.metadata.files("grainspan") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package runs from its source folder")
    names = {str(file) for file in files}
    if not any(name.startswith("grainspan/__init__") for name in names):
        pytest.skip("the package is installed in place")
    assert "grainspan/bin/grainspan" in names and any("_native" in name and name.endswith(".so") for name in names)
