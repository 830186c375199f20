#!/usr/bin/env python3
"""Steps of one millisecond in MuJoCo or PyBullet, timed: asked over standard input by `cargo bench --bench physics`.

    physics.py ENGINE MOTION STEPS BOXES URDF     ENGINE mujoco | pybullet; MOTION swing | hold | fall | drop | batch | energy

`drop` begins anew every 1000 steps. `batch` steps BOXES robots on two threads (mujoco.rollout), and tells the time of one step of one of them.
`energy` takes a robot without stops and friction, sets it going, and prints its energy after each turn instead of a time.

Prints "ready"; then, for each line of standard input, the microseconds per step of a turn of STEPS steps. The profile
(.toml) of the robot lies beside its URDF: home pose and gains are its. Self-collision is off, all else is the engine's
default. Goals of joints change between turns only, so that a turn is one call into the library where it has one.
"""

import math
import os
import pathlib
import sys
import time
import tomllib
import xml.etree.ElementTree as tree

engine, motion, steps, boxes, urdf = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), pathlib.Path(sys.argv[5])
STEP = 1e-3

# PyBullet writes greetings and warnings to standard output, which is reserved for the answers.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def profile():
    table = tomllib.loads(urdf.with_suffix(".toml").read_text())
    base = table.get("base_poses", {}).get(table["home"])
    kp, kd = table["gains"]["kp"], table["gains"]["kd"]
    return table["joints"], table["poses"][table["home"]], kp, kd, base


def root_link(text):
    """The root link: no joint has it as child."""
    robot = tree.fromstring(text)
    carried = {joint.find("child").get("link") for joint in robot.findall("joint")}
    return next(link.get("name") for link in robot.findall("link") if link.get("name") not in carried)


def box_poses():
    for index in range(boxes):
        layer, place = divmod(index, 5)
        angle = place * 1.2566 + layer * 0.3
        position = [0.12 * math.cos(angle), 0.12 * math.sin(angle), 0.06 + 0.15 * layer]
        yield position, (0.1 * angle, 0.05, 0.2 * layer)


class MuJoCo:
    def __init__(self):
        import mujoco

        self.mujoco = mujoco
        self.goal = []
        if motion == "energy":
            text = urdf.read_text()
            root = root_link(text)
            extra = '<mujoco><compiler fusestatic="false" discardvisual="true" strippath="false"/></mujoco></robot>'
            spec = mujoco.MjSpec.from_string(text.replace("</robot>", extra))
            if boxes:
                spec.body(root).add_freejoint(name="the_root")
            for geom in spec.geoms:
                geom.contype, geom.conaffinity = 0, 0
        elif boxes and motion != "batch":
            spec = mujoco.MjSpec()
            for position, rpy in box_poses():
                body = spec.worldbody.add_body(pos=position)
                body.alt.euler = rpy
                body.add_freejoint()
                geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05] * 3, mass=0.5)
                geom.friction[0] = 0.6
        else:
            joints, self.goal, kp, kd, base = profile()
            text = urdf.read_text()
            root = root_link(text)
            extra = '<mujoco><compiler fusestatic="false" discardvisual="true" strippath="false"/></mujoco></robot>'
            spec = mujoco.MjSpec.from_string(text.replace("</robot>", extra))
            if base:
                spec.body(root).add_freejoint(name="the_root")
            for geom in spec.geoms:
                geom.contype, geom.conaffinity = 1, 2
                geom.friction[0] = 0.8
            limits = {}
            for joint in tree.fromstring(text).iter("joint"):
                limit = joint.find("limit")
                limits[joint.get("name")] = float(limit.get("effort")) if limit is not None else 0.0
            for name, p, d in zip(joints, kp, kd):
                limit = limits[name]
                spec.add_actuator(
                    name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gainprm=[p] + [0] * 9,
                    biastype=mujoco.mjtBias.mjBIAS_AFFINE, biasprm=[0, -p, -d] + [0] * 7,
                    forcelimited=limit > 0, forcerange=[-limit, limit],
                )
        if motion in ("hold", "drop", "batch"):
            floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=3, conaffinity=3)
            floor.friction[0] = 0.6 if boxes and motion != "batch" else 0.8
        spec.option.timestep = STEP
        # Its Euler step treats the gains of actuators explicitly: stiff drives need this integrator.
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        if motion == "energy":
            # A free-flying robot has no gravity here, and the default integrator is the peer.
            spec.option.gravity = [0, 0, 0] if boxes else [0, 0, -9.81]
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        if self.goal:
            if base:
                self.data.qpos[:7] = [*base["position"], 1, 0, 0, 0]
            for name, q in zip(joints, self.goal):
                self.data.qpos[self.model.joint(name).qposadr[0]] = q
        if motion == "energy":
            self.set_going()
        if motion == "batch":
            from mujoco import rollout

            self.pool = rollout.Rollout(nthread=2)
            self.datas = [mujoco.MjData(self.model), mujoco.MjData(self.model)]
            kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
            import numpy

            one = numpy.zeros(mujoco.mj_stateSize(self.model, kind))
            mujoco.mj_getState(self.model, self.data, one, kind)
            self.states = numpy.tile(one, (boxes, 1))
            self.goals = numpy.tile(numpy.array(self.goal), (boxes, steps, 1))

    def set_going(self):
        if boxes:
            self.data.qvel[3:6] = [0.5, -0.3, 0.4]
            for index in range(self.model.njnt):
                joint = self.model.joint(index)
                if joint.dofadr[0] >= 6:
                    self.data.qvel[joint.dofadr[0]] = 0.3 * math.sin(sum(joint.name.encode()))
        else:
            self.data.qpos[0] = 1.0

    def energy(self):
        self.mujoco.mj_step(self.model, self.data, steps)
        self.model.opt.enableflags |= int(self.mujoco.mjtEnableBit.mjENBL_ENERGY)
        self.mujoco.mj_forward(self.model, self.data)
        return float(self.data.energy.sum())

    def restart(self):
        self.mujoco.mj_resetData(self.model, self.data)

    def advance(self, swing):
        if self.goal:
            self.data.ctrl[:] = [q + swing for q in self.goal]
        if motion == "batch":
            start = time.perf_counter_ns()
            states, _ = self.pool.rollout(
                self.model, self.datas, self.states, self.goals, nstep=steps, skip_checks=False)
            taken = time.perf_counter_ns() - start
            self.states = states[:, -1, :].copy()
            return taken / boxes
        start = time.perf_counter_ns()
        self.mujoco.mj_step(self.model, self.data, steps)
        return time.perf_counter_ns() - start


class PyBullet:
    def __init__(self):
        import pybullet

        self.bullet = pybullet
        pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.81)
        pybullet.setTimeStep(STEP)
        self.goal = []
        if motion in ("hold", "drop"):
            floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
            pybullet.createMultiBody(0, floor)
        if boxes:
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.05] * 3)
            self.boxes = [
                pybullet.createMultiBody(0.5, shape, basePosition=position,
                                         baseOrientation=pybullet.getQuaternionFromEuler(rpy))
                for position, rpy in box_poses()]
            return
        names, self.goal, kp, kd, base = profile()
        self.robot = pybullet.loadURDF(str(urdf), useFixedBase=base is None, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        if base:
            pybullet.resetBasePositionAndOrientation(self.robot, base["position"], [0, 0, 0, 1])
        found = {pybullet.getJointInfo(self.robot, i)[1].decode(): i for i in range(pybullet.getNumJoints(self.robot))}
        self.joints = [found[name] for name in names]
        for joint, q in zip(self.joints, self.goal):
            pybullet.resetJointState(self.robot, joint, q)

    def restart(self):
        for box, (position, rpy) in zip(self.boxes, box_poses()):
            self.bullet.resetBasePositionAndOrientation(box, position, self.bullet.getQuaternionFromEuler(rpy))
            self.bullet.resetBaseVelocity(box, [0, 0, 0], [0, 0, 0])

    def advance(self, swing):
        if self.goal:
            self.bullet.setJointMotorControlArray(
                self.robot, self.joints, self.bullet.POSITION_CONTROL, targetPositions=[q + swing for q in self.goal])
        start = time.perf_counter_ns()
        for _ in range(steps):
            self.bullet.stepSimulation()
        return time.perf_counter_ns() - start


def main():
    if engine == "pybullet" and motion in ("batch", "energy"):
        print("ready", file=answers, flush=True)
        for _ in sys.stdin:
            print("cannot", file=answers, flush=True)
        return
    simulation = MuJoCo() if engine == "mujoco" else PyBullet()
    done = 0
    if motion in ("hold", "swing", "batch"):
        for _ in range(1000 // steps):
            simulation.advance(0.0)
    print("ready", file=answers, flush=True)
    for _ in sys.stdin:
        if motion == "energy":
            print(simulation.energy(), file=answers, flush=True)
            continue
        if motion == "drop" and done % 1000 == 0 and done > 0:
            simulation.restart()
        swing = 0.15 * math.sin(2e-3 * done) if motion == "swing" else 0.0
        nanoseconds = simulation.advance(swing)
        done += steps
        print(nanoseconds / 1e3 / steps, file=answers, flush=True)


main()
