//! First graph of a robot, in which the robot stands or holds its home pose and then reaches a second pose.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use motorium_robots::{
    CollisionModel, CollisionOptions, Collisions, Dynamics, EndEffector, IkOptions, InverseKinematics,
    JointKind, Kinematics, Loaded, Model, Profile,
};
use nalgebra::{DMatrix, DVector, Isometry3, Vector3};
use toml::Value;

/// Joint inertia below which the mass matrix is treated as singular, kg m^2 or kg.
const LEAST_INERTIA: f64 = 1e-9;
/// Inertia of the rotors of such a robot, kg m^2.
const ARMATURE: f64 = 1e-3;
/// Time at home before the robot moves, s.
const HOLD: f64 = 5.0;
/// Minimum number of joints of an arm whose tool can reach any pose.
const POSE_JOINTS: usize = 6;
/// Displacements of an arm's tool, m; the first reachable one is used.
const STEPS: [f64; 3] = [0.1, 0.05, 0.02];
/// Largest joint motion along this displacement, rad or m.
const LARGEST_MOTION: f64 = 0.8;
/// Links nearer than this at home are not checked, m.
const APART: f64 = 0.01;
/// Fraction of a drive's effort that gravity may use.
const LOAD: f64 = 0.9;
/// Joint motion of a robot without an arm, rad and m; also limited to this fraction of the range.
const OFFSET: [f64; 2] = [0.2, 0.02];
const OFFSET_PART: f64 = 0.2;
/// Fraction of its height by which a standing robot lowers its base.
const LOWERED: f64 = 0.05;

/// Returns the text of the graph. `name` is the robot's table, `reference` names the robot.
pub(super) fn first_graph(
    robot: &Loaded,
    profile: &Profile,
    name: &str,
    reference: &str,
    file: &Path,
) -> String {
    let floating = robot.model.base().floating;
    // the feet of a base on wheels are casters
    let stands = floating
        && profile.mobile_base.is_none()
        && !profile.feet.is_empty()
        && profile.base_poses.contains_key(&profile.home);
    let task = if stands {
        "stands for 5 s, then lowers its base"
    } else {
        "holds its home pose for 5 s, then reaches another"
    };
    let mut text = format!("# A first graph: `{name}` {task}.\n");
    let _ = writeln!(text, "name     = \"{name}-reach\"\nclock    = \"lockstep\"\nduration = \"15 s\"\n");
    if floating {
        text += "[world]\nground = { friction = 0.8 }\n\n";
    }
    let (urdf, own) = (Value::from(absolute(reference)), Value::from(absolute(&file.to_string_lossy())));
    let _ = writeln!(text, "[robot.{name}]\nurdf    = {urdf}\nprofile = {own}\n");
    let base_state = if stands { format!(", base_state = \"{name}/base_state\"") } else { String::new() };
    let _ = writeln!(
        text,
        "[component.physics]\nkind      = \"physics.articulated\"\nrobot     = \"{name}\"\nrate      = \"1 kHz\"\n\
         subscribe = {{ joint_command = \"{name}/joint_command\" }}\n\
         publish   = {{ joint_state = \"{name}/joint_state\"{base_state} }}\n"
    );
    if lacks_inertia(&robot.model) {
        let _ = writeln!(
            text,
            "[component.physics.config]\nsolver = {{ armature = {ARMATURE} }}    # inertia of the rotors: a link of the file has none\n"
        );
    }
    text += &if stands { standing(robot, profile, name) } else { reaching(&robot.model, profile, name) };
    text
}

/// Returns `true` if a joint carries no inertia.
fn lacks_inertia(model: &Model) -> bool {
    let (nv, first) = (model.nv(), model.nv() - model.joint_count());
    let mut mass = DMatrix::zeros(nv, nv);
    Dynamics::new(model).crba(model, &model.neutral(), &mut mass);
    (first..nv).any(|index| mass[(index, index)] < LEAST_INERTIA)
}

/// Returns an absolute path for a file, or the name of a catalogue robot unchanged.
fn absolute(reference: &str) -> String {
    let path: PathBuf = std::fs::canonicalize(reference).unwrap_or_else(|_| reference.into());
    path.to_string_lossy().into_owned()
}

/// Returns the whole-body controller that moves the base of a robot on its feet.
fn standing(robot: &Loaded, profile: &Profile, name: &str) -> String {
    let base = &profile.base_poses[&profile.home];
    let frames = robot.model.frames();
    let root = frames.iter().find(|frame| !frame.in_world).map_or("", |frame| &frame.name);
    let root = Value::from(root);
    let height = base.position[2];
    // On few feet, the centre of mass has little margin, and swinging arms would tip the robot.
    let soles = profile.feet.values().any(|foot| foot.sole.is_some());
    let (balance, weights, posture) = match soles {
        true => (
            "    { centre_of_mass = { gain = 5.0, weight = 10.0, shares = [1.0, 1.0, 0.0] } },\n",
            "position_weight = 5.0, orientation_weight = 2.0, ",
            0.2,
        ),
        false => ("", "", 0.01),
    };
    let mut text = format!(
        "[component.policy]\nkind    = \"policy.dmp\"\nrate    = \"200 Hz\"\npublish = {{ target = \"{name}/base_target\" }}\n\n"
    );
    let _ = writeln!(text, "[component.policy.config]");
    let _ = writeln!(text, "start = {{ position = {:?}, rpy = {:?} }}", base.position, base.rpy);
    let _ = writeln!(
        text,
        "goals = [\n    {{ offset = [0.0, 0.0, 0.0], duration = \"1 s\", dwell = \"{} s\" }},\n    \
         {{ offset = [0.0, 0.0, {:.4}], duration = \"1.5 s\", dwell = \"1 s\" }},\n]\n",
        HOLD - 1.0,
        -LOWERED * height
    );
    let _ = writeln!(
        text,
        "[component.controller]\nkind      = \"control.qp\"\nrobot     = \"{name}\"\ntrigger   = \"{name}/joint_state\"\n\
         subscribe = {{ joint_state = \"{name}/joint_state\", base_state = \"{name}/base_state\", base_target = \"{name}/base_target\" }}\n\
         publish   = {{ joint_command = \"{name}/joint_command\" }}\n"
    );
    let _ = writeln!(
        text,
        "[component.controller.config]\ninverse_dynamics = {{}}    # all feet of its profile\ntarget_timeout   = \"100 ms\"\ntasks = [\n\
         {balance}    {{ cartesian = {{ name = \"base\", frame = {root}, target = \"base_target\", gain = 10.0, {weights}position_tolerance = 0.01, orientation_tolerance = 0.03 }} }},\n    \
         {{ posture = {{ gain = 6.0, weight = {posture} }} }},\n]\n"
    );
    let _ = writeln!(
        text,
        "[expect]\ncontroller.goals_missed      = \"== 0\"\ncontroller.goals_reached     = \"== 2\"\nphysics.base_height_lowest_m = \"> {:.3}\"",
        0.85 * height
    );
    text
}

/// Returns the joint trajectory to a pose of the first tool, if reachable.
fn reaching(model: &Model, profile: &Profile, name: &str) -> String {
    let goal = profile.end_effectors.values().find_map(|end| tool_goal(model, profile, end));
    let goal = goal.unwrap_or_else(|| (joint_goal(model, profile), String::new()));
    let (goal, frame) = goal;
    format!(
        "[component.policy]\nkind      = \"policy.trajectory\"\nrobot     = \"{name}\"\ntrigger   = \"{name}/joint_state\"\n\
         subscribe = {{ joint_state = \"{name}/joint_state\" }}\npublish   = {{ joint_command = \"{name}/joint_command\" }}\n\n\
         [component.policy.config]\n{frame}goals = [\n    {{ pose = \"home\", dwell = \"{HOLD} s\" }},\n    {{ {goal}, dwell = \"500 ms\" }},\n]\n\n\
         [expect]\npolicy.goals_missed  = \"== 0\"\npolicy.goals_reached = \"== 2\"\n"
    )
}

/// Returns a reachable tool pose near home, and the key that names its frame.
fn tool_goal(model: &Model, profile: &Profile, end: &EndEffector) -> Option<(String, String)> {
    let arm: Vec<&String> = end.joints.iter().filter(|joint| !profile.passive.contains(joint)).collect();
    if arm.len() < POSE_JOINTS || model.base().floating {
        return None;
    }
    let frame = model.frame(&end.frame).ok()?;
    let home = profile.configuration(model, &profile.home).ok()?;
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, home.as_slice());
    let pose = kinematics.pose(model, frame);
    let inwards = -pose.translation.vector.xy().push(0.0).try_normalize(1e-6).unwrap_or_default();
    let mut touch = Touch::new(model, &home);
    let mut solver = InverseKinematics::new(model);
    let options = IkOptions { seeds: 1, ..IkOptions::default() };
    for distance in STEPS {
        for direction in [inwards, -Vector3::z(), Vector3::z(), -inwards, Vector3::y(), -Vector3::y()] {
            let target =
                Isometry3::from_parts((pose.translation.vector + distance * direction).into(), pose.rotation);
            let mut q = home.clone();
            let found = direction != Vector3::zeros()
                && solver.solve(model, frame, &target, &options, q.as_mut_slice()).is_ok()
                && (&q - &home).amax() < LARGEST_MOTION
                && !touch.is_touching(model, q.as_slice());
            if found {
                let [x, y, z] = target.translation.vector.map(rounded).into();
                let (roll, pitch, yaw) = target.rotation.euler_angles();
                let [roll, pitch, yaw] = [roll, pitch, yaw].map(rounded);
                let goal = format!(
                    "end_effector = {{ position = [{x:.5}, {y:.5}, {z:.5}], rpy = [{roll:.5}, {pitch:.5}, {yaw:.5}] }}"
                );
                return Some((goal, format!("frame = {}\n", Value::from(end.frame.as_str()))));
            }
        }
    }
    None
}

/// Rounds to five digits after the point, never to -0.
fn rounded(number: f64) -> f64 {
    (number * 1e5).round() / 1e5 + 0.0
}

/// Touching links, except those that touch at the home pose.
struct Touch(Option<(CollisionModel, Collisions, Kinematics)>);

impl Touch {
    fn new(model: &Model, home: &DVector<f64>) -> Self {
        let options = CollisionOptions { leave_out_defects: true, ..CollisionOptions::default() };
        let Ok(mut solids) = CollisionModel::new(model, &options) else { return Self(None) };
        let (mut kinematics, mut state) = (Kinematics::new(model), Collisions::new(&solids));
        kinematics.update(model, home.as_slice());
        state.update(&solids, &kinematics);
        let touching: Vec<[usize; 2]> =
            state.within(&solids, APART).iter().map(|near| solids.pairs()[near.pair]).collect();
        solids.retain_pairs(|pair| !touching.contains(pair));
        let state = Collisions::new(&solids);
        Self(Some((solids, state, kinematics)))
    }

    /// Returns `true` if links touch at `q` that are apart at the home pose.
    fn is_touching(&mut self, model: &Model, q: &[f64]) -> bool {
        self.0.as_mut().is_some_and(|(solids, state, kinematics)| {
            kinematics.update(model, q);
            state.update(solids, kinematics);
            state.colliding(solids, 0.0).is_some()
        })
    }
}

/// Returns `true` if every drive with an effort limit can hold the robot against gravity.
fn drives_hold(model: &Model, q: &[f64]) -> bool {
    let mut effort = vec![0.0; model.nv()];
    Dynamics::new(model).gravity(model, q, -9.81 * Vector3::z(), &mut effort);
    let first = model.nv() - model.joint_count();
    let limits = model.effort_limit().iter().zip(&effort[first..]);
    limits.into_iter().all(|(limit, effort)| *limit <= 0.0 || effort.abs() <= LOAD * limit)
}

/// Returns offsets of the driven joints of the first end effector, or of all joints: towards the middle of
/// the range, unless links touch there or a drive could not hold the pose.
fn joint_goal(model: &Model, profile: &Profile) -> String {
    let q =
        profile.configuration(model, &profile.home).unwrap_or_else(|_| DVector::from_vec(model.neutral()));
    let mut touch = Touch::new(model, &q);
    let first = model.nq() - model.joint_count();
    let chosen = |joint: &String| match profile.end_effectors.values().next() {
        Some(end) if !model.base().floating => end.joints.contains(joint),
        _ => true,
    };
    let mut goal = q.clone();
    let mut offsets = Vec::new();
    for (index, joint) in model.joint_names().iter().enumerate() {
        if !chosen(joint) || profile.passive.contains(joint) {
            continue;
        }
        let (lower, upper) = (model.lower()[index], model.upper()[index]);
        let slides = usize::from(model.joint(index).kind == JointKind::Prismatic);
        let limited = (upper - lower).is_finite();
        let offset = if limited { OFFSET[slides].min(OFFSET_PART * (upper - lower)) } else { OFFSET[slides] };
        let inwards = if limited && q[first + index] > 0.5 * (lower + upper) { -1.0 } else { 1.0 };
        let free = [inwards, -inwards].into_iter().find(|sign| {
            let position = q[first + index] + sign * offset;
            goal[first + index] = position;
            (lower..=upper).contains(&position)
                && !touch.is_touching(model, goal.as_slice())
                && drives_hold(model, goal.as_slice())
        });
        match free {
            Some(sign) => offsets.push(format!("{} = {:.4}", Value::from(joint.as_str()), sign * offset)),
            None => goal[first + index] = q[first + index],
        }
    }
    format!("offset = {{ {} }}", offsets.join(", "))
}
