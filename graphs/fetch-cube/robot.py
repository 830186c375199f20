"""Writes robot.urdf: the arm of `panda` on the base of `mobile-manipulator`, both from the catalogue.

python robot.py
"""

import pathlib
import xml.etree.ElementTree as tree

here = pathlib.Path(__file__).parent
catalogue = here.parents[1] / "robots" / "catalogue"


def elements(name):
    return list(tree.parse(catalogue / name / f"{name}.urdf").getroot())


def is_arm(element):
    """Elements of the mobile manipulator's own arm, whose mount stays."""
    return element.get("name").startswith("arm_") and element.get("name") not in ("arm_mount", "arm_mount_joint")


robot = tree.Element("robot", name="panda-on-base")
robot.extend(element for element in elements("mobile-manipulator") if not is_arm(element))
joint = tree.SubElement(robot, "joint", name="panda_mount_joint", type="fixed")
tree.SubElement(joint, "parent", link="arm_mount")
tree.SubElement(joint, "child", link="panda_link0")
colours = {element.get("name") for element in robot if element.tag == "material"}
robot.extend(element for element in elements("panda") if element.tag != "material" or element.get("name") not in colours)
for link in robot.iterfind("link"):
    # MuJoCo refuses moving links without mass
    if link.get("name") in ("base_x_link", "base_y_link"):
        inertial = tree.SubElement(link, "inertial")
        tree.SubElement(inertial, "mass", value="1")
        tree.SubElement(inertial, "inertia", ixx="0.01", ixy="0", ixz="0", iyy="0.01", iyz="0", izz="0.01")
for element in robot:
    element.tail = None
tree.indent(robot)
tree.ElementTree(robot).write(here / "robot.urdf", encoding="unicode", xml_declaration=True)
