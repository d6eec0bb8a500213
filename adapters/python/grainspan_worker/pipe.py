"""A run at the other end of standard input and output: the same messages without shared memory.

For tests, for debuggers, and where iceoryx2 cannot be had. One run, one worker; the run ends when the pipe is closed.
"""

import os
import select

import numpy

from . import frames
from .layout import HEADER

#: Bytes taken from the pipe at a time.
CHUNK = 1 << 16


class PipePort:
    """Speaks with whoever started this process."""

    def __init__(self):
        self._input = 0
        # What an engine prints must not mix with the messages: it goes to standard error from here on.
        self._output = os.dup(1)
        os.dup2(2, 1)
        self._heard, self._closed, self._told = b"", False, False

    def poll(self, wait):
        """Everything that has arrived, as :meth:`SharedMemoryPort.poll` says."""
        if not self._closed and select.select([self._input], [], [], max(0.0, wait))[0]:
            chunk = os.read(self._input, CHUNK)
            self._heard += chunk
            self._closed = not chunk
        events = []
        while (content := self._message()) is not None:
            try:
                events.append(frames.decode(content))
            except frames.FrameError as error:
                events.append(("refused", str(error)))
        if self._closed and not self._told:
            self._told = True
            events.append(("lost", "the pipe was closed"))
        return events

    def _message(self):
        """The next whole message, taken out of what was heard."""
        if len(self._heard) < HEADER.itemsize:
            return None
        length = max(int(numpy.frombuffer(self._heard, HEADER, 1)[0]["length"]), HEADER.itemsize)
        if len(self._heard) < length:
            return None
        content, self._heard = self._heard[:length], self._heard[length:]
        return content

    def send_control(self, message):
        """Sends a control message."""
        self._send(frames.control(message, 1))

    def send_replies(self, answers):
        """Sends the answers to a job slice."""
        self._send(frames.replies(answers, 1))

    def close(self):
        """Says that this port closes."""
        if not self._closed:
            self._send(frames.empty("close", 1))
            self._closed = True

    def _send(self, content):
        rest = memoryview(content)
        try:
            while rest:
                rest = rest[os.write(self._output, rest) :]
        except BrokenPipeError:
            self._closed = True
