"""The command line of every engine: ``python -m MODULE --run RUN``."""

import argparse
import ctypes
import json
import os
import signal
import sys

from .words import UnknownWord

#: Exit codes, as of ``grainspan rve-server``.
DONE, BAD_INPUT, RUN_LOST = 0, 2, 3


def main(rve_class, arguments=None):
    """Serves a run with the engine ``rve_class`` as the command line says; ends the process."""
    sys.exit(_run(rve_class, _parse(rve_class, arguments)))


def _parse(rve_class, arguments):
    parser = argparse.ArgumentParser(
        description=f"A worker of a Grainspan run with the engine `{rve_class.engine}`.",
        epilog="Example, in two terminals: grainspan run SCENE.toml --attach mine; THIS --run mine",
    )
    parser.add_argument("--run", help="name of the run to join")
    parser.add_argument("--pipe", action="store_true", help="speak with the run over standard input and output")
    parser.add_argument("--capabilities", action="store_true", help="print what the engine can do, as JSON, and end")
    parser.add_argument("--state-cache", type=int, default=64, help="snapshots kept at hand [64]")
    parser.add_argument("--patience", type=float, default=5.0, help="seconds to wait for the run to appear [5]")
    parser.add_argument("--replay", action="store_true", help="rebuild states by replay, as an engine without snapshots")
    parser.add_argument("--most-alive", type=int, default=64, help="with replay: RVEs kept alive [64]")
    parser.add_argument("--recycle-jobs", type=int, default=0, help="make room for a fresh worker after N jobs [never]")
    parser.add_argument("--recycle-memory", type=int, default=0, help="the same at so many MiB [never]")
    parser.add_argument("--parent", type=int, help="end when this process, which must be the parent, ends")
    chosen = parser.parse_args(arguments)
    if not chosen.capabilities and not chosen.run:
        parser.error("--run is missing")
    return chosen


def _run(rve_class, chosen):
    try:
        capabilities = rve_class.capabilities(chosen.replay)
    except UnknownWord as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    if chosen.capabilities:
        print(json.dumps(capabilities), flush=True)
        return DONE
    # Only a worker needs a channel; --capabilities works without.
    from . import server

    if chosen.parent is not None and not _follow(chosen.parent):
        print(
            f"error: the process that started this worker is not PID {chosen.parent}: has it ended, or is the engine's command "
            "a wrapper? let it `exec` the interpreter",
            file=sys.stderr,
        )
        return RUN_LOST
    options = server.Options(
        run=chosen.run,
        state_cache=chosen.state_cache,
        replay=chosen.replay,
        most_alive=chosen.most_alive,
        recycle_jobs=chosen.recycle_jobs,
        recycle_memory=chosen.recycle_memory,
    )
    port = _port(chosen)
    if port is None:
        return BAD_INPUT
    try:
        left = server.serve(rve_class, port, options)
    except server.Refused as error:
        print(f"error: the run refused this worker: {error}", file=sys.stderr)
        return BAD_INPUT
    finally:
        port.close()
    if left.startswith("lost"):
        print(f"error: the run is lost: {left[6:]}", file=sys.stderr)
        return RUN_LOST
    return DONE


def _port(chosen):
    """This worker's end of the channel to the run; None, with a message, where there is no such run."""
    if chosen.pipe:
        from .pipe import PipePort

        return PipePort()
    from . import run_record
    from .port import SharedMemoryPort

    try:
        return SharedMemoryPort(run_record.find(chosen.run, chosen.patience))
    except run_record.RunNotFound as error:
        print(f"error: {error}", file=sys.stderr)
        return None


def _follow(parent):
    """Has the kernel end this process with its parent; False when that is another process than ``parent``."""
    set_parent_death_signal = 1
    ctypes.CDLL(None, use_errno=True).prctl(set_parent_death_signal, signal.SIGTERM)
    return os.getppid() == parent
