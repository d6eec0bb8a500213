"""What engines share that serve discs and keep their states as bytes of their own."""

import numpy

from grainspan_worker.engines.frame import Frame
from grainspan_worker.errors import DefinitionRefused, TargetTooLarge, Unsupported
from grainspan_worker.rve import Rve


class OpaqueStateRve(Rve):
    """A committed state and at most one trial state, both bytes; a trial loads the committed one first.

    Subclasses set ``committed`` when they are built and ``latest`` in a trial.
    """

    deterministic = True
    committed = b""
    latest = None

    def __init__(self, definition):
        """Remembers what the RVE is made of; refuses what these engines do not serve."""
        if definition.cohesion or not definition.rotations_free:
            raise DefinitionRefused(
                f"engine `{self.engine}` serves grains that rotate freely and do not stick together: contact.rotations = \"free\" and "
                "contact.cohesion = 0"
            )
        self.made_of = definition
        self.initial_area = numpy.linalg.det(definition.cell)
        # They find one image of a pair.
        if self.initial_area / max(numpy.hypot(*row) for row in definition.cell) < 4.0 * definition.radii.max():
            raise DefinitionRefused(f"the cell is too small for engine `{self.engine}`: it must be wider than two grains")

    def stretch(self, angle, gradient):
        """Strain of a target in the frame that has turned by ``angle``, and the frame after it; refuses a bad target."""
        if not numpy.array_equal(gradient[2], [0, 0, 0]) or gradient[:2, 2].any():
            raise Unsupported("deformation out of the plane")
        strain, frame = Frame(angle).stretch(gradient)
        if numpy.linalg.norm(strain) > self.made_of.largest_target:
            raise TargetTooLarge(numpy.linalg.norm(strain), self.made_of.largest_target)
        return strain, frame

    def commit(self):
        """The trial state becomes the committed state."""
        self.committed, self.latest = self.latest, None

    def rollback(self):
        """Drops the trial state."""
        self.latest = None

    def snapshot(self):
        """The latest state."""
        return self.latest or self.committed

    def restore(self, content):
        """Takes over a committed state."""
        self.committed, self.latest = content, None
