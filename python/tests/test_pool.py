"""The pool: bits, states, lost workers, refusals, Ctrl-C, processes."""

import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest
from conftest import CONTACT, DISCS, ROOT, SPHERES

import grainspan


def gradients(count, strain):
    """Compression with some shear; every point differs."""
    share = 1.0 + 0.1 * np.arange(count)
    H = np.zeros((count, 2, 2))
    H[:, 0, 0], H[:, 0, 1], H[:, 1, 1] = 0.3 * strain, 0.2 * strain * share, -strain * share
    return H


def test_trials_have_the_bits_of_a_single_cell(pool):
    states = pool.states(4)
    cells = [grainspan.Rve(DISCS, CONTACT, accuracy="draft") for _ in states.numbers]
    for strain in (2e-4, 3e-4, -1e-4):
        H = gradients(4, strain)
        together = pool.trial(states, H, observables=grainspan.observables())
        for number, cell in enumerate(cells):
            alone = cell.trial(H[number], observables=grainspan.observables())
            np.testing.assert_array_equal(together.stress[number], alone.stress[0])
            np.testing.assert_array_equal(together.tangent[number], alone.tangent[0])
            for name, values in alone.observables.items():
                np.testing.assert_array_equal(together.observables[name][number], values[0], err_msg=name)
            cell.commit()
        pool.commit(states)
    assert pool.snapshot(states) == [cell.snapshot() for cell in cells]


def test_trials_leave_committed_states_alone(pool):
    states = pool.states(3)
    initial = pool.snapshot(states)
    first = pool.trial(states, gradients(3, 1e-3))
    second = pool.trial(states, gradients(3, 1e-3))
    np.testing.assert_array_equal(first.stress, second.stress)
    pool.rollback(states[:1])
    with pytest.raises(grainspan.NothingToCommit, match="state 0"):
        pool.commit(states)
    pool.commit(states[1:])
    kept = pool.snapshot(states)
    assert kept[0] == initial[0] and kept[1] != initial[1]
    # Snapshots are plain bytes; a state of one point continues at another.
    pool.restore(states[[0]], pickle.loads(pickle.dumps(kept[2:])))
    again = pool.trial(states[[0, 2]], gradients(1, 1e-4))
    np.testing.assert_array_equal(again.stress[0], again.stress[1])
    assert len(states[:1] + states[2:]) == 2


def test_one_point_may_be_tried_several_times_in_a_call(pool):
    state, other = pool.states(1), pool.states(1)
    H = gradients(3, 1e-4)
    found = pool.trial(state[[0, 0, 0]], H, tangent="none")
    assert found.tangent is None and len(np.unique(found.stress[:, 0, 1])) == 3
    pool.commit(state)
    pool.trial(other, H[2:], tangent="none")
    pool.commit(other)
    assert pool.snapshot(state) == pool.snapshot(other)


def test_a_killed_worker_costs_no_result(pool):
    states = pool.states(40)
    H = gradients(40, 2e-3)
    expected = pool.trial(states, H)
    killed = pool.workers[0]
    timer = threading.Timer(0.05, os.kill, (killed, signal.SIGKILL))
    timer.start()
    np.testing.assert_array_equal(pool.trial(states, H).stress, expected.stress)
    timer.join()
    np.testing.assert_array_equal(pool.trial(states, H).stress, expected.stress)
    assert killed not in pool.workers
    assert pool.statistics["workers_lost"] == 1


def test_a_refused_trial_names_its_point_and_loses_nothing(pool):
    states = pool.states(3)
    before = pool.snapshot(states)
    H = gradients(3, 1e-4)
    H[1] = [[-3.0, 0.0], [0.0, 1.0]]
    with pytest.raises(grainspan.TrialRefused, match="inside out") as refused:
        pool.trial(states, H)
    assert refused.value.point == 1 and refused.value.curable
    assert pool.snapshot(states) == before
    H[1] = np.nan
    with pytest.raises(grainspan.TrialRefused, match="not finite"):
        pool.trial(states, H)
    pool.trial(states, gradients(3, 1e-4))
    pool.commit(states)


def test_arguments_are_checked(pool):
    states = pool.states(2)
    with pytest.raises(grainspan.InputError, match=r"shape \(3, 2, 2\) do not fit \(2, 2, 2\)"):
        pool.trial(states, np.zeros((3, 2, 2)))
    # Two points of discs: a vector for each would pass for one matrix, and a number for all of them.
    for wrong in (np.zeros((2,)), np.zeros((2, 1, 2)), 0.0):
        with pytest.raises(grainspan.InputError, match="do not fit"):
            pool.trial(states, wrong)
    with pytest.raises(grainspan.InputError, match="real"):
        pool.trial(states, np.zeros((2, 2, 2), dtype=complex))
    for wrong in (-1, 2.7, [1, 2, 3]):
        with pytest.raises(grainspan.InputError, match="ramp_steps"):
            pool.trial(states, np.zeros((2, 2)), ramp_steps=wrong)
    with pytest.raises(grainspan.InputError, match="too many"):
        pool.states(10**12)
    for wrong in (-1, 1.5, 10**30):
        with pytest.raises(grainspan.InputError, match="count"):
            pool.states(wrong)
        with pytest.raises(grainspan.InputError, match="workers"):
            grainspan.Pool(DISCS, CONTACT, workers=wrong)
    with pytest.raises(grainspan.InputError, match="packing"):
        pool.states(1, packing=-1)
    with pytest.raises(grainspan.InputError, match="not with list"):
        states + [1]
    for opened in (grainspan.Pool, grainspan.Rve):
        with pytest.raises(grainspan.InputError, match="'draft' contradicts 'tight' in rve"):
            opened(DISCS, CONTACT, accuracy="draft", rve={"accuracy": "tight"})
    grainspan.Rve(DISCS, CONTACT, accuracy="tight", rve={"accuracy": "tight"})
    with pytest.raises(grainspan.InputError, match="either"):
        pool.trial(states)
    with pytest.raises(ValueError, match="observable"):
        pool.trial(states, np.zeros((2, 2)), observables=["colour"])
    with pytest.raises(grainspan.InputError, match="there is no cell 1"):
        pool.states(1, packing=1)
    with pytest.raises(grainspan.InputError, match="cannot be mixed"):
        grainspan.Pool([DISCS, SPHERES], CONTACT, workers=1)
    pool.trial(states, gradients(2, 1e-4))
    pool.commit(states)
    for call in (pool.commit, pool.rollback, pool.snapshot):
        with pytest.raises(grainspan.InputError, match="not by list"):
            call([0])
    sound = pool.snapshot(states)
    with pytest.raises(grainspan.InputError, match="snapshot 1 of the call.*damaged"):
        pool.restore(states, [sound[0], sound[1][:-1] + bytes([sound[1][-1] ^ 1])])
    with pytest.raises(grainspan.StartError, match="no program"):
        grainspan.Pool(DISCS, CONTACT, program="/nonexistent/grainspan")
    with pytest.raises(grainspan.StartError, match="a folder.*`program`"):
        grainspan.Pool(DISCS, CONTACT, program=ROOT)
    with grainspan.Pool(DISCS, CONTACT, workers=1) as other, pytest.raises(grainspan.InputError, match="another pool"):
        other.trial(states, np.zeros((2, 2)))
    with pytest.raises(grainspan.PoolClosed):
        other.states(1)


def test_one_observable_may_stand_alone(pool):
    # It was read letter by letter.
    alone, listed = (pool.trial(pool.states(1), gradients(1, 1e-4), observables=asked) for asked in ("fabric", ["fabric"]))
    np.testing.assert_array_equal(alone.observables["fabric"], listed.observables["fabric"])


def test_several_pools_and_packings_in_one_process(pool):
    laws = [CONTACT, {**CONTACT, "friction": 0.1}]
    with grainspan.Pool([DISCS, DISCS], laws, accuracy="draft", workers=1) as second:
        states = second.states(1) + second.states(1, packing=1)
        H = gradients(1, 1e-2)
        found = second.trial(states, H)
        np.testing.assert_array_equal(pool.trial(pool.states(1), H).stress[0], found.stress[0])
        assert np.abs(found.stress[0] - found.stress[1]).max() > 0


def test_spheres(spheres):
    with grainspan.Pool(SPHERES, CONTACT, accuracy="draft", workers=1) as pool:
        H = np.diag([1e-4, 0.0, -2e-4])
        found = pool.trial(pool.states(2), H)
    assert found.tangent.shape == (2, 3, 3, 3, 3)
    np.testing.assert_array_equal(found.stress[1], grainspan.Rve(SPHERES, CONTACT, accuracy="draft").trial(H).stress[0])


def test_threads_share_a_pool_and_the_interpreter_is_free(pool):
    states = pool.states(8)
    H = gradients(8, 1e-3)
    expected = pool.trial(states, H).stress
    found = [None] * 4

    def work(number):
        found[number] = pool.trial(states[2 * number : 2 * number + 2], H[2 * number : 2 * number + 2]).stress

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(np.concatenate(found), expected)


def test_new_states_during_a_call_do_not_hold_the_interpreter():
    # They are made behind the trial; a third thread waited for their list with the interpreter in its hands.
    with grainspan.Pool(DISCS, CONTACT, accuracy="default", workers=1) as pool:
        states = pool.states(40)
        shear = np.linspace(0.01, 0.05, 40)[:, None, None] * [[0.0, 1.0], [0.0, -1.0]]
        ticks = []
        ended = threading.Event()

        def tick():
            while not ended.is_set():
                ticks.append(time.monotonic())
                time.sleep(0.005)
            ticks.append(time.monotonic())

        calls = [lambda: pool.trial(states, shear), lambda: pool.states(1), lambda: pool.snapshot(states[:1])]
        ticking = threading.Thread(target=tick)
        ticking.start()
        threads = [threading.Thread(target=call) for call in calls]
        begun = time.monotonic()
        for thread in threads:
            thread.start()
            time.sleep(0.02)
        threads[0].join()
        taken = time.monotonic() - begun
        ended.set()
        for thread in [*threads, ticking]:
            thread.join()
    longest = max(after - before for before, after in zip(ticks, ticks[1:]))
    assert longest < 0.5 * taken, (longest, taken)


INTERRUPTED = """
import os, signal, threading, time
import numpy as np
import grainspan
pool = grainspan.Pool({discs!r}, {contact!r}, accuracy="default", workers=1)
states = pool.states(40)
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
begun = time.monotonic()
try:
    pool.trial(states, np.linspace(0.01, 0.05, 40)[:, None, None] * [[0.0, 1.0], [0.0, -1.0]])
except KeyboardInterrupt:
    waited = time.monotonic() - begun
    assert waited < 5.0, waited
    pool.trial(states[:1], np.zeros((2, 2)))
    print("stopped and in service")
"""


def test_ctrl_c_ends_a_call_and_not_the_pool():
    text = textwrap.dedent(INTERRUPTED.format(discs=str(DISCS), contact=CONTACT))
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, cwd=ROOT)
    assert done.stdout.strip() == "stopped and in service", done.stderr


def test_workers_end_with_the_pool_and_with_the_process():
    pool = grainspan.Pool(DISCS, CONTACT, workers=2)
    workers = pool.workers
    assert len(workers) == 2
    del pool
    assert_gone(workers)
    text = f"import grainspan, os; p = grainspan.Pool({str(DISCS)!r}, {CONTACT!r}, workers=1)\n"
    text += "print(p.workers[0], flush=True); os.kill(os.getpid(), 9)"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, cwd=ROOT)
    assert_gone([int(done.stdout)])


def assert_gone(workers):
    """Fails unless the processes end soon."""
    end = time.monotonic() + 10
    while any(is_running(pid) for pid in workers):
        assert time.monotonic() < end, workers
        time.sleep(0.05)


def is_running(pid):
    """Whether a process exists and has not ended."""
    try:
        return open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_a_forked_process_is_refused(pool):
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            pool.states(1)
            text = b"it was not refused"
        except grainspan.PoolClosed as error:
            text = str(error).encode()
        os.write(writer, text)
        os._exit(0)
    os.waitpid(child, 0)
    assert b"open a pool of its own" in os.read(reader, 1000)
    pool.trial(pool.states(1), gradients(1, 1e-4))
