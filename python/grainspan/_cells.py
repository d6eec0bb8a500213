"""What cells are made of, as text for the extension module."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Union

from . import _toml
from .errors import InputError
from .packing import Packing

PackingLike = Union[str, "os.PathLike[str]", Packing]
ContactLike = Union[str, "os.PathLike[str]", Mapping[str, Any]]


def contact_table(contact: ContactLike) -> Mapping[str, Any]:
    """The table ``[contact]``: itself, or that of an input file."""
    if isinstance(contact, Mapping):
        return contact
    table = _toml.read(contact).get("contact")
    if table is None:
        raise InputError(f"{contact} has no table [contact]")
    return table


def rve_table(accuracy: str | None, rve: Mapping[str, Any] | None) -> dict[str, Any]:
    """The table ``[rve]``; an accuracy that is given twice must be the same."""
    table = dict(rve or {})
    if accuracy is None:
        return table
    if table.setdefault("accuracy", accuracy) != accuracy:
        raise InputError(f"accuracy = {accuracy!r} contradicts {table['accuracy']!r} in rve; leave one of them out")
    return table


class CellText(AbstractContextManager):
    """Writes cells as TOML. Packings that lie in no file are written to a temporary folder, which lives until the end of the block."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    def __exit__(self, *_: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def path(self, packing: PackingLike) -> Path:
        """A file with the packing."""
        if not isinstance(packing, Packing):
            return Path(packing).absolute()
        # A file is used as long as it holds what the object does.
        if packing.path is not None and packing.is_as_in_its_file():
            return packing.path.absolute()
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="grainspan-")
        self._count += 1
        place = Path(self._folder.name) / f"packing-{self._count}.json"
        # The object is not tied to a file that is about to be removed.
        packing.write(place)
        return place

    def cell(self, packing: PackingLike, contact: ContactLike, rve: Mapping[str, Any], **more: Any) -> str:
        """Packing, contact law and accuracy, and further keys of an element test."""
        table = {"packing": self.path(packing), "contact": contact_table(contact), "rve": rve, **more}
        return _toml.write(table)
