"""One peer of the control bench: for each line read, answers with the times of one turn, in microseconds, in one line.

    control.py SOLVER FILE                              a file of recorded quadratic programs; a turn solves all of them:
                                                        daqp, quadprog, piqp, proxqp, clarabel
    control.py pink-panda | placo-panda URDF            differential inverse kinematics; a turn is 100 cycles
    control.py placo-talos URDF                         the same on two feet
    control.py tsid-talos URDF                          torques on two feet

DAQP, PIQP and ProxQP time themselves; the others are timed around the call, which costs Python about half a microsecond.
"""

import json
import re
import sys
import tempfile
import time

import numpy as np

CYCLES = 100
DT = 0.001
# A second each: the offsets of the hand's goal from its start, m. Some goals of the Panda are out of reach.
PANDA_GOALS = [[0.1, 0.2, 0.1], [-0.1, -0.3, 0.2], [0.6, 0.0, 0.5], [0.0, 0.3, -0.3]]
TALOS_GOALS = [[0.1, 0.0, 0.15], [0.05, 0.1, 0.0], [0.1, 0.1, 0.2], [0.0, -0.05, 0.1]]
PANDA_HOME = [0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398]


def talos_home(name):
    """The same posture as in motorium's bench: knees bent, arms hanging beside the trunk."""
    bends = {"leg_._3": -0.4, "leg_._4": 0.8, "leg_._5": -0.4, "arm_._4": -1.0}
    arms = {"arm_left_2": 0.3, "arm_right_2": -0.3}
    found = [angle for part, angle in bends.items() if re.match(part.replace("_._", "_(left|right)_"), name)]
    return (found + [arms[part] for part in arms if name.startswith(part)] + [0.0])[0]


def bare(path):
    """The URDF without shapes, which no side needs."""
    text = open(path).read()
    for tag in ["visual", "collision"]:
        text = re.sub(rf"<{tag}\b.*?</{tag}>", "", text, flags=re.S)
    file = tempfile.NamedTemporaryFile("w", suffix=".urdf", delete=False)
    file.write(text)
    file.close()
    return file.name


def timed(call):
    start = time.perf_counter_ns()
    result = call()
    return (time.perf_counter_ns() - start) * 1e-3, result


def problems(path):
    data = json.load(open(path))
    for numbers in data if isinstance(data, list) else [data]:
        n = len(numbers["q"])
        matrix = lambda key: np.array(numbers.get(key) or np.zeros((0, n)), dtype=float)
        side = lambda key, count, value: np.clip(numbers.get(key) or [value] * count, -1e30, 1e30)
        a, g = matrix("A"), matrix("G")
        yield {
            "P": np.ascontiguousarray(numbers["P"], dtype=float),
            "q": np.array(numbers["q"], dtype=float),
            "A": a,
            "b": np.array(numbers.get("b") or [], dtype=float),
            "G": g,
            "lg": side("lg", len(g), -1e30),
            "ug": side("ug", len(g), 1e30),
            "lb": side("lb", n, -1e30),
            "ub": side("ub", n, 1e30),
        }


def daqp(path):
    import daqp

    def pose(p):
        n, m, k = len(p["q"]), len(p["b"]), len(p["lg"])
        sense = np.concatenate([np.zeros(n), np.full(m, 5), np.zeros(k)]).astype(np.int32)
        upper = np.concatenate([p["ub"], p["b"], p["ug"]])
        lower = np.concatenate([p["lb"], p["b"], p["lg"]])
        return p["P"], p["q"], np.ascontiguousarray(np.vstack([p["A"], p["G"]])), upper, lower, sense

    posed = [pose(p) for p in problems(path)]

    def turn():
        for p in posed:
            _, _, flag, info = daqp.solve(*p)
            if flag < 1:
                raise SystemExit(f"DAQP: exit flag {flag}")
            yield (info["solve_time"] + info.get("setup_time", 0.0)) * 1e6

    return turn


def quadprog(path):
    import quadprog

    def pose(p):
        n, unit = len(p["q"]), np.eye(len(p["q"]))
        rows, values = [p["A"]], [p["b"]]
        for matrix, lower, upper in [(p["G"], p["lg"], p["ug"]), (unit, p["lb"], p["ub"])]:
            below, above = lower > -1e20, upper < 1e20
            rows += [matrix[below], -matrix[above]]
            values += [lower[below], -upper[above]]
        matrix = np.ascontiguousarray(np.vstack(rows).T)
        return p["P"], -p["q"], matrix, np.concatenate(values), len(p["b"])

    posed = [pose(p) for p in problems(path)]

    def turn():
        for p in posed:
            yield timed(lambda: quadprog.solve_qp(*p))[0]

    return turn


def piqp(path):
    import piqp

    posed = list(problems(path))
    solver = piqp.DenseSolver()
    solver.settings.compute_timings = True
    arguments = lambda p: (p["P"], p["q"], p["A"], p["b"], p["G"], p["lg"], p["ug"], p["lb"], p["ub"])
    solver.setup(*arguments(posed[0]))

    def turn():
        for p in posed:
            solver.update(*arguments(p))
            if solver.solve() != piqp.PIQP_SOLVED:
                raise SystemExit("PIQP did not solve it")
            yield (solver.result.info.update_time + solver.result.info.solve_time) * 1e6

    return turn


def proxqp(path):
    from proxsuite import proxqp

    posed = list(problems(path))
    first = posed[0]
    n, m, k = len(first["q"]), len(first["b"]), len(first["lg"])
    solver = proxqp.dense.QP(n, m, k, True)
    solver.settings.compute_timings = True
    solver.settings.eps_abs = 1e-6
    solver.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
    arguments = lambda p: (p["P"], p["q"], p["A"], p["b"], p["G"], p["lg"], p["ug"], p["lb"], p["ub"])
    solver.init(*arguments(first))
    solver.solve()

    def turn():
        for p in posed:
            solver.update(*arguments(p))
            solver.solve()
            if solver.results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
                raise SystemExit("ProxQP did not solve it")
            yield solver.results.info.setup_time + solver.results.info.solve_time

    return turn


def clarabel(path):
    import clarabel
    from scipy import sparse

    def pose(p):
        unit = np.eye(len(p["q"]))
        rows, values = [p["A"]], [p["b"]]
        for matrix, lower, upper in [(p["G"], p["lg"], p["ug"]), (unit, p["lb"], p["ub"])]:
            below, above = lower > -1e20, upper < 1e20
            rows += [matrix[above], -matrix[below]]
            values += [upper[above], -lower[below]]
        limits = np.concatenate(values)
        cones = [clarabel.ZeroConeT(len(p["b"])), clarabel.NonnegativeConeT(len(limits) - len(p["b"]))]
        hessian, matrix = sparse.csc_matrix(np.triu(p["P"])), sparse.csc_matrix(np.vstack(rows))
        return hessian, p["q"], matrix, limits, cones

    posed = [pose(p) for p in problems(path)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False

    def turn():
        for p in posed:
            yield timed(lambda: clarabel.DefaultSolver(*p, settings).solve())[0]

    return turn


def pink_panda(path):
    import pinocchio
    from pink import Configuration, solve_ik
    from pink.tasks import FrameTask, PostureTask

    model = pinocchio.buildModelFromUrdf(bare(path))
    home = np.array(PANDA_HOME)
    configuration = Configuration(model, model.createData(), home)
    hand = FrameTask("panda_hand_tcp", position_cost=1.0, orientation_cost=0.5, gain=0.01)
    posture = PostureTask(cost=1e-3, gain=0.001)
    posture.set_target(home)
    centre = configuration.get_transform_frame_to_world("panda_hand_tcp").copy()
    tick = 0

    def cycle():
        velocity = solve_ik(configuration, [hand, posture], DT, solver="daqp")
        configuration.integrate_inplace(velocity, DT)

    def turn():
        nonlocal tick
        for _ in range(CYCLES):
            goal = centre.copy()
            goal.translation = centre.translation + PANDA_GOALS[tick // 1000 % len(PANDA_GOALS)]
            hand.set_target(goal)
            tick += 1
            yield timed(cycle)[0]

    return turn


def placo_panda(path):
    import placo

    robot = placo.RobotWrapper(bare(path), placo.Flags.ignore_collisions)
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    solver.dt = DT
    names = [f"panda_joint{i}" for i in range(1, 8)]
    for name, angle in zip(names, PANDA_HOME):
        robot.set_joint(name, angle)
    robot.update_kinematics()
    centre = robot.get_T_world_frame("panda_hand_tcp").copy()
    hand = solver.add_frame_task("panda_hand_tcp", centre)
    hand.configure("hand", "soft", 1.0, 0.5)
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(names, PANDA_HOME)))
    posture.configure("posture", "soft", 1e-6)
    tick = 0

    def cycle():
        solver.solve(True)
        robot.update_kinematics()

    def turn():
        nonlocal tick
        for _ in range(CYCLES):
            goal = centre.copy()
            goal[:3, 3] += PANDA_GOALS[tick // 1000 % len(PANDA_GOALS)]
            hand.T_world_frame = goal
            tick += 1
            yield timed(cycle)[0]

    return turn


def placo_talos(path):
    import placo

    robot = placo.RobotWrapper(bare(path), placo.Flags.ignore_collisions)
    for name in robot.joint_names():
        robot.set_joint(name, talos_home(name))
    robot.update_kinematics()
    solver = placo.KinematicsSolver(robot)
    solver.enable_joint_limits(True)
    solver.enable_velocity_limits(True)
    solver.dt = DT
    for foot in ["left_sole_link", "right_sole_link"]:
        solver.add_frame_task(foot, robot.get_T_world_frame(foot)).configure(foot, "hard", 1.0, 1.0)
    centre = robot.com_world()
    solver.add_com_task(centre + np.array([0.01, 0.02, -0.02])).configure("com", "soft", 1.0)
    start = robot.get_T_world_frame("arm_left_7_link").copy()
    hand = solver.add_frame_task("arm_left_7_link", start)
    hand.configure("hand", "soft", 1.0, 0.5)
    posture = solver.add_joints_task()
    posture.set_joints({name: talos_home(name) for name in robot.joint_names()})
    posture.configure("posture", "soft", 1e-4)
    tick = 0

    def cycle():
        solver.solve(True)
        robot.update_kinematics()

    def turn():
        nonlocal tick
        for _ in range(CYCLES):
            goal = start.copy()
            goal[:3, 3] += TALOS_GOALS[tick // 1000 % len(TALOS_GOALS)]
            hand.T_world_frame = goal
            tick += 1
            yield timed(cycle)[0]

    return turn


def tsid_talos(path):
    # TSID returns types that Pinocchio registers; its wheel has the module one folder too deep
    import pinocchio as pin
    import tsid

    sys.path.extend(tsid.__path__)
    import tsid_pywrap as tsid

    robot = tsid.RobotWrapper(bare(path), [""], pin.JointModelFreeFlyer(), False)
    model = robot.model()
    q, v = pin.neutral(model), np.zeros(model.nv)
    for name, joint in zip(model.names[2:], model.joints[2:]):
        q[joint.idx_q] = talos_home(name)
    stand = model.createData()
    pin.framesForwardKinematics(model, stand, q)
    q[2] -= stand.oMf[model.getFrameId("left_sole_link")].translation[2]
    control = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    control.computeProblemData(0.0, q, v)
    sole = np.array([[-0.1, -0.1, 0.1, 0.1], [-0.06, 0.06, -0.06, 0.06], [0.0, 0.0, 0.0, 0.0]])
    contacts = []
    for foot in ["left_sole_link", "right_sole_link"]:
        contact = tsid.Contact6d(foot, robot, foot, sole, np.array([0.0, 0.0, 1.0]), 0.6, 0.0, 1e4)
        contact.setKp(np.zeros(6))
        contact.setKd(20.0 * np.ones(6))
        contact.setReference(robot.framePosition(control.data(), model.getFrameId(foot)))
        # at level 0: the contact is a constraint
        control.addRigidContact(contact, 1e-6)
        contacts.append(contact)
    centre = tsid.TaskComEquality("com", robot)
    centre.setKp(16.0 * np.ones(3))
    centre.setKd(8.0 * np.ones(3))
    control.addMotionTask(centre, 100.0, 1, 0.0)
    goal = robot.com(control.data()) + np.array([0.01, 0.04, -0.02])
    centre.setReference(tsid.TrajectoryEuclidianConstant("com", goal).computeNext())
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(16.0 * np.ones(robot.na))
    posture.setKd(8.0 * np.ones(robot.na))
    control.addMotionTask(posture, 0.01, 1, 0.0)
    posture.setReference(tsid.TrajectoryEuclidianConstant("posture", q[7:]).computeNext())
    torques = tsid.TaskActuationBounds("torques", robot)
    torques.setBounds(-model.effortLimit[-robot.na :], model.effortLimit[-robot.na :])
    control.addActuationTask(torques, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("solver")
    solver.resize(control.nVar, control.nEq, control.nIn)
    state = [q, v]
    start = (q.copy(), v.copy())
    tick = 0
    # the formulation does not own its arguments
    kept = [robot, contacts, centre, posture, torques]

    def cycle():
        problem = control.computeProblemData(0.0, state[0], state[1])
        solution = solver.solve(problem)
        return solution, control.getAccelerations(solution)

    def turn():
        nonlocal tick
        assert kept
        for _ in range(CYCLES):
            time, (solution, a) = timed(cycle)
            assert solution.status == 0, solution.status
            a = np.array(a)
            state[0] = pin.integrate(model, state[0], (state[1] + 0.5 * DT * a) * DT)
            state[1] = state[1] + a * DT
            tick += 1
            if tick % 1000 == 0:
                state[:] = [start[0].copy(), start[1].copy()]
            yield time

    return turn


def main():
    name, path = sys.argv[1:]
    turn = globals()[name.replace("-", "_")](path)
    list(turn())
    print("ready", flush=True)
    for _ in sys.stdin:
        print(" ".join(f"{us:.3f}" for us in turn()), flush=True)


main()
