"""Writes the generated robots of the catalogue: URDF, profile, and modelled shells.

    python3 robots/generate              # all robots
    python3 robots/generate biped ur5e   # only these robots
    python3 robots/generate --check      # writes nothing; fails if a committed file differs from the output

Masses and lengths are defined in the modules next to this one. Inertias, standing heights and damping are computed from
them. The pendulum, the planar arm and the Panda are handwritten, except for the shells of the Panda.
"""

import pathlib
import sys

import arms
import legged
import pendulums
import upright
import wheeled
from machines import panda

CATALOGUE = pathlib.Path(__file__).resolve().parents[1] / "catalogue"


def shells(parts):
    """Returns {path in the robot's folder: text} for the shells in {link: parts}."""
    return {f"shells/{part.name}.obj": part.shell.obj() for of_link in parts.values() for part in of_link}


def files(make):
    """Returns the name of a robot, {path in its folder: text}, and a one-line description."""
    robot, profile = make()
    own = {link.name: link.parts for link in robot.links if link.package == robot.name}
    texts = {f"{robot.name}.urdf": robot.urdf(), f"{robot.name}.toml": profile.toml(robot)} | shells(own)
    return robot.name, texts, f"{len(robot.independent())} joints, {len(robot.links)} links, {robot.mass():.3f} kg"


def panda_files():
    """Returns the shells of the Panda, and its URDF with the visuals that refer to them."""
    parts = panda.parts()
    link, lines = None, []
    for line in (CATALOGUE / "panda" / "panda.urdf").read_text().splitlines():
        if line.startswith("  <link "):
            link = line.split('"')[1]
        if line.startswith("    <visual>") and link in parts:
            continue
        if line.startswith("    <collision>") and lines[-1].endswith("</inertial>"):
            lines += [part.visual("panda") for part in parts[link]]
        lines.append(line)
    texts = {"panda.urdf": "\n".join(lines) + "\n"} | shells(parts)
    return "panda", texts, f"{len(texts) - 1} shells"


def main():
    arguments = sys.argv[1:]
    check = "--check" in arguments
    wanted = [name for name in arguments if name != "--check"]
    makers = pendulums.ROBOTS + arms.ROBOTS + legged.ROBOTS + upright.ROBOTS + wheeled.ROBOTS
    known, differing = [], []
    for name, texts, about in [*map(files, makers), panda_files()]:
        known.append(name)
        if wanted and name not in wanted:
            continue
        folder = CATALOGUE / name
        stale = {path for path in folder.glob("shells/*.obj")} - {folder / path for path in texts}
        differing += map(str, sorted(stale))
        for path, text in texts.items():
            path = folder / path
            if check:
                if not path.is_file() or path.read_text() != text:
                    differing.append(str(path))
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        print(f"{name}: {about}")
    unknown = set(wanted) - set(known)
    if unknown:
        sys.exit(f"no robot is named {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if differing:
        sys.exit("not what the script writes: " + ", ".join(differing))


if __name__ == "__main__":
    main()
