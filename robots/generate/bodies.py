"""Links and joints of a robot under construction, its URDF text, and the kinematics for its profile."""

from dataclasses import dataclass, field
from math import pi, sqrt

import matrices as m

ALONG_X = (0.0, pi / 2, 0.0)
ALONG_Y = (pi / 2, 0.0, 0.0)
COLOURS = {
    "white": (0.93, 0.93, 0.93),
    "grey": (0.55, 0.57, 0.6),
    "black": (0.15, 0.15, 0.16),
    "orange": (0.95, 0.5, 0.13),
    "blue": (0.3, 0.5, 0.75),
}


@dataclass
class Solid:
    """A primitive with uniform density. A massless primitive is only a shape."""

    kind: str
    size: tuple
    at: tuple = (0.0, 0.0, 0.0)
    rpy: tuple = (0.0, 0.0, 0.0)
    mass: float = 0.0
    colour: str = "white"
    # a tyre with a crown: it touches as a sphere of its radius, at one point
    crowned: bool = False

    def inertia(self):
        """Returns the inertia about its centre, in its own axes."""
        mass = self.mass
        if self.kind == "box":
            x, y, z = self.size
            return diagonal(mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y))
        if self.kind == "sphere":
            return diagonal(*[0.4 * mass * self.size[0] ** 2] * 3)
        radius, length = self.size
        across = mass * (3 * radius * radius + length * length) / 12
        return diagonal(across, across, mass * radius * radius / 2)

    def collision(self):
        if self.crowned:
            return f'{origin(self.at, (0, 0, 0))}<geometry><sphere radius="{number(self.size[0])}"/></geometry>'
        return f"{origin(self.at, self.rpy)}<geometry>{self.geometry()}</geometry>"

    def geometry(self):
        if self.kind == "box":
            return f'<box size="{numbers(self.size)}"/>'
        if self.kind == "sphere":
            return f'<sphere radius="{number(self.size[0])}"/>'
        return f'<cylinder radius="{number(self.size[0])}" length="{number(self.size[1])}"/>'


def box(size, at=(0, 0, 0), mass=0.0, colour="white", rpy=(0, 0, 0)):
    return Solid("box", size, at, rpy, mass, colour)


def cylinder(radius, length, at=(0, 0, 0), rpy=(0, 0, 0), mass=0.0, colour="white", crowned=False):
    return Solid("cylinder", (radius, length), at, rpy, mass, colour, crowned)


def sphere(radius, at=(0, 0, 0), mass=0.0, colour="white"):
    return Solid("sphere", (radius,), at, (0, 0, 0), mass, colour)


def diagonal(x, y, z):
    return [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]


@dataclass
class Link:
    name: str
    solids: list = field(default_factory=list)
    # published mass, centre of mass and inertia about it in the link's axes; None computes them from the solids
    published: tuple = None
    # visible parts if they differ from the solids, and the robot whose folder contains these shells
    parts: list = field(default_factory=list)
    package: str = ""

    def inertial(self):
        if self.published:
            return self.published
        mass = sum(solid.mass for solid in self.solids)
        if mass == 0.0:
            return None
        com = [sum(solid.mass * solid.at[i] for solid in self.solids) / mass for i in range(3)]
        total = diagonal(0.0, 0.0, 0.0)
        for solid in self.solids:
            r = m.from_rpy(solid.rpy)
            turned = m.times(r, m.times(solid.inertia(), m.transposed(r)))
            total = m.plus(total, m.plus(turned, m.steiner(solid.mass, m.subtract(solid.at, com))))
        return mass, com, total


@dataclass
class Joint:
    name: str
    kind: str
    parent: str
    child: str
    at: tuple = (0.0, 0.0, 0.0)
    rpy: tuple = (0.0, 0.0, 0.0)
    axis: tuple = (0.0, 0.0, 1.0)
    lower: float = None
    upper: float = None
    velocity: float = None
    effort: float = None
    damping: float = 0.0
    mimic: tuple = None


class Robot:
    def __init__(self, name, comment):
        self.name, self.comment = name, comment
        self.links, self.joints = [], []

    def link(self, name, *solids, published=None):
        self.links.append(Link(name, list(solids), published))
        return name

    def joint(self, name, kind, parent, child, **rest):
        self.joints.append(Joint(name, kind, parent, child, **rest))

    def frame(self, name, parent, at=(0, 0, 0), rpy=(0, 0, 0)):
        """Adds a link without mass or shape, fixed to another link."""
        self.joint(f"{name}_joint", "fixed", parent, name, at=at, rpy=rpy)
        self.link(name)

    def dress(self, parts, package=None, prefix=""):
        """Sets the parts of the links, {link without prefix: parts}, which are files of this robot or of `package`."""
        for link in self.links:
            link.parts = parts.get(link.name.removeprefix(prefix), link.parts)
            link.package = package or self.name
            # Cameras show a collision shape in the colour of the visual at the same index.
            places = zip(link.solids, link.parts)
            assert all(solid.colour == part.colour for solid, part in places), f"{link.name}: colours of its parts"
            assert not link.parts or len(link.parts) >= len(link.solids), f"{link.name}: fewer parts than solids"

    def independent(self):
        return [joint for joint in self.joints if joint.kind != "fixed" and joint.mimic is None]

    def positions(self, pose):
        """Returns the position of every moving joint at a pose {independent joint: position}."""
        found = {}
        for joint in self.joints:
            if joint.mimic:
                master, multiplier, offset = joint.mimic
                found[joint.name] = multiplier * pose[master] + offset
            elif joint.kind != "fixed":
                found[joint.name] = pose[joint.name]
        return found

    def place(self, pose):
        """Returns {link: (rotation, position)} in the frame of the root link."""
        positions = self.positions(pose)
        places = {self.links[0].name: (m.IDENTITY, [0.0, 0.0, 0.0])}
        for joint in self.joints:
            rotation, position = places[joint.parent]
            position = m.add(position, m.apply(rotation, joint.at))
            rotation = m.times(rotation, m.from_rpy(joint.rpy))
            if joint.kind == "prismatic":
                slide = [positions[joint.name] * x for x in joint.axis]
                position = m.add(position, m.apply(rotation, slide))
            elif joint.kind != "fixed":
                rotation = m.times(rotation, m.about(joint.axis, positions[joint.name]))
            places[joint.child] = (rotation, position)
        return places

    def inertia_about(self, joint, pose):
        """Returns the inertia at the joint with all others locked: the diagonal entry of the mass matrix."""
        places = self.place(pose)
        moved = {}
        for other in self.joints:
            if other.name == joint.name:
                moved[other.child] = 1.0
            elif other.mimic and other.mimic[0] == joint.name:
                moved[other.child] = other.mimic[1]
            elif other.parent in moved:
                moved[other.child] = moved[other.parent]
        rotation, origin = places[joint.child]
        axis = m.apply(rotation, joint.axis)
        total = 0.0
        for link in self.links:
            if link.name not in moved or link.inertial() is None:
                continue
            mass, com, inertia = link.inertial()
            if joint.kind == "prismatic":
                total += mass * moved[link.name] ** 2
                continue
            rotation, position = places[link.name]
            arm = m.cross(axis, m.subtract(m.add(position, m.apply(rotation, com)), origin))
            local = m.apply(m.transposed(rotation), axis)
            total += mass * m.dot(arm, arm) + m.dot(local, m.apply(inertia, local))
        return total

    def damping(self, joint, kp, pose):
        """Returns the critical damping at a pose, rounded to two digits."""
        return float(f"{2 * sqrt(kp * self.inertia_about(joint, pose)):.2g}")

    def mass(self):
        return sum(link.inertial()[0] for link in self.links if link.inertial())

    def urdf(self):
        used = {solid.colour for link in self.links for solid in link.solids}
        used |= {part.colour for link in self.links for part in link.parts}
        lines = ['<?xml version="1.0"?>', "<!--", *[f"  {line}".rstrip() for line in self.comment.strip().splitlines()]]
        lines += ["-->", f'<robot name="{self.name}">']
        for colour in sorted(used):
            lines.append(f'  <material name="{colour}"><color rgba="{numbers(COLOURS[colour])} 1"/></material>')
        above = {joint.child: joint for joint in self.joints}
        for link in self.links:
            lines.append("")
            if link.name in above:
                lines += joint_lines(above[link.name])
            lines += link_lines(link)
        return "\n".join(lines + ["</robot>", ""])


def joint_lines(joint):
    lines = [f'  <joint name="{joint.name}" type="{joint.kind}">']
    lines += [f'    <parent link="{joint.parent}"/>', f'    <child link="{joint.child}"/>']
    if any(joint.at) or any(joint.rpy):
        lines.append(f"    {origin(joint.at, joint.rpy)}")
    if joint.kind != "fixed":
        lines.append(f'    <axis xyz="{numbers(joint.axis)}"/>')
        limits = [(key, getattr(joint, key)) for key in ("lower", "upper", "velocity", "effort")]
        limits = [f'{key}="{number(value)}"' for key, value in limits if value is not None]
        if limits:
            lines.append(f"    <limit {' '.join(limits)}/>")
        if joint.damping:
            lines.append(f'    <dynamics damping="{number(joint.damping)}" friction="0"/>')
        if joint.mimic:
            master, multiplier, offset = joint.mimic
            lines.append(f'    <mimic joint="{master}" multiplier="{number(multiplier)}" offset="{number(offset)}"/>')
    return lines + ["  </joint>"]


def link_lines(link):
    inertial = link.inertial()
    if inertial is None and not link.solids:
        return [f'  <link name="{link.name}"/>']
    lines = [f'  <link name="{link.name}">']
    if inertial:
        mass, com, i = inertial
        entries = [("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2)]
        inertia = " ".join(f'{key}="{number(i[row][column])}"' for key, row, column in entries)
        lines += ["    <inertial>", f"      {origin(com, (0, 0, 0))}", f'      <mass value="{number(mass)}"/>']
        lines += [f"      <inertia {inertia}/>", "    </inertial>"]
    lines += [part.visual(link.package) for part in link.parts]
    for solid in link.solids:
        body = f"{origin(solid.at, solid.rpy)}<geometry>{solid.geometry()}</geometry>"
        if not link.parts:
            lines.append(f'    <visual>{body}<material name="{solid.colour}"/></visual>')
        lines.append(f"    <collision>{solid.collision()}</collision>")
    return lines + ["  </link>"]


def origin(at, rpy):
    turned = f' rpy="{numbers(rpy)}"' if any(rpy) else ""
    return f'<origin xyz="{numbers(at)}"{turned}/>'


def number(x):
    x = 0.0 if abs(x) < 1e-15 else x
    # Angles with all digits, for exact right angles; everything else rounded.
    for fraction in (pi / 4, pi / 3, pi / 6):
        if x and abs(x / fraction - round(x / fraction)) < 1e-12:
            return repr(float(x))
    return f"{x:.10g}"


def numbers(values):
    return " ".join(number(value) for value in values)
