"""How one message lies in memory: a header, then an array of jobs or replies with their snapshots, or MessagePack."""

import msgpack
import numpy
import xxhash

from .layout import FRAME_KINDS, HEADER, JOB, MAGIC, PROTOCOL

_KIND_NAMES = {number: name for name, number in FRAME_KINDS.items()}


class FrameError(Exception):
    """These bytes are not a message of this protocol."""


def _frame(kind, count, sender, body):
    header = numpy.zeros((), HEADER)
    header["magic"], header["version"], header["kind"] = MAGIC, PROTOCOL, FRAME_KINDS[kind]
    header["count"], header["length"], header["sender"] = count, HEADER.itemsize + len(body), sender
    return header.tobytes() + body


def control(message, sender):
    """A control message: ``{"Hello": {...}}``, ``{"Bye": {...}}``, ..."""
    return _frame("control", 0, sender, msgpack.packb(message, use_bin_type=True))


def replies(answers, sender):
    """Replies, each a pair of the wire record and ``(state, error)`` bytes."""
    records = b"".join(_sealed(record, error) for record, (_, error) in answers)
    tails = b"".join(state + error for _, (state, error) in answers)
    return _frame("replies", len(answers), sender, records + tails)


def _sealed(record, error):
    """The record with its checksum: XXH3 of the record with a checksum of 0, followed by the error text."""
    record["checksum"] = 0
    record["checksum"] = xxhash.xxh3_64_intdigest(record.tobytes() + error)
    return record.tobytes()


def empty(kind, sender):
    """A credit or a farewell."""
    return _frame(kind, 0, sender, b"")


def decode(content):
    """Reads a message of the run: ``("control", message)`` or ``("jobs", [(record, state), ...])``."""
    if len(content) < HEADER.itemsize:
        raise FrameError(f"a message of {len(content)} bytes is shorter than its header")
    header = numpy.frombuffer(content, HEADER, 1)[0]
    if header["magic"] != MAGIC:
        raise FrameError("a message does not begin with the mark of this protocol")
    if header["version"] != PROTOCOL:
        raise FrameError(f"a message of protocol version {header['version']}, but this worker speaks {PROTOCOL}")
    if header["length"] != len(content):
        raise FrameError(f"a message whose parts do not add up to its {len(content)} bytes")
    kind, body = _KIND_NAMES.get(int(header["kind"])), content[HEADER.itemsize :]
    if kind == "control":
        try:
            return kind, msgpack.unpackb(body, raw=False, strict_map_key=False)
        except Exception as error:
            raise FrameError(f"a control message that cannot be read: {error}") from error
    if kind == "jobs":
        return kind, _jobs(body, int(header["count"]))
    raise FrameError(f"a message of unknown kind {header['kind']}")


def _jobs(body, count):
    tail = count * JOB.itemsize
    if tail > len(body):
        raise FrameError("a message whose jobs do not fit in it")
    jobs = []
    for record in numpy.frombuffer(body, JOB, count):
        length = int(record["state_length"])
        if tail + length > len(body):
            raise FrameError("a message whose snapshots do not fit in it")
        jobs.append((record.copy(), body[tail : tail + length]))
        tail += length
    if tail != len(body):
        raise FrameError("a message with bytes left over")
    return jobs
