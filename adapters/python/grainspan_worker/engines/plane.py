"""Plane tensors that several engines need."""

import numpy


def polar(gradient):
    """Rotation angle and stretch minus unit of ``F = I + H = R U``; the stretch is formed from H without cancellation."""
    h = numpy.asarray(gradient, dtype=float)[:2, :2]
    angle = numpy.arctan2(h[1, 0] - h[0, 1], 2.0 + h[0, 0] + h[1, 1])
    cosine, sine = numpy.cos(angle), numpy.sin(angle)
    # U - I = R^T H + (R^T - I), with 1 - cos(angle) written as 2 sin^2(angle / 2).
    lost = 2.0 * numpy.sin(0.5 * angle) ** 2
    turned = numpy.array([[cosine, sine], [-sine, cosine]]) @ h + numpy.array([[-lost, sine], [-sine, -lost]])
    return angle, 0.5 * (turned + turned.T)


def rotation(angle):
    """The matrix that turns by ``angle``, rad, counter-clockwise."""
    cosine, sine = numpy.cos(angle), numpy.sin(angle)
    return numpy.array([[cosine, -sine], [sine, cosine]])


def anisotropy(fabric):
    """Major over minor principal value, minus 1; 0 without a minor one."""
    minor, major = numpy.linalg.eigvalsh(fabric)
    return major / minor - 1.0 if minor > 0.0 else 0.0


def lasting(count, origin, end):
    """Which grains and contacts last when grains with fewer than two contacts are removed until none is left."""
    alive, kept = numpy.ones(count, bool), numpy.ones(len(origin), bool)
    while True:
        degree = numpy.bincount(origin[kept], minlength=count) + numpy.bincount(end[kept], minlength=count)
        rattlers = alive & (degree < 2)
        if not rattlers.any():
            return alive, kept
        alive &= ~rattlers
        kept &= alive[origin] & alive[end]
