"""The worker loop: take definitions and job slices, answer, leave when told or when the run is lost."""

import os
import resource
import sys
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import msgpack

from .job_runner import JobRunner, bare
from .content import name_of
from .errors import EngineFault, MessageTooLarge, RveError
from .layout import PROTOCOL


class Refused(Exception):
    """The run refused this worker; the text names the remedy."""


@dataclass
class Options:
    """How a worker behaves."""

    run: str
    #: Snapshots kept at hand.
    state_cache: int = 64
    #: Whether states are paths although the engine has snapshots.
    replay: bool = False
    #: RVEs kept alive per definition when states are paths.
    most_alive: int = 64
    #: Leave after so many jobs; 0 = never. The run starts a fresh worker and loses nothing.
    recycle_jobs: int = 0
    #: Leave when the process has grown to so many MiB; 0 = never.
    recycle_memory: int = 0
    #: Seconds that the run may take to answer the hello.
    grace: float = 30.0


def serve(rve_class, port, options):
    """Serves one run until dismissed; returns why it left: "dismissed", "drained", "recycled" or "lost: ..."."""
    port.send_control(
        {
            "Hello": {
                "protocol": PROTOCOL,
                "run": options.run,
                "pid": os.getpid(),
                "capabilities": rve_class.capabilities(options.replay),
                "state_cache": options.state_cache,
            }
        }
    )
    worker = _Worker(rve_class, port, options)
    try:
        return worker.welcome() or worker.work()
    finally:
        worker.runner.close()


class _Worker:
    def __init__(self, rve_class, port, options):
        self.port, self.options = port, options
        self.runner = JobRunner(rve_class, options.state_cache, options.replay, options.most_alive)
        self._tasks = deque()
        self._welcome = self._draining = False
        self._refused = self._left = None

    def welcome(self):
        """Waits for the answer to the hello; returns a reason to leave, or None when welcome."""
        end = time.monotonic() + self.options.grace
        while True:
            if self._refused is not None:
                raise Refused(self._refused)
            if self._welcome or self._left:
                return self._left
            if time.monotonic() >= end:
                raise Refused(f"the run did not answer within {self.options.grace:.0f} s; is its process alive?")
            self._listen(end - time.monotonic())

    def work(self):
        """Answers jobs until there is a reason to leave."""
        while True:
            # Long waits cost nothing: whatever the run does, its end included, interrupts them.
            self._listen(3600.0 if not self._tasks and not self._draining else 0.0)
            if self._refused is not None:
                raise Refused(self._refused)
            if self._left:
                return self._left
            if self._tasks:
                task, content = self._tasks.popleft()
                task(content)
                exhausted = self._exhausted()
                if exhausted:
                    self.port.send_control({"Bye": {"reason": exhausted}})
                    return "recycled"
            elif self._draining:
                self.port.send_control({"Bye": {"reason": "drained"}})
                return "drained"

    def _listen(self, wait):
        for kind, content in self.port.poll(wait):
            if kind == "jobs":
                self._tasks.append((self._answer, content))
            elif kind == "lost":
                self._left = f"lost: {content}"
            elif kind == "refused":
                print(f"dropped a message of the run: {content}", file=sys.stderr)
            elif content == "Bye":
                self._left = self._left or "dismissed"
            elif content == "Drain":
                self._draining = True
            elif "Welcome" in content:
                self._welcome = True
            elif "Refused" in content:
                self._refused = _field(content["Refused"], "reason")
            elif "Define" in content:
                definition = _field(content["Define"], "definition")
                self._tasks.append((self._define, _field(definition, "bytes")))
            else:
                print(f"dropped an unknown control message: {content!r:.80}", file=sys.stderr)

    def _define(self, content):
        try:
            self.runner.define(content)
        except RveError as error:
            refusal = {"definition": list(name_of(content)), "reason": str(error)}
            self.port.send_control({"DefinitionRefused": refusal})

    def _answer(self, jobs):
        answers = [self.runner.answer(job, carried) for job, carried in jobs]
        try:
            self.port.send_replies(answers)
        except MessageTooLarge as error:
            text = msgpack.packb(EngineFault(str(error)).wire())
            failed = []
            for job, _ in jobs:
                reply = bare(job, "failed")
                reply["error_length"] = len(text)
                failed.append((reply, (b"", text)))
            self.port.send_replies(failed)

    def _exhausted(self):
        """Why the worker should make room for a fresh one, or None."""
        if self.options.recycle_jobs and self.runner.jobs >= self.options.recycle_jobs:
            return f"recycled after {self.runner.jobs} jobs"
        if self.options.recycle_memory:
            size = _resident_bytes() >> 20
            if size >= self.options.recycle_memory:
                return f"recycled at {size} MiB after {self.runner.jobs} jobs"
        return None


def _field(struct, name):
    """A field of a message of which only this field matters: the run sends structs as lists."""
    return struct[name] if isinstance(struct, dict) else struct[0]


def _resident_bytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
