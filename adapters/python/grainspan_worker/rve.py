"""The one class that a user writes."""

from .words import check


class Rve:
    """One representative volume with a committed and at most one trial state.

    A **trial is a pure function** of (committed state, target, ask): it must not depend on trials made before, on the
    time or on other points. Raise one of the errors of this package to refuse a request; any other exception counts as
    a breakdown of the engine and costs one failed answer, not the worker.

    Either override :meth:`snapshot` and :meth:`restore`, or neither: without them the worker rebuilds states by solving
    the path of committed targets again.
    """

    #: Name in snapshots and messages; snapshots of other engines are refused.
    engine = "unnamed"
    #: Version, for people, and to keep workers of different versions apart.
    version = "0"
    #: Space dimensions served.
    dimensions = (2,)
    #: Contact laws served, by the keywords of scene files.
    laws = ("linear",)
    #: Tangent operators served beside "none", by keyword. Without one the run finds tangents by finite differences.
    tangents = ()
    #: Optional results that :attr:`Answer.observed` holds wherever they are asked for, by name; runs show the others as NaN. An answer
    #: without one of them is a fault of the engine.
    observables = ()
    #: What it follows of the parts of definitions that not every engine follows, by their keys in scenes: see ``features`` in
    #: ``docs/reference/protocol.md``. A scene that uses another one is refused.
    features = ()
    #: Whether the same request has the same answer to the last bit in every worker.
    deterministic = True

    def __init__(self, definition):
        """Builds the initial committed state from a :class:`Definition`."""
        raise NotImplementedError

    def trial(self, gradient, ask):
        """Deforms from the committed state by ``gradient`` (3x3, ``H = F - I``, total) and returns an :class:`Answer`.

        Replaces an earlier trial; the committed state stays as it is. A target of zero is asked as well: answer it with
        the committed state and the flag ``skipped_null_target``.
        """
        raise NotImplementedError

    def commit(self):
        """Makes the trial state the committed state."""
        raise NotImplementedError

    def rollback(self):
        """Drops the trial state. May be left out: the worker then restores or rebuilds the committed state."""
        raise NotImplementedError

    def snapshot(self):
        """Bytes of the latest state: the trial's if there is one, else the committed. Equal states give equal bytes."""
        raise NotImplementedError

    def restore(self, content):
        """Makes bytes of :meth:`snapshot` the committed state and drops the trial."""
        raise NotImplementedError

    def release(self):
        """Frees what Python does not free by itself; called once."""

    @classmethod
    def has_snapshots(cls):
        """Whether states of this engine are bytes; otherwise they are paths."""
        return cls.snapshot is not Rve.snapshot

    @classmethod
    def capabilities(cls, replay=False):
        """What the engine can do, in the form of the hello. ``replay``: as if it had no snapshots.

        Raises :class:`ValueError` for a word in ``laws``, ``tangents``, ``observables`` or ``features`` that does not exist.
        """
        check(cls)
        return {
            "engine": cls.engine,
            "version": cls.version,
            "dimensions": list(cls.dimensions),
            "tangents": list(cls.tangents),
            "laws": list(cls.laws),
            "snapshot": "path" if replay or not cls.has_snapshots() else "state",
            "deterministic": bool(cls.deterministic),
            "observables": list(cls.observables),
            "features": list(cls.features),
        }
