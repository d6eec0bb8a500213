"""Words with which an engine says what it can do, and the check of them: a word that nobody knows would be left aside without a word."""

from .layout import REPLY, TANGENTS

#: Contact laws of scenes.
LAWS = ("linear", "hertz_mindlin")

#: Parts of scenes that not every engine follows, see ``docs/reference/protocol.md``.
FEATURES = (
    "contact.rolling_stiffness",
    "packing.rolling_moments",
    "contact.damping",
    "contact.unloading",
    "contact.rotations",
    "rve.criterion",
    "rve.at_step_cap",
    "rve.max_evaluations",
    "rve.solver",
    "rve.damping",
    "economy.zero_increments",
)

#: Optional results: the fields of ``observed`` of a reply.
RESULTS = tuple(name.split(".", 1)[1] for name in REPLY.names if name.startswith("observed."))

_KNOWN = {"laws": LAWS, "tangents": tuple(TANGENTS), "observables": RESULTS, "features": FEATURES}


class UnknownWord(ValueError):
    """An engine declares something that does not exist; the text names the word and those that there are."""


def check(rve_class):
    """Refuses an engine class with an unknown word in ``laws``, ``tangents``, ``observables`` or ``features``.

    Raises :class:`UnknownWord`.
    """
    for attribute, known in _KNOWN.items():
        given = getattr(rve_class, attribute)
        if isinstance(given, str):
            raise UnknownWord(f"engine `{rve_class.engine}`: `{attribute}` is a tuple of words, such as ({given!r},)")
        unknown = [word for word in given if word not in known]
        if unknown:
            raise UnknownWord(
                f"engine `{rve_class.engine}`: unknown {', '.join(f'`{word}`' for word in unknown)} in `{attribute}`; there are "
                f"{', '.join(known)}"
            )
