"""Content identity: a state or definition is named by a hash of its bytes."""

import xxhash

#: The name of nothing: a definition's own initial state is asked for with it.
NONE = bytes(16)


def name_of(content):
    """128-bit XXH3 of the bytes, little endian."""
    return xxhash.xxh3_128_intdigest(content).to_bytes(16, "little")


def short(name):
    """The first digits of a name, for texts."""
    return name[:6].hex()
