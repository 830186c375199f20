"""Surfaces of machines: revolved profiles, lofts of superellipses along a curve, rounded boxes; written as Wavefront OBJ.

Shells are closed, with faces oriented outward. Lengths are in metres.
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin

import matrices as m

# Corners around a cross-section.
AROUND = 24


class Shell:
    """A surface of triangles and quadrilaterals."""

    def __init__(self, points=(), faces=()):
        self.points, self.faces = list(points), list(faces)

    def __add__(self, other):
        shift = len(self.points)
        return Shell(self.points + other.points, self.faces + [tuple(corner + shift for corner in face) for face in other.faces])

    def moved(self, at=(0, 0, 0), rpy=(0, 0, 0)):
        """Returns the surface rotated by fixed-axis roll, pitch and yaw, then translated."""
        rotation = m.from_rpy(rpy)
        return Shell([m.add(m.apply(rotation, point), at) for point in self.points], self.faces)

    def scaled(self, x, y, z):
        faces = self.faces if x * y * z > 0 else [face[::-1] for face in self.faces]
        return Shell([(p[0] * x, p[1] * y, p[2] * z) for p in self.points], faces)

    def mirrored(self, out=-1):
        """Returns the surface, mirrored in the x-z plane if `out` is -1."""
        return self.scaled(1, out, 1)

    def volume(self):
        total = 0.0
        for face in self.faces:
            first = self.points[face[0]]
            for one, other in zip(face[1:], face[2:]):
                total += m.dot(first, m.cross(self.points[one], self.points[other])) / 6
        return total

    def obj(self):
        """Returns the OBJ text: corners in hundredths of a millimetre, equal corners shared."""
        known, lines, renumbered = {}, [], []
        for point in self.points:
            text = " ".join(coordinate(x) for x in point)
            if text not in known:
                known[text] = len(known) + 1
                lines.append(f"v {text}")
            renumbered.append(known[text])
        for face in self.faces:
            corners = [renumbered[corner] for corner in face]
            corners = [corner for index, corner in enumerate(corners) if corner != corners[index - 1]]
            if len(corners) > 2:
                lines.append("f " + " ".join(map(str, corners)))
        return "\n".join(lines) + "\n"


@dataclass
class Part:
    """A visible part of a link: file name, colour, surface, and mirroring scale."""

    name: str
    colour: str
    shell: Shell
    scale: tuple = (1, 1, 1)

    def visual(self, robot):
        """Returns its line in the URDF; its file is in the folder of `robot`."""
        scale = "" if self.scale == (1, 1, 1) else f' scale="{" ".join(map(str, self.scale))}"'
        mesh = f'<mesh filename="package://{robot}/shells/{self.name}.obj"{scale}/>'
        return f'    <visual><geometry>{mesh}</geometry><material name="{self.colour}"/></visual>'


def coordinate(x):
    """Formats a length to hundredths of a millimetre, without the zero before the point."""
    text = f"{x:.5f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text.replace("0.", ".", 1)


def skin(rings):
    """Returns the surface through rings with equal numbers of points, closed at both ends around their means, facing outward."""
    count = len(rings[0])
    middle = [[sum(p[i] for p in ring) / count for i in range(3)] for ring in (rings[0], rings[-1])]
    rings = [[middle[0]] * count, *rings, [middle[1]] * count]
    points = [point for ring in rings for point in ring]
    faces = []
    for row in range(len(rings) - 1):
        for column in range(count):
            here, beside = row * count + column, row * count + (column + 1) % count
            faces.append((here, beside, beside + count, here + count))
    shell = Shell(points, faces)
    return shell if shell.volume() > 0 else Shell(points, [face[::-1] for face in faces])


def rounded(corners, steps=4):
    """Returns a polyline (x, y, radius) with rounded corners, as points (x, y); corners without a radius stay sharp."""
    found = []
    for index, (x, y, *radius) in enumerate(corners):
        radius = radius[0] if radius else 0.0
        if not radius or index in (0, len(corners) - 1):
            found.append((x, y))
            continue
        before, after = corners[index - 1], corners[index + 1]
        a, b = (before[0] - x, before[1] - y), (after[0] - x, after[1] - y)
        la, lb = hypot(*a), hypot(*b)
        a, b = (a[0] / la, a[1] / la), (b[0] / lb, b[1] / lb)
        cosine = max(-1.0, min(1.0, a[0] * b[0] + a[1] * b[1]))
        half = ((1 + cosine) / (1 - cosine)) ** 0.5 if cosine < 1 else 0.0
        # Distance from the corner to the start of the arc: radius / tan(angle / 2).
        reach = min(radius * half, 0.499 * la, 0.499 * lb)
        start, end = (x + a[0] * reach, y + a[1] * reach), (x + b[0] * reach, y + b[1] * reach)
        for step in range(steps + 1):
            # A rational quadratic curve whose weight makes it an arc.
            t = step / steps
            weight = ((1 - cosine) / 2) ** 0.5
            w0, w1, w2 = (1 - t) ** 2, 2 * t * (1 - t) * weight, t**2
            whole = w0 + w1 + w2
            found.append(tuple((w0 * start[i] + w1 * (x, y)[i] + w2 * end[i]) / whole for i in (0, 1)))
    return found


def revolved(corners, around=AROUND, steps=3):
    """Returns a profile (radius, height, fillet), from bottom to top, revolved about z."""
    profile = rounded(corners, steps)
    turns = [2 * pi * step / around for step in range(around)]
    return skin([[(r * cos(t), r * sin(t), z) for t in turns] for r, z in profile])


def drum(radius, low, high, fillet=0.006, around=AROUND, steps=2):
    """Returns a cylinder about z with rounded edges."""
    return revolved([(0, low), (radius, low, fillet), (radius, high, fillet), (0, high)], around, steps)


def ring(radius, low, high, around=AROUND):
    """Returns a band about z with sharp edges: a seam between two shells."""
    return revolved([(0, low), (radius, low), (radius, high), (0, high)], around)


def superellipse(a, b, power, around):
    """Returns points (x, y) with |x / a|^power + |y / b|^power = 1."""
    found = []
    for step in range(around):
        t = 2 * pi * step / around
        c, s = cos(t), sin(t)
        # Along rays, because powers of cosine and sine would crowd points at the corners.
        r = (abs(c) ** power + abs(s) ** power) ** (-1 / power)
        found.append((a * r * c, b * r * s))
    return found


def loft(stations, u, v, around=AROUND, steps=4, start=(0.0, 1.0), end=(0.0, 1.0)):
    """Returns a surface through superellipses (centre, half width along u, half width along v, power) in planes along u and v.

    The stations are joined by a Catmull-Rom spline. u and v are two vectors, or two pairs for the first and the last
    station, between which the planes rotate. An end is domed by a height, except for a flat fraction of its width.
    """
    turning = isinstance(u[0], (tuple, list))
    (u0, u1), (v0, v1) = (u, v) if turning else ((u, u), (v, v))
    keys = [[*centre, a, b, power] for centre, a, b, power in stations]
    samples = spline(keys, steps)
    count = len(samples) - 1

    def axes(share):
        if not turning:
            return u0, v0
        return tuple(unit([p * (1 - share) + q * share for p, q in zip(*pair)]) for pair in ((u0, u1), (v0, v1)))

    def section(sample, share, scale=1.0, lift=(0, 0, 0)):
        x, y, z, a, b, power = sample
        one, other = axes(share)
        outline = superellipse(a * scale, b * scale, power, around)
        return [[c + l + one[i] * p + other[i] * q for i, (c, l) in enumerate(zip((x, y, z), lift))] for p, q in outline]

    rings = [section(sample, index / count) for index, sample in enumerate(samples)]

    def dome(sample, beside, share, height, flat):
        if not height:
            return []
        one, other = axes(share)
        out = unit(m.cross(one, other))
        if m.dot(out, m.subtract(sample[:3], beside[:3])) < 0:
            out = [-x for x in out]
        angles = [pi / 2 * step / 3 for step in range(1, 4)]
        return [section(sample, share, flat + (1 - flat) * cos(t), [height * sin(t) * x for x in out]) for t in angles]

    below = dome(samples[0], samples[1], 0.0, *start)[::-1]
    above = dome(samples[-1], samples[-2], 1.0, *end)
    return skin(below + rings + above)


def unit(vector):
    length = m.dot(vector, vector) ** 0.5
    return [x / length for x in vector]


def spline(keys, steps):
    """Returns a uniform Catmull-Rom spline through rows of numbers, with repeated ends."""
    found = []
    for index in range(len(keys) - 1):
        p0, p1 = keys[max(index - 1, 0)], keys[index]
        p2, p3 = keys[index + 1], keys[min(index + 2, len(keys) - 1)]
        for step in range(steps):
            t = step / steps
            row = []
            for a, b, c, d in zip(p0, p1, p2, p3):
                row.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
            found.append(row)
    return found + [list(keys[-1])]


def block(size, radius, at=(0, 0, 0), power=5.0, around=AROUND):
    """Returns a box with rounded edges, along z."""
    x, y, z = (0.5 * side for side in size)
    flat = 1 - radius / min(x, y)
    stations = [((*at[:2], at[2] - z + radius), x, y, power), ((*at[:2], at[2] + z - radius), x, y, power)]
    return loft(stations, (1, 0, 0), (0, 1, 0), around, 1, (radius, flat), (radius, flat))
