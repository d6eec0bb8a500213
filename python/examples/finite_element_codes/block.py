"""The mesh of the biaxial test as plain lists, for hosts that read files. Nodes and elements are counted from 0, row by row from below."""

import biaxial

COLUMNS, ROWS = biaxial.ELEMENTS
WIDTH, HEIGHT = biaxial.SIZE


def number(column: int, row: int) -> int:
    """The number of a node."""
    return row * (COLUMNS + 1) + column


def nodes() -> list[tuple[float, float]]:
    """Positions, m."""
    return [(i * WIDTH / COLUMNS, j * HEIGHT / ROWS) for j in range(ROWS + 1) for i in range(COLUMNS + 1)]


def elements() -> list[tuple[int, int, int, int]]:
    """Corners, counter-clockwise from below left."""
    corners = lambda i, j: (number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1))  # noqa: E731
    return [corners(i, j) for j in range(ROWS) for i in range(COLUMNS)]


def bottom() -> list[int]:
    """Nodes of the lower platen."""
    return [number(i, 0) for i in range(COLUMNS + 1)]


def top() -> list[int]:
    """Nodes of the upper platen."""
    return [number(i, ROWS) for i in range(COLUMNS + 1)]


def left() -> list[int]:
    """Nodes of the left side, from below."""
    return [number(0, j) for j in range(ROWS + 1)]


def right() -> list[int]:
    """Nodes of the right side, from below."""
    return [number(COLUMNS, j) for j in range(ROWS + 1)]
