"""Packings, runs and their files."""

import copy
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import CONTACT, DISCS, ROOT

import grainspan
from grainspan import _toml

SCENE = ROOT / "scenes" / "biaxial-small.toml"

RECIPE = {
    "number": 40,
    "seed": 3,
    "pressure": 1e5,
    "thickness": 5e-4,
    "tolerance": 1e-6,
    "grading": {"distribution": "uniform", "smallest_radius": 1.6e-4, "largest_radius": 3.4e-4},
    "contact": {"law": "linear", "modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.05},
}


def test_a_recipe_makes_a_packing(tmp_path):
    packing = grainspan.pack(RECIPE, tmp_path / "p.json", seed=4)
    assert len(packing) == 40 and packing.dimension == 2 and "coordination number" in packing.report
    assert packing.positions.shape == (40, 2) and packing.radii.min() >= 1.6e-4
    again = grainspan.pack(RECIPE, seed=4)
    assert again.path is None
    rows = [grainspan.Rve(one, CONTACT, accuracy="draft").isotropic(1.1e5, increments=2) for one in (packing, again)]
    assert rows[0].equals(rows[1])
    assert packing.plot() is not None
    with pytest.raises(grainspan.InputError, match="grading"):
        grainspan.pack({**RECIPE, "grading": {}})


def test_any_text_is_written_and_read_back(tmp_path):
    # Characters above U+FFFF were written as pairs of surrogates, and DEL as it is; TOML refuses both.
    table = {"name": "grain \U0001f30d\x7f\u00e9\n\"\\", "a \U0001f30d\x7f key": [1], "none": None}
    path = tmp_path / "table.toml"
    path.write_text(_toml.write(table), encoding="utf-8")
    assert _toml.read(path) == {key: value for key, value in table.items() if value is not None}
    with pytest.raises(grainspan.InputError, match="Unicode"):
        _toml.write({"folder": "\udcff"})
    with pytest.raises(grainspan.InputError, match="contact: friction: nan is not a finite number"):
        _toml.write({"contact": {"friction": float("nan")}})


def test_a_folder_may_have_any_name(tmp_path):
    folder = tmp_path / "grains \U0001f30d"
    folder.mkdir()
    discs = shutil.copy(DISCS, folder / "discs.json")
    H = np.diag([0.0, -1e-4])
    found, expected = (grainspan.Rve(one, CONTACT, accuracy="draft").trial(H).stress for one in (discs, DISCS))
    np.testing.assert_array_equal(found, expected)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run of the small scene, with the steps that were reported."""
    steps = []
    out = tmp_path_factory.mktemp("run") / "out"
    changes = {"loading.increments": 3, "boundary.2.displacement.y": -1e-4}
    run = grainspan.run(SCENE, out=out, workers=1, set=changes, on_step=steps.append, progress=True)
    return run, steps


def test_a_run_reports_its_steps(finished):
    run, steps = finished
    assert [step["step"] for step in steps] == [0, 1, 2, 3]
    assert run.summary["status"] == "done" and len(run.history) == 4
    assert run.history["axial_compression"].iloc[-1] == pytest.approx(1e-3, rel=1e-6)
    assert run.history.attrs["units"]["top_force"] == "N/m" and run.history.attrs["units"]["stress_ratio"] == "-"
    assert run.events[-1]["event"] == "finished" or any(event.get("event") == "finished" for event in run.events)


def test_fields_and_grains_are_read(finished):
    run, _ = finished
    fields = run.fields()
    assert len(fields.points) == 15 and len(fields.elements) == 8
    # Means of the elements: four Gauss points each, all elements of one size.
    stress = fields.elements["stress_yy"].mean()
    force = run.history["top_force"].iloc[-1]
    assert stress * 0.05 == pytest.approx(force, rel=1e-3)
    grains = run.grains()
    assert len(grains.points) == 100 and (grains.points["radius"] > 0).all()
    assert run.fields(0).time == 0.0
    with pytest.raises(grainspan.InputError, match="there is no 99"):
        run.fields(99)


def test_a_scene_may_be_a_mapping(finished, tmp_path):
    scene = _toml.read(SCENE)
    scene["packing"] = DISCS
    scene["loading"] = {"increments": 3}
    scene["boundary"] = copy.deepcopy(scene["boundary"])
    scene["boundary"][2]["displacement"]["y"] = -1e-4
    run = grainspan.run(scene, out=tmp_path / "out", workers=1)
    np.testing.assert_array_equal(run.history.to_numpy(), finished[0].history.to_numpy())


def test_a_run_is_called_as_its_changes_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # Both went to the folder of the scene's own name, the second over the first.
    changes = {"loading.increments": 1, "boundary.2.displacement.y": -1e-5}
    runs = [grainspan.run(SCENE, workers=1, set={**changes, "name": name}) for name in ("one", "two")]
    assert [run.folder.as_posix() for run in runs] == ["out/one", "out/two"]
    assert all(len(run.history) == 2 for run in runs)


def test_a_run_ends_with_the_process_that_began_it(tmp_path):
    out = tmp_path / "out"
    text = f"import grainspan; grainspan.run({str(SCENE)!r}, out={str(out)!r}, workers=1, set={{'loading.increments': 4000}})"
    script = subprocess.Popen([sys.executable, "-c", text])
    for _ in range(600):
        # The header, the initial state and a step: before it there is nothing to keep in a checkpoint.
        if (out / "history.csv").exists() and len((out / "history.csv").read_bytes().splitlines()) > 2:
            break
        time.sleep(0.05)
    script.kill()
    script.wait()
    for _ in range(600):
        if (out / "summary.json").exists():
            break
        time.sleep(0.05)
    # In good order: with a summary and a checkpoint.
    assert grainspan.Run(out).summary["status"] == "interrupted"
    assert (out / "checkpoint.bin").exists()


def test_files_in_other_encodings(tmp_path):
    text = SCENE.read_text(encoding="utf-8")
    marked, latin = tmp_path / "marked.toml", tmp_path / "latin.toml"
    marked.write_text(text, encoding="utf-8-sig")
    latin.write_bytes(b"name = '\xe9'")
    assert _toml.read(marked) == _toml.read(SCENE)
    with pytest.raises(grainspan.InputError, match="latin.toml"):
        _toml.read(latin)


def test_a_place_that_is_not_there_is_refused_before_a_packing_is_made(tmp_path):
    with pytest.raises(grainspan.InputError, match="no folder"):
        grainspan.pack(RECIPE, tmp_path / "nowhere" / "p.json")


def test_a_run_that_fails_says_why(tmp_path):
    with pytest.raises(grainspan.RunFailed, match="incremnts") as failed:
        grainspan.run(SCENE, out=tmp_path / "out", set={"loading.incremnts": 3})
    assert failed.value.code == 2


def test_an_exception_of_the_caller_stops_the_run(tmp_path):
    class Enough(Exception):
        pass

    def stop(step):
        if step["step"] == 1:
            raise Enough

    begun = time.monotonic()
    with pytest.raises(Enough):
        grainspan.run(SCENE, out=tmp_path / "out", workers=1, set={"loading.increments": 2000}, on_step=stop)
    assert time.monotonic() - begun < 30
    run = grainspan.Run(tmp_path / "out")
    assert run.summary["status"] == "interrupted" and (run.folder / "checkpoint.bin").exists()


def test_a_packing_that_was_changed_is_used_as_it_is(tmp_path):
    packing = grainspan.Packing.read(DISCS)
    as_made = grainspan.Rve(packing, CONTACT).initial_pressure
    packing.data["grains"] = [[x, y, 1.001 * radius] for x, y, radius in packing.data["grains"]]
    swollen = grainspan.Rve(packing, CONTACT).initial_pressure
    assert swollen > 1.1 * as_made
    packing.save(tmp_path / "swollen.json")
    assert grainspan.Rve(tmp_path / "swollen.json", CONTACT).initial_pressure == swollen
    packing.data["grains"] = np.array(grainspan.Packing.read(DISCS).data["grains"])
    assert grainspan.Rve(packing, CONTACT).initial_pressure == as_made
    for number, content in enumerate((b"\xff\xfe\x00", b"[1, 2]")):
        wrong = tmp_path / f"wrong-{number}.json"
        wrong.write_bytes(content)
        with pytest.raises(grainspan.InputError, match="cannot read the packing"):
            grainspan.Packing.read(wrong)


def test_a_table_that_was_cut_loses_its_last_row_alone(finished, tmp_path):
    text = (finished[0].folder / "history.csv").read_bytes()
    cut = tmp_path / "cut.csv"
    cut.write_bytes(text[: text.rindex(b",")])
    whole, found = finished[0].history, grainspan.read_history(cut)
    assert list(found.columns) == list(whole.columns) and len(found) == len(whole) - 1
    cut.write_bytes(text + b"1,2\n")
    with pytest.raises(grainspan.InputError, match="columns of the header"):
        grainspan.read_history(cut)
    assert grainspan.read_history(finished[0].folder / "history.csv").attrs["units"] == whole.attrs["units"]


def test_toml_survives(tmp_path):
    table = {"a b": 'quote " and \\', "list": [1, 2.5, True], "none": None, "t": {"x": np.float64(0.1), "y": [{"z": 1}]}}
    (tmp_path / "t.toml").write_text(_toml.write(table))
    del table["none"]
    assert _toml.read(tmp_path / "t.toml") == table


def test_headers_with_units_read_as_plain_names(tmp_path):
    out = tmp_path / "out"
    run = grainspan.run(SCENE, out=out, workers=1, set={"loading.increments": 2, "output.units": True}, progress=False)
    header = (out / "history.csv").read_text().splitlines()[0]
    assert ",top_force [N/m]," in header and ",stress_ratio," in header and header.startswith("step,time [s],")
    assert "top_force" in run.history and run.history.attrs["units"]["top_force"] == "N/m"
