"""Profile of a robot: the data that its URDF lacks."""

from dataclasses import dataclass, field



@dataclass
class Profile:
    title: str
    sources: list
    home: str
    # {name: {joint: position}}; omitted joints are at zero
    poses: dict
    # stiffness of position-controlled joints, {joint: kp}; damping is computed from the inertia at home
    stiffness: dict = field(default_factory=dict)
    # damping of speed-controlled joints, {joint: kd}
    speed_gains: dict = field(default_factory=dict)
    floating: bool = False
    passive: list = field(default_factory=list)
    end_effectors: dict = field(default_factory=dict)
    # {name: {"frame", "joints", "radius" or "sole"}}
    feet: dict = field(default_factory=dict)
    mobile_base: dict = None
    rotors: dict = field(default_factory=dict)
    # height of the base by pose, if it is not determined by the contacts with the ground
    heights: dict = field(default_factory=dict)

    def whole(self, robot, name):
        pose = {joint.name: 0.0 for joint in robot.independent()}
        unknown = set(self.poses[name]) - set(pose)
        assert not unknown, f"{robot.name}: pose {name} names {unknown}"
        return pose | self.poses[name]

    def supports(self, robot):
        """Returns (frame, depth below its origin at which it touches flat ground) for each support."""
        found = [(foot["frame"], foot.get("radius", 0.0)) for foot in self.feet.values()]
        if self.mobile_base and "wheel_radius" in self.mobile_base:
            children = {joint.name: joint.child for joint in robot.joints}
            radius = self.mobile_base["wheel_radius"]
            found += [(children[wheel], radius) for wheel in self.mobile_base["wheels"]]
        return found

    def height(self, robot, name):
        """Returns the height of a floating base at which the lowest support touches the ground."""
        if name in self.heights:
            return self.heights[name]
        places = robot.place(self.whole(robot, name))
        return -min(places[frame][1][2] - depth for frame, depth in self.supports(robot))

    def toml(self, robot):
        joints = [joint.name for joint in robot.independent()]
        lines = [f"title = {text(self.title)}", "sources = ["]
        lines += [f"    {text(source)}," for source in self.sources] + ["]"]
        if self.floating:
            lines.append('base = "floating"')
        lines += ["", *array("joints", joints, joints, text), f"home = {text(self.home)}"]
        if self.passive:
            lines.append(f"passive = {listed(self.passive)}")
        lines += ["", "[poses]"]
        for name in self.poses:
            pose = self.whole(robot, name)
            lines += array(name, [pose[joint] for joint in joints], joints, value)
        if self.floating:
            lines += ["", "# Pose of the base in the world, with its supports on the plane z = 0.", "[base_poses]"]
            for name in self.poses:
                lines.append(f"{name} = {{ position = [0.0, 0.0, {value(self.height(robot, name))}] }}")
        for name, end in self.end_effectors.items():
            lines += ["", f"[end_effectors.{name}]", f"frame = {text(end['frame'])}"]
            for key in ("joints", "fingers"):
                if key in end:
                    lines += array(key, end[key], end[key], text)
        for name, foot in self.feet.items():
            lines += ["", f"[feet.{name}]", f"frame = {text(foot['frame'])}"]
            if foot.get("joints"):
                lines += array("joints", foot["joints"], foot["joints"], text)
            if "radius" in foot:
                lines.append(f"radius = {value(foot['radius'])}")
            if "sole" in foot:
                lines.append(f"sole = [{', '.join(value(side) for side in foot['sole'])}]")
            if "friction" in foot:
                lines.append(f"friction = {value(foot['friction'])}")
        if self.mobile_base:
            lines += ["", "[mobile_base]"]
            for key, entry in self.mobile_base.items():
                entry = listed(entry) if isinstance(entry, list) else text(entry) if isinstance(entry, str) else value(entry)
                lines.append(f"{key} = {entry}")
        for name, rotor in self.rotors.items():
            lines += ["", f"[rotors.{name}]", f"frame = {text(rotor['frame'])}", f"spin = {text(rotor['spin'])}"]
            lines += [f"{key} = {value(rotor[key])}" for key in ("max_thrust", "torque_per_thrust")]
        if joints:
            lines += ["", "# Every joint is critically damped at home with the other joints locked.", "[gains]"]
            kp, kd = self.gains(robot)
            lines += array("kp", [kp[joint] for joint in joints], joints, value)
            lines += array("kd", [kd[joint] for joint in joints], joints, value)
        return "\n".join(lines) + "\n"

    def gains(self, robot):
        home = self.whole(robot, self.home)
        kp, kd = {}, {}
        for joint in robot.independent():
            name = joint.name
            assert name in self.passive or name in self.speed_gains or name in self.stiffness, f"no gain for {name}"
            kp[name] = float(self.stiffness.get(name, 0.0))
            kd[name] = float(self.speed_gains.get(name, 0.0))
            if kp[name]:
                kd[name] = robot.damping(joint, kp[name], home)
        return kp, kd


def limb(joint):
    """Returns the group of a joint in lists: `left_arm_3` -> `left_arm`, `front_left_knee` -> `front_left`."""
    words = joint.split("_")
    sides = [index for index, word in enumerate(words) if word in ("left", "right")]
    return "_".join(words[: sides[0] + 1]) if sides else ""


def array(key, values, joints, show):
    shown = [show(entry) for entry in values]
    flat = f"{key} = [{', '.join(shown)}]"
    if len(flat) <= 118:
        return [flat]
    rows, last = [], None
    for entry, joint in zip(shown, joints):
        if rows and limb(joint) == last and len(", ".join(rows[-1] + [entry])) < 110:
            rows[-1].append(entry)
        else:
            rows.append([entry])
        last = limb(joint)
    return [f"{key} = [", *[f"    {', '.join(row)}," for row in rows], "]"]


def text(words):
    return '"' + words.replace('"', '\\"') + '"'


def listed(words):
    return "[" + ", ".join(text(word) for word in words) + "]"


def value(x):
    shown = f"{float(x):.10g}" if abs(x) > 1e-15 else "0.0"
    if any(abs(x - k * 0.7853981633974483) < 1e-12 for k in range(-8, 9)):
        shown = repr(float(x)) if x else "0.0"
    return shown if any(mark in shown for mark in ".e") else shown + ".0"


