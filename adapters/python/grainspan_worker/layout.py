"""The wire layout, read from the description that the Rust side writes (``wire_layout.json``).

Nothing about places or numbers is repeated here: a change over there changes these types, and a test over there fails
when the shipped description is out of date.
"""

import json
from pathlib import Path

import numpy

LAYOUT = json.loads((Path(__file__).parent / "wire_layout.json").read_text())

#: Version of the conversation; a run of another version refuses this worker.
PROTOCOL = LAYOUT["protocol"]
#: The version of iceoryx2 that every process of a run needs.
ICEORYX2 = LAYOUT["iceoryx2"]
MAGIC = LAYOUT["magic"]
SNAPSHOT_FORMAT = LAYOUT["snapshot_format"]
SERVICES = LAYOUT["services"]
#: Requests that a worker keeps open at the run, and the most it may have open.
CREDITS, WINDOW = LAYOUT["credits"], LAYOUT["window"]
FRAME_KINDS = LAYOUT["frame_kinds"]
STATUSES = LAYOUT["statuses"]
#: Tangent kinds by keyword, and the reverse.
TANGENTS = LAYOUT["tangents"]
TANGENT_NAMES = {number: name for name, number in TANGENTS.items()}
FLAGS = LAYOUT["flags"]
OBSERVABLES = LAYOUT["observables"]

_FORMATS = {"u8": "u1", "u32": "<u4", "u64": "<u8", "f64": "<f8"}


def _record(name):
    structure = LAYOUT[name]
    fields = structure["fields"]
    return numpy.dtype(
        {
            "names": [field[0] for field in fields],
            "formats": [
                _FORMATS[element] if count == 1 else (_FORMATS[element], (count,))
                for _, _, element, count in fields
            ],
            "offsets": [field[1] for field in fields],
            "itemsize": structure["size"],
        }
    )


#: Record types of the start of every message, of a job and of a reply.
HEADER, JOB, REPLY = _record("header"), _record("job"), _record("reply")
