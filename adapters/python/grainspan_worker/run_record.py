"""Where a run is found by name, and what a worker must know to join it."""

import json
import os
import time
from pathlib import Path

from .layout import ICEORYX2, PROTOCOL


class RunNotFound(Exception):
    """There is no such run, or it cannot be joined by this program; the text names the remedy."""


def base_directory():
    """The directory of all runs of this user."""
    return Path("/dev/shm") / f"grainspan-{os.getuid()}"


def process_start(pid):
    """Start time of a process in clock ticks since boot, None when it does not live."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    # The second field is the command in parentheses and may contain anything.
    return int(stat.rsplit(")", 1)[1].split()[19])


def find(name, patience):
    """The record of a run that can be joined; waits up to ``patience`` seconds for it to appear."""
    deadline = time.monotonic() + patience
    while True:
        record, reason = _look(name)
        if record is not None:
            return record
        if time.monotonic() >= deadline:
            raise RunNotFound(reason)
        time.sleep(0.02)


def _look(name):
    if not name or "/" in name or name.startswith("."):
        raise RunNotFound(f"`{name}` cannot be the name of a run")
    try:
        record = json.loads((base_directory() / name / "run.json").read_text())
    except (OSError, ValueError):
        return None, f"no run named `{name}` is alive"
    if process_start(record["pid"]) != record["pid_started"]:
        return None, f"no run named `{name}` is alive: its macro process has ended"
    if record["protocol"] != PROTOCOL or record["iceoryx2"] != ICEORYX2:
        raise RunNotFound(
            f"run `{name}` speaks protocol {record['protocol']} over iceoryx2 {record['iceoryx2']}, but this worker "
            f"speaks protocol {PROTOCOL} over iceoryx2 {ICEORYX2}; install the adapters of the same grainspan"
        )
    return (record, "") if record["ready"] else (None, f"run `{name}` is still being set up")
