"""A worker's end of a run in shared memory: one iceoryx2 client, blocking waits, the run's death seen by the kernel.

Each request is at the same time an uplink message and the permission for one downlink message: the worker keeps a few
requests open, the run answers them in the order in which they came.
"""

import ctypes
import os
import select
import time
from collections import deque

import iceoryx2

from . import frames, shared_memory
from .errors import MessageTooLarge
from .layout import CREDITS, SERVICES, WINDOW
from .run_record import RunNotFound

#: How long a port that closes waits for its last words to be read; the shorter time after a dismissal.
FAREWELL, FAREWELL_DISMISSED = 5.0, 0.25


class SharedMemoryPort:
    """Joins the run of ``record`` (see :mod:`run_record`)."""

    def __init__(self, record):
        short = shared_memory.shortage(shared_memory.WORKER_ROOM)
        if short:
            raise RunNotFound(short)
        self.sender = int.from_bytes(os.urandom(8), "little") or 1
        self.limit = record["limits"]["message_bytes"]
        self._open, self._outbox = deque(), deque()
        self._greeted = self._dismissed = self._told_lost = False
        self._lost = None
        #: Length of the longest message so far: memory for one of that length has been there.
        self._longest = 0
        self._node = _node(record)
        exchange = self._service(SERVICES["exchange"])
        self._exchange = exchange.request_response(
            iceoryx2.Slice[ctypes.c_uint8], iceoryx2.Slice[ctypes.c_uint8]
        ).open()
        self._to_macro_service = self._service(SERVICES["to_macro"]).event().open()
        self._to_worker_service = self._service(SERVICES["to_worker"]).event().open()
        port_name = iceoryx2.PortName.new(f"{self.sender:016x}")
        self._listener = self._to_worker_service.listener_builder().name(port_name).create()
        self._to_macro = self._to_macro_service.notifier_builder().create()
        self._client = (
            self._exchange.client_builder()
            .backpressure_strategy(iceoryx2.BackpressureStrategy.DiscardData)
            .allocation_strategy(iceoryx2.AllocationStrategy.Static)
            .initial_max_slice_len(self.limit)
            .create()
        )
        # A process of its own is watched; a run in this very process (a test) ends with it.
        self._macro = None if record["pid"] == os.getpid() else os.pidfd_open(record["pid"])
        self._waits = (
            iceoryx2.WaitSetBuilder.new()
            .signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
            .create(iceoryx2.ServiceType.Ipc)
        )
        self._attached = [self._waits.attach_notification(self._listener)]
        if self._macro is not None:
            self._macro_descriptor = iceoryx2.FileDescriptor.non_owning_new(self._macro)
            self._attached.append(self._waits.attach_notification_fd(self._macro_descriptor))

    def _service(self, label):
        return self._node.service_builder(iceoryx2.ServiceName.new(label))

    def poll(self, wait):
        """Everything that has arrived, waiting up to ``wait`` seconds if nothing has: ``(kind, content)`` pairs.

        Kinds are ``"control"``, ``"jobs"``, ``"lost"`` (the run has ended; content is the reason) and ``"refused"``
        (bytes that are not a message; content says why).
        """
        events = self._drain()
        if events or wait <= 0:
            return events
        self._waits.wait_and_process_with_timeout(iceoryx2.Duration.from_secs_f64(min(wait, 86_400.0)))
        return self._drain()

    def send_control(self, message):
        """Sends a control message."""
        self._greeted = self._greeted or "Hello" in message
        self._send(frames.control(message, self.sender))

    def send_replies(self, answers):
        """Sends the answers to a job slice, in several messages if they do not fit one; raises :class:`MessageTooLarge` when
        one answer alone does not."""
        try:
            self._send(frames.replies(answers, self.sender))
        except MessageTooLarge:
            if len(answers) < 2:
                raise
            middle = len(answers) // 2
            self.send_replies(answers[:middle])
            self.send_replies(answers[middle:])

    def close(self):
        """Says that this port closes and waits until the run has heard everything."""
        known, self._greeted = self._greeted, False
        if not known or self._lost:
            return
        self._send(frames.empty("close", self.sender))
        end = time.monotonic() + (FAREWELL_DISMISSED if self._dismissed else FAREWELL)
        while (self._outbox or self._open) and not self._lost and time.monotonic() < end:
            self._waits.wait_and_process_with_timeout(iceoryx2.Duration.from_millis(20))
            self._drain()

    def _drain(self):
        self._listener.try_wait()
        if self._macro is not None and select.select([self._macro], [], [], 0)[0]:
            self._lost = self._lost or "the run's process has ended"
        events = self._receive()
        if not self._lost:
            self._flush()
            self._grant()
        if self._lost and not self._told_lost:
            self._told_lost = True
            events.append(("lost", self._lost))
        return events

    def _receive(self):
        """Answers that have come. Requests are answered in order, so only the oldest is looked at."""
        events = []
        while self._open:
            oldest = self._open[0]
            response = oldest.receive()
            if response is not None:
                payload = response.payload()
                content = ctypes.string_at(payload.as_ptr(), payload.len())
                del payload
                response.delete()
                try:
                    event = frames.decode(content)
                except frames.FrameError as error:
                    event = ("refused", str(error))
                self._dismissed = self._dismissed or event == ("control", "Bye")
                events.append(event)
            elif oldest.is_connected:
                break
            elif oldest.has_response:
                # It was answered between the two looks.
                continue
            self._open.popleft().delete()
        return events

    def _flush(self):
        while self._outbox and len(self._open) < WINDOW and not self._lost:
            self._request(self._outbox.popleft())

    def _grant(self):
        """Keeps enough permissions at the run."""
        while self._greeted and not self._lost and len(self._open) < CREDITS:
            self._request(frames.empty("credit", self.sender))

    def _send(self, content):
        if len(content) > self.limit:
            raise MessageTooLarge(f"a message of {len(content)} bytes does not fit the channel's {self.limit} bytes")
        self._outbox.append(content)
        self._flush()
        self._grant()

    def _request(self, content):
        if not self._has_room(len(content)):
            return
        request = self._client.loan_slice_uninit(len(content))
        ctypes.memmove(request.payload().as_ptr(), content, len(content))
        pending = request.assume_init().send()
        if pending.number_of_server_connections == 0:
            self._lost = self._lost or "the run has closed its channel"
            return
        self._open.append(pending)
        self._to_macro.notify()

    def _has_room(self, length):
        """Whether shared memory can hold a message; where it cannot, the run is lost for this worker."""
        if length > self._longest:
            short = shared_memory.shortage(length)
            if short:
                self._lost = self._lost or short
                return False
            self._longest = length
        return True


def _node(record):
    """A node with a configuration made here: the default would read a file in the working directory."""
    config = iceoryx2.config.default()
    config.global_cfg.prefix = iceoryx2.FileName.new(record["prefix"])
    config.global_cfg.root_path = iceoryx2.Path.new(str(record["root"]))
    return (
        iceoryx2.NodeBuilder.new()
        .config(config)
        .signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
        .create(iceoryx2.ServiceType.Ipc)
    )
