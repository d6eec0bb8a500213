"""Where a restart file of LAMMPS keeps the tangential history of contacts, and how to write one there.

LAMMPS has no command that sets the history of a contact, but its restart files hold it. Behind everything else such a
file lists the atoms as doubles, one record after the other, each beginning with its own length::

    length  x y z  tag type mask image  vx vy vz  radius mass  wx wy wz     (atom style "sphere")
    length  partners  [tag  history x, y, z] ...                            (the pair style's fix)

Whole numbers are stored in the bits of a double. Lengths count themselves.
"""

import struct

import numpy

#: Doubles of a record before those of the fix.
ATOM = 16
#: Place of the tag in a record.
TAG = 4
#: Doubles of one partner: tag and history.
PARTNER = 4


class HistoryNotFound(Exception):
    """The file is not laid out as expected: another version of LAMMPS."""


def with_history(content, first, history):
    """The file with other histories.

    ``first``: the position of the atom that comes first; ``history``: by (tag, tag of the partner), the displacement that
    the atom's own tangential force comes from, m.
    """
    begin = content.find(struct.pack("<3d", *first)) - 8
    if begin < 0:
        raise HistoryNotFound("the first atom is not in the restart file")
    numbers = numpy.frombuffer(content, "<f8", (len(content) - begin) // 8, begin).copy()
    bits = numbers.view("<i8")
    place, missing = 0, set(history)
    while missing:
        if place + ATOM >= len(numbers):
            raise HistoryNotFound(f"{len(missing)} contacts have no place in the restart file")
        owner, partners = int(bits[place + TAG]), numbers[place + ATOM + 1]
        if not numbers[place] == ATOM + numbers[place + ATOM] == ATOM + 2 + PARTNER * partners:
            raise HistoryNotFound("the records of the restart file have other lengths than expected")
        for partner in range(int(partners)):
            at = place + ATOM + 2 + PARTNER * partner
            pair = (owner, int(bits[at]))
            if pair in missing:
                numbers[at + 1 : at + PARTNER] = history[pair]
                missing.discard(pair)
        place += int(numbers[place])
    return content[:begin] + numbers.tobytes() + content[begin + numbers.nbytes :]
