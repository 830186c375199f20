"""Rotations and poses as plain lists: sufficient for a URDF tree, without dependencies."""

from math import cos, sin

IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(a):
    return [list(row) for row in zip(*a)]


def apply(a, v):
    return [sum(a[i][k] * v[k] for k in range(3)) for i in range(3)]


def add(a, b):
    return [x + y for x, y in zip(a, b)]


def subtract(a, b):
    return [x - y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def from_rpy(rpy):
    """Returns the rotation by fixed-axis roll, pitch, yaw, as in a URDF."""
    roll, pitch, yaw = rpy
    x = [[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]]
    y = [[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]]
    z = [[cos(yaw), -sin(yaw), 0], [sin(yaw), cos(yaw), 0], [0, 0, 1]]
    return times(z, times(y, x))


def about(axis, angle):
    """Rodrigues' formula."""
    x, y, z = axis
    c, s, d = cos(angle), sin(angle), 1 - cos(angle)
    return [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
    ]


def steiner(mass, r):
    """Returns the inertia of a point mass at r about the origin."""
    square = dot(r, r)
    return [[mass * ((square if i == j else 0.0) - r[i] * r[j]) for j in range(3)] for i in range(3)]


def plus(a, b):
    return [[x + y for x, y in zip(p, q)] for p, q in zip(a, b)]
