"""Reading and writing TOML."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The tables of a TOML file."""
    try:
        # Editors of some systems begin a file with a byte order mark, which the program takes too.
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"cannot read {path}: {error}") from error


def write(table: Mapping[str, Any]) -> str:
    """A mapping as TOML; keys whose value is ``None`` are left out."""
    return "".join(f"{member}\n" for member in _members(table))


def _members(table: Mapping[str, Any]) -> Iterator[str]:
    for key, value in table.items():
        if value is None:
            continue
        try:
            text = _value(value)
        except InputError as error:
            raise InputError(f"{key}: {error}") from error
        yield f"{_key(key)} = {text}"


def _key(key: Any) -> str:
    return _text(str(key))


def _text(text: str) -> str:
    """A basic string: as JSON has it, but TOML knows no pairs of surrogates and wants DEL escaped."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise InputError(f"{text!r} is not valid Unicode, which input files are written in") from error
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _value(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        if not math.isfinite(value):
            raise InputError(f"{value} is not a finite number")
        # The shortest text that reads back to the same bits.
        return repr(float(value))
    if isinstance(value, (str, os.PathLike)):
        return _text(os.fspath(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_members(value)) + " }"
    if isinstance(value, (Sequence, np.ndarray)):
        return "[" + ", ".join(_value(member) for member in value) + "]"
    raise InputError(f"{value!r} cannot be written to an input file")
