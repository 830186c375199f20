"""Robots with at most a few joints, and the files made from them."""

# A tetrahedron for the files that refer to a mesh.
ASSETS = {"tetra.obj": "v 0 0 0\nv .2 0 0\nv 0 .3 0\nv 0 0 .4\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"}

TRAPS = {}


def file(name, world, before="", after="", compiler='angle="radian"'):
    """Adds a file with `world` in its worldbody, and sections before and after it."""
    head = f"  <compiler {compiler}/>\n" if compiler else ""
    TRAPS[name] = f"<mujoco>\n{head}{before}  <worldbody>\n{world}  </worldbody>\n{after}</mujoco>\n"


def arm(
    upper='<joint name="one" axis="0 1 0"/><geom type="capsule" size=".05 .2"/>',
    lower='<joint name="two" axis="1 0 0"/><geom type="box" size=".1 .05 .2"/>',
    upper_body='pos="0 0 1"',
    lower_body='pos=".1 0 .4"',
):
    """Returns a body of two links, one carrying the other."""
    return (
        f'    <body name="upper" {upper_body}>\n      {upper}\n      <body name="lower" {lower_body}>\n'
        f"        {lower}\n      </body>\n    </body>\n"
    )


def free(inside, joint="<freejoint/>", body='pos=".1 .2 1"', child=True):
    """Returns a body with a free joint that carries a body on a hinge."""
    hung = '      <body name="leg" pos="0 .1 -.2"><joint name="hip"/><geom size=".1" pos="0 0 -.1"/></body>\n'
    return f'    <body name="trunk" {body}>\n      {joint}\n      {inside}\n{hung if child else ""}    </body>\n'


BOX = '<geom type="box" size=".2 .1 .3" pos=".05 .02 0"/>'
HINGE = '<joint name="one" axis="0 1 0"/>'
ROD = '<geom type="capsule" size=".05 .2"/>'


def defaults(text):
    return f"  <default>\n    {text}\n  </default>\n"
