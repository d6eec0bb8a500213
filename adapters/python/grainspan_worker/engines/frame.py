"""A cell that an engine keeps unturned: engines whose boxes or histories cannot be rotated solve in a frame of their own.

``lab = Q own`` with a rotation ``Q`` that collects what was never applied. A material that is indifferent to the observer
answers the same, and turning the answer is exact for any size of rotation.
"""

import numpy

from .plane import polar, rotation


class Frame:
    """The rotation between an engine's own frame and that of the run."""

    def __init__(self, angle=0.0):
        self.angle = angle

    def stretch(self, gradient):
        """The stretch minus unit that the engine has to apply in its own frame, and the frame afterwards."""
        turned = rotation(self.angle)
        angle, strain = polar(turned.T @ numpy.asarray(gradient)[:2, :2] @ turned)
        return strain, Frame(self.angle + angle)

    def to_lab(self, tensor):
        """A tensor of the engine's frame as the run sees it."""
        turned = rotation(self.angle)
        return turned @ tensor @ turned.T


def root(stretch, steps):
    """``stretch^(1 / steps) - 1`` of a symmetric stretch: what each of equal steps applies."""
    values, directions = numpy.linalg.eigh(stretch)
    return directions @ numpy.diag(numpy.expm1(numpy.log(values) / steps)) @ directions.T
