"""Whole runs of the program."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime, timezone
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from . import _toml, fields
from ._program import end_with_parent, executable, not_started
from .errors import RunFailed
from .history import History, read_history

#: Time between two looks at the event log.
_INTERVAL = 0.1


class Run:
    """A finished run, or what an interrupted one has left.

    Parameters
    ----------
    folder : path
        Output folder.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    @property
    def history(self) -> History:
        """One row per accepted step, see docs/reference/formats.md."""
        return read_history(self.folder)

    @property
    def summary(self) -> dict[str, Any]:
        """Content of ``summary.json``."""
        return json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))

    @property
    def events(self) -> list[dict[str, Any]]:
        """Content of ``run.jsonl``. A line that a process could not finish, or is about to finish, is left out."""
        lines = (self.folder / "run.jsonl").read_bytes().splitlines()
        return [event for event in map(_event, lines) if event is not None]

    def fields(self, step: int = -1):
        """Fields of a recorded step, see :func:`grainspan.read_fields`."""
        return fields.read_fields(self.folder, step)

    def grains(self, point: int | None = None, step: int = -1):
        """Grains of a Gauss point at a recorded step, see :func:`grainspan.read_grains`."""
        return fields.read_grains(self.folder, point, step)

    def __repr__(self) -> str:
        return f"<Run in {self.folder}>"


def run(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    set: Mapping[str, Any] | None = None,
    on_step: Callable[[dict[str, Any]], None] | None = None,
    progress: bool | None = None,
    resume: bool = False,
) -> Run:
    """Runs a scene with the program that the package carries.

    Parameters
    ----------
    scene : path or mapping
        Scene file, or its keys. Paths in a mapping are relative to the current folder.
    out : path, optional
        Output folder; ``out/NAME`` without, where NAME is that of the scene, or of ``set``.
    workers : int, optional
        Worker processes; one per core without.
    set : mapping, optional
        Keys to override, for example ``{"loading.increments": 40}``.
    on_step : callable, optional
        Gets the event of every accepted step: ``step``, ``load``, ``iterations`` ... An exception stops the run in good order.
    progress : bool, optional
        A progress bar by tqdm; without, one is shown in notebooks that have tqdm.
    resume : bool, optional
        Continue from the last checkpoint in the output folder.

    Returns
    -------
    Run

    Raises
    ------
    RunFailed
        With exit code, message and folder.
    StartError
        The program cannot be started.
    """
    with tempfile.TemporaryDirectory(prefix="grainspan-") as temporary:
        if isinstance(scene, Mapping):
            source = Path(temporary) / "scene.toml"
            named = {"name": "from-python", **scene}
            source.write_text(_toml.write(_with_whole_paths(named)), encoding="utf-8")
            name = named["name"]
        else:
            source = Path(scene)
            # A file that cannot be read is reported by the program.
            name = _toml.read(source).get("name", source.stem) if source.exists() else source.stem
        name = (set or {}).get("name", name)
        folder = Path(out) if out is not None else Path("out") / str(name)
        command = [str(executable()), "run", str(source), "--out", str(folder)]
        command += ["--workers", str(workers)] if workers is not None else []
        command += ["--resume"] if resume else []
        for key, value in (set or {}).items():
            command += ["--set", f"{key}={_toml._value(value)}"]
        _followed(command, folder, on_step, _bar(progress))
    return Run(folder)


def _with_whole_paths(scene: Mapping[str, Any]) -> dict[str, Any]:
    """The scene with the files that it names under absolute paths."""
    whole = dict(scene)
    absolute = lambda path: os.path.abspath(os.fspath(path))  # noqa: E731
    if "packing" in whole:
        whole["packing"] = absolute(whole["packing"])
    if "file" in whole.get("mesh", {}):
        whole["mesh"] = {**whole["mesh"], "file": absolute(whole["mesh"]["file"])}
    if "region" in whole:
        whole["region"] = [
            {**region, "packings": [absolute(path) for path in region["packings"]]} if "packings" in region else region
            for region in whole["region"]
        ]
    return whole


def _bar(wanted: bool | None):
    """A progress bar over the load factor, or nothing."""
    in_notebook = "ipykernel" in sys.modules
    if wanted is False or (wanted is None and not in_notebook):
        return None
    try:
        from tqdm import tqdm

        if in_notebook and find_spec("ipywidgets"):
            from tqdm.notebook import tqdm
    except ImportError:
        if wanted:
            raise
        return None
    return tqdm(total=1.0, bar_format="{l_bar}{bar}| {elapsed} {postfix}")


def _followed(command: list[str], folder: Path, on_step, bar) -> None:
    """Runs the command, and reports the events that it appends to its log."""
    begun = datetime.now(timezone.utc)
    with tempfile.TemporaryFile("w+", encoding="utf-8") as messages:
        # A process group of its own: Ctrl-C is for this process, which then stops the run in good order.
        try:
            child = subprocess.Popen(
                command, stdout=subprocess.DEVNULL, stderr=messages, start_new_session=True, preexec_fn=end_with_parent
            )
        except OSError as error:
            raise not_started(command[0], error) from error
        try:
            for event in _events(child, folder / "run.jsonl"):
                if event.get("event") != "step" or datetime.fromisoformat(event["timestamp"]) < begun:
                    continue
                if bar is not None:
                    bar.set_postfix_str(f"step {event['step']}", refresh=False)
                    bar.update(max(0.0, float(event["share"]) - bar.n))
                if on_step is not None:
                    on_step(event)
        except BaseException:
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
            raise
        finally:
            code = child.wait()
            if bar is not None:
                bar.close()
        if code != 0:
            messages.seek(0)
            text = messages.read().strip()
            raise RunFailed(text or f"the run ended with exit code {code}", code, folder)


def _event(line: bytes) -> dict[str, Any] | None:
    """The event of a line of a log; ``None`` for a line that was cut short."""
    try:
        event = json.loads(line)
    except ValueError:
        return None
    return event if isinstance(event, dict) and "timestamp" in event else None


def _events(child: subprocess.Popen, log: Path) -> Iterator[dict[str, Any]]:
    """Events of a log as they are written, those of earlier runs included, until the process has ended."""
    file, offset, rest = None, 0, b""
    while True:
        ended = child.poll() is not None
        if log.exists():
            status = log.stat()
            # A new run begins a new file.
            if status.st_ino != file or status.st_size < offset:
                file, offset, rest = status.st_ino, 0, b""
            with log.open("rb") as source:
                source.seek(offset)
                new = source.read()
            offset += len(new)
            *lines, rest = (rest + new).split(b"\n")
            for line in lines:
                event = _event(line)
                if event is None:
                    continue
                event["timestamp"] = event["timestamp"].replace("Z", "+00:00")
                yield event
        if ended:
            return
        time.sleep(_INTERVAL)
