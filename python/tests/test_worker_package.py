"""The Python package for engines of one's own (`adapters/python`), without a run: what an engine declares, delivers and keeps."""

import json
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import CONTACT, DISCS, ROOT

msgpack = pytest.importorskip("msgpack")
pytest.importorskip("xxhash")
sys.path.insert(0, str(ROOT / "adapters" / "python"))

from grainspan_worker import Answer, Rve, command_line, words  # noqa: E402
from grainspan_worker.answer import TrialOptions  # noqa: E402
from grainspan_worker.content import NONE, name_of  # noqa: E402
from grainspan_worker.job_runner import JobRunner  # noqa: E402
from grainspan_worker.layout import JOB, OBSERVABLES, STATUSES  # noqa: E402
from grainspan_worker.state_source import PathSource  # noqa: E402

STRAIN = np.diag([0.0, -1e-3, 0.0])


class Elastic(Rve):
    """Stress proportional to the strain from the initial state; its state is the stress."""

    engine = "elastic"
    more = {}
    marks = set()

    def __init__(self, definition):
        self.stress, self.latest = -1e5 * np.eye(2), None

    def trial(self, gradient, ask):
        self.latest = self.stress + 1e8 * gradient[:2, :2]
        return Answer(stress=self.latest, observed=self.more, flags=self.marks)

    def commit(self):
        self.stress, self.latest = self.latest, None

    def rollback(self):
        self.latest = None

    def snapshot(self):
        return (self.stress if self.latest is None else self.latest).tobytes()

    def restore(self, content):
        self.stress, self.latest = np.frombuffer(content).reshape(2, 2), None


def answered(engine, observables=0, target=STRAIN):
    """Reply and error of the first trial of an engine."""
    packing = json.loads(DISCS.read_text())
    content = msgpack.packb({"packing": packing, "contact": {"law": "linear", **CONTACT}, "rve": {}})
    runner = JobRunner(engine)
    runner.define(content)
    job = np.zeros((), JOB)
    job["definition"], job["state"] = np.frombuffer(name_of(content), "u1"), np.frombuffer(NONE, "u1")
    job["target"], job["observables"] = target.reshape(9), observables
    reply, (_, error) = runner.answer(job)
    return reply, msgpack.unpackb(error) if error else None


def test_declared_results_that_do_not_come_are_a_fault():
    declared = type("Declared", (Elastic,), {"observables": ("fabric_anisotropy", "elastic_energy")})
    reply, error = answered(declared, OBSERVABLES["fabric"] | OBSERVABLES["energy"])
    assert reply["status"] == STATUSES["failed"]
    assert re.search("lacks `fabric_anisotropy`, `elastic_energy`", error["EngineFault"])
    reply, error = answered(declared, OBSERVABLES["energy"])
    assert re.search("lacks `elastic_energy`,", error["EngineFault"])
    # What nobody asks for need not come, and without contacts there is nothing to deliver.
    assert answered(declared, OBSERVABLES["rotation"])[1] is None
    loose = type("Loose", (declared,), {"marks": {"no_load_bearing_contacts"}})
    assert answered(loose, OBSERVABLES["energy"])[1] is None
    complete = type("Complete", (declared,), {"more": {"elastic_energy": 3.0}})
    reply, error = answered(complete, OBSERVABLES["energy"])
    assert error is None and reply["observed.elastic_energy"] == 3.0


@pytest.mark.parametrize("attribute", ["laws", "tangents", "observables", "features"])
def test_words_that_do_not_exist_are_refused(attribute, capsys):
    known = words._KNOWN[attribute]
    command_line._run(type("Sound", (Elastic,), {attribute: known}), command_line._parse(Elastic, ["--capabilities"]))
    assert json.loads(capsys.readouterr().out)[attribute] == list(known)
    for wrong, said in ((("nonsense",), f"unknown `nonsense` in `{attribute}`; there are {known[0]}, "), ("nonsense", "tuple of words")):
        typo = type("Typo", (Elastic,), {attribute: wrong})
        for role in (["--capabilities"], ["--run", "none"]):
            assert command_line._run(typo, command_line._parse(typo, role)) == command_line.BAD_INPUT
            assert said in capsys.readouterr().err


def test_the_words_are_those_of_the_program():
    """Laws and features have no place in the layout of messages: they are compared with the sources."""
    for file, known in (("definition/features.rs", words.FEATURES), ("contact/table.rs", words.LAWS)):
        source = (ROOT / "rve-server" / "src" / file).read_text()
        kind = "EngineFeature" if known is words.FEATURES else "LawName"
        block = re.search(rf"pub {kind} \{{(.*?)\}}", re.search(r"keywords! \{.*", source, re.DOTALL)[0], re.DOTALL)[1]
        assert tuple(re.findall(r'=> "([^"]+)"', block)) == known


def test_a_snapshot_without_the_state_is_seen_in_the_first_step():
    class Committed(Elastic):
        """Its snapshot is always the committed state."""

        def snapshot(self):
            return self.stress.tobytes()

    class Nothing(Elastic):
        """Its snapshots are empty."""

        def snapshot(self):
            return b""

        def restore(self, content):
            pass

    class Yielding(Committed):
        """Its stress stays, whatever the strain."""

        def trial(self, gradient, ask):
            return Answer(stress=self.stress)

        def commit(self):
            pass

    for wrong in (Committed, Nothing):
        error = answered(wrong)[1]
        assert "strain of 1.0e-03 is the initial one: the snapshots of the engine do not hold its state" in error["EngineFault"]
    for sound, target in ((Elastic, STRAIN), (Yielding, STRAIN), (Committed, np.zeros((3, 3))), (Committed, 1e-12 * STRAIN)):
        assert answered(sound, target=target)[1] is None


class Counted(Elastic):
    """The same without snapshots; knows how many of it are alive, and can be told to fail."""

    alive = 0
    fails = False

    def __init__(self, definition):
        super().__init__(definition)
        Counted.alive += 1

    def trial(self, gradient, ask):
        if Counted.fails:
            raise RuntimeError("no answer")
        return super().trial(gradient, ask)

    def release(self):
        Counted.alive -= 1


def test_states_that_are_paths_release_every_living_cell():
    """Two cells may come to stand at one place after a step that was taken back; the one that was there is released."""
    definition = SimpleNamespace(id=bytes(16))
    Counted.alive, Counted.fails = 0, False
    source = PathSource(Counted, definition, most_alive=8)
    ask = TrialOptions(ramp_steps=1)

    def solve(state):
        return source.solve(name_of(state), state, STRAIN, ask)[1]

    for _ in range(3):
        behind = solve(source.initial)
        solve(behind)
    assert Counted.alive == len(source._alive) <= 3
    # A state is built again from its path, and the engine fails meanwhile.
    source.close()
    assert Counted.alive == 0
    Counted.fails = True
    with pytest.raises(RuntimeError):
        solve(behind)
    assert Counted.alive == 0
