"""Room in shared memory, looked at before it is taken: a write into a full file system ends the process without a word."""

import os

#: The file system of shared memory.
FOLDER = "/dev/shm"

#: Memory for the channel of a worker that joins, bytes.
WORKER_ROOM = 256 << 10

#: Left for others, bytes.
RESERVE = 128 << 10


def shortage(length):
    """Why shared memory cannot take ``length`` bytes more, with the remedy; None if it can or the system does not tell."""
    try:
        room = os.statvfs(FOLDER)
    except OSError:
        return None
    free, needed = room.f_bavail * room.f_frsize, length + RESERVE
    # A file system without a limit shows no blocks at all.
    if room.f_blocks == 0 or free >= needed:
        return None
    return (
        f"shared memory is full: {free // 1024} kB are free in {FOLDER} and {needed // 1024} kB are needed; `grainspan clean` "
        "removes what dead runs have left, a container gets more with --shm-size"
    )
