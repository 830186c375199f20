"""Writes the robots of the catalogue whose parts repeat: URDF and profile.

    python3 robots/generate              # all of them
    python3 robots/generate biped ur5e   # these
    python3 robots/generate --check      # writes nothing; fails if a committed file is not what this writes

Masses and lengths stand in the modules beside this one; inertias are those of the primitives, standing heights and damping
follow. The pendulum, the planar arm and the Panda were written by hand.
"""

import pathlib
import sys

import arms
import legged
import pendulums
import upright
import wheeled

CATALOGUE = pathlib.Path(__file__).resolve().parents[1] / "catalogue"


def main():
    arguments = sys.argv[1:]
    check = "--check" in arguments
    wanted = [name for name in arguments if name != "--check"]
    makers = pendulums.ROBOTS + arms.ROBOTS + legged.ROBOTS + upright.ROBOTS + wheeled.ROBOTS
    known, differing = [], []
    for make in makers:
        robot, profile = make()
        known.append(robot.name)
        if wanted and robot.name not in wanted:
            continue
        folder = CATALOGUE / robot.name
        for suffix, text in ((".urdf", robot.urdf()), (".toml", profile.toml(robot))):
            path = folder / (robot.name + suffix)
            if check:
                if not path.is_file() or path.read_text() != text:
                    differing.append(str(path))
                continue
            folder.mkdir(exist_ok=True)
            path.write_text(text)
        print(f"{robot.name}: {len(robot.independent())} joints, {len(robot.links)} links, {robot.mass():.3f} kg")
    unknown = set(wanted) - set(known)
    if unknown:
        sys.exit(f"no robot is named {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if differing:
        sys.exit("not what the script writes: " + ", ".join(differing))


if __name__ == "__main__":
    main()
