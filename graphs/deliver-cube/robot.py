"""Writes robot.urdf: the arm of `panda` from the catalogue on a base with two driven wheels and a caster.

python robot.py
"""

import math
import pathlib
import xml.etree.ElementTree as tree

here = pathlib.Path(__file__).parent
catalogue = here.parents[1] / "robots" / "catalogue"

# SI units. The wheels are in front, below the arm; the battery moves the centre of mass towards the caster.
WHEEL_RADIUS, TRACK, WHEEL_MASS = 0.1, 0.52, 4.0
SIZE, CENTRE, MASS = (0.66, 0.44, 0.26), (-0.18, 0.0, 0.1), 110.0
CASTER_RADIUS, CASTER_X = 0.05, -0.42


def text(*numbers):
    return " ".join(f"{number:.9g}" for number in numbers)


def link(name, inertia=None, mass=0.0, centre=(0.0, 0.0, 0.0)):
    element = tree.SubElement(robot, "link", name=name)
    if inertia:
        inertial = tree.SubElement(element, "inertial")
        tree.SubElement(inertial, "origin", xyz=text(*centre))
        tree.SubElement(inertial, "mass", value=text(mass))
        xx, yy, zz = (text(value) for value in inertia)
        tree.SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)
    return element


def shape(element, purposes, kind, colour, origin=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0), **sizes):
    for purpose in purposes:
        part = tree.SubElement(element, purpose)
        tree.SubElement(part, "origin", xyz=text(*origin), rpy=text(*rpy))
        tree.SubElement(tree.SubElement(part, "geometry"), kind, sizes)
        if purpose == "visual":
            tree.SubElement(part, "material", name=colour)


def joint(name, kind, parent, child, origin, limit=None):
    element = tree.SubElement(robot, "joint", name=name, type=kind)
    tree.SubElement(element, "parent", link=parent)
    tree.SubElement(element, "child", link=child)
    tree.SubElement(element, "origin", xyz=text(*origin))
    if limit:
        tree.SubElement(element, "axis", xyz="0 1 0")
        tree.SubElement(element, "limit", limit)


robot = tree.Element("robot", name="panda-on-wheels")
for name, rgba in {"tyre": "0.15 0.15 0.16 1", "body": "0.27 0.3 0.34 1"}.items():
    tree.SubElement(tree.SubElement(robot, "material", name=name), "color", rgba=rgba)

squares = [size * size for size in SIZE]
base = link("base", [MASS / 12.0 * (sum(squares) - square) for square in squares], MASS, CENTRE)
shape(base, ("visual", "collision"), "box", "body", CENTRE, size=text(*SIZE))

ALONG, ACROSS = 0.5 * WHEEL_MASS * WHEEL_RADIUS**2, 0.25 * WHEEL_MASS * WHEEL_RADIUS**2
for side, y in (("left", TRACK / 2.0), ("right", -TRACK / 2.0)):
    joint(f"{side}_wheel", "continuous", "base", f"{side}_wheel_link", (0.0, y, 0.0), {"velocity": "12", "effort": "60"})
    wheel = link(f"{side}_wheel_link", (ACROSS, ALONG, ACROSS), WHEEL_MASS)
    size = {"radius": text(WHEEL_RADIUS), "length": "0.05"}
    shape(wheel, ("visual",), "cylinder", "tyre", rpy=(math.pi / 2.0, 0.0, 0.0), **size)
    # a crowned tyre: it touches the ground at its middle
    shape(wheel, ("collision",), "sphere", "tyre", radius=text(WHEEL_RADIUS))

joint("caster_joint", "fixed", "base", "caster", (CASTER_X, 0.0, CASTER_RADIUS - WHEEL_RADIUS))
shape(link("caster"), ("visual", "collision"), "sphere", "tyre", radius=text(CASTER_RADIUS))

joint("panda_mount_joint", "fixed", "base", "panda_link0", (-0.05, 0.0, CENTRE[2] + SIZE[2] / 2.0))
robot.extend(tree.parse(catalogue / "panda" / "panda.urdf").getroot())
for element in robot:
    element.tail = None
tree.indent(robot)
tree.ElementTree(robot).write(here / "robot.urdf", encoding="unicode", xml_declaration=True)
