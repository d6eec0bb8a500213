"""The envelope round an engine's opaque state: MessagePack of format, engine, checksum, payload."""

import msgpack

from .content import name_of
from .errors import SnapshotRefused
from .layout import SNAPSHOT_FORMAT


def _checksum(payload):
    return int.from_bytes(name_of(payload)[:8], "little")


def seal(engine, payload):
    """Wraps an engine's payload."""
    return msgpack.packb([SNAPSHOT_FORMAT, engine, _checksum(payload), payload], use_bin_type=True)


def unseal(engine, content):
    """Checks an envelope and returns the payload; raises :class:`SnapshotRefused` with the reason."""
    try:
        layout, found, checksum, payload = msgpack.unpackb(content, raw=False)
    except Exception as error:
        raise SnapshotRefused(f"these bytes are not a snapshot: {error}") from error
    if layout != SNAPSHOT_FORMAT:
        raise SnapshotRefused(f"snapshot format {layout}, but this program reads format {SNAPSHOT_FORMAT}")
    if found != engine:
        raise SnapshotRefused(f"snapshot of engine `{found}`, but `{engine}` was asked to restore it")
    if not isinstance(payload, bytes) or checksum != _checksum(payload):
        raise SnapshotRefused("snapshot is damaged: its checksum does not match its content")
    return payload
