//! Modified models: locked joints, tools, payloads, worlds, other sizes; and drives.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, CollisionModel, CollisionOptions, Drive, Dynamics, Geometry, Inertia, Kinematics, LoadOptions,
    Model, Placed, Reference, SafetyController, UrdfRobot, load, load_with, parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6xX, Vector3};

const BRANCHING: &str = include_str!("fixtures/branching.urdf");
const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

fn read(text: &str, base: BaseMode) -> UrdfRobot {
    parse_urdf_with(text, None, &LoadOptions { base, ..LoadOptions::default() }).unwrap()
}

fn panda(base: BaseMode) -> Model {
    load_with("panda", Path::new("."), &LoadOptions { base, ..LoadOptions::default() }).unwrap().model
}

/// Pseudo-random numbers in -1 .. 1.
fn numbers(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|index| ((index as f64 + 1.0) * 12.9898 + seed * 78.233).sin()).collect()
}

/// A configuration that moves every joint and the base.
fn configuration(model: &Model, seed: f64) -> Vec<f64> {
    let (start, mut q) = (model.neutral(), model.neutral());
    model.integrate(&start, &numbers(model.nv(), seed), &mut q);
    q
}

fn mass(model: &Model, q: &[f64]) -> DMatrix<f64> {
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    Dynamics::new(model).crba(model, q, &mut mass);
    mass
}

fn inverse(model: &Model, q: &[f64], v: &[f64], a: &[f64]) -> DVector<f64> {
    let mut tau = DVector::zeros(model.nv());
    Dynamics::new(model).rnea(model, q, v, a, GRAVITY, tau.as_mut_slice());
    tau
}

#[test]
fn locked_robot_moves_like_one_with_held_joints() {
    let robots = [
        (panda(BaseMode::AsFile), vec![("panda_joint2", 0.4), ("panda_joint5", -1.1)]),
        (panda(BaseMode::Floating), vec![("panda_joint1", 0.7), ("panda_finger_joint1", 0.02)]),
        (read(BRANCHING, BaseMode::AsFile).model, vec![("waist", 0.3), ("shoulder", -0.6)]),
        (read(BRANCHING, BaseMode::Floating).model, vec![("lift_joint", 0.1)]),
    ];
    for (whole, held) in robots {
        let locked = whole.locked(&held).unwrap();
        assert_eq!(locked.nv(), whole.nv() - held.len());
        assert_eq!(locked.frames().len(), whole.frames().len());
        let shapes = |model: &Model| {
            model.base_shapes().len() + model.bodies().iter().map(|body| body.shapes.len()).sum::<usize>()
        };
        assert_eq!(shapes(&locked), shapes(&whole));

        let offset = whole.nv() - whole.joint_count();
        let free: Vec<usize> = (0..whole.nv())
            .filter(|&column| {
                column < offset || !held.iter().any(|(name, _)| *name == whole.joint_names()[column - offset])
            })
            .collect();
        let mut q_whole = configuration(&whole, 1.0);
        for &(name, position) in &held {
            let at = whole.nq() - whole.joint_count() + whole.joint_index(name).unwrap();
            q_whole[at] = position;
        }
        let quaternion = usize::from(offset > 0);
        let mut q: Vec<f64> = q_whole[..offset + quaternion].to_vec();
        q.extend(free.iter().filter(|&&column| column >= offset).map(|&column| q_whole[column + quaternion]));
        let (v, a) = (numbers(locked.nv(), 2.0), numbers(locked.nv(), 3.0));
        let spread = |part: &[f64]| {
            let mut all = vec![0.0; whole.nv()];
            free.iter().zip(part).for_each(|(&column, x)| all[column] = *x);
            all
        };
        let (v_whole, a_whole) = (spread(&v), spread(&a));

        let tau = inverse(&locked, &q, &v, &a);
        let expected = inverse(&whole, &q_whole, &v_whole, &a_whole);
        let expected = DVector::from_iterator(free.len(), free.iter().map(|&column| expected[column]));
        assert_relative_eq!(tau, expected, epsilon = 1e-10, max_relative = 1e-12);
        let (small, large) = (mass(&locked, &q), mass(&whole, &q_whole));
        assert_relative_eq!(small, large.select_rows(&free).select_columns(&free), epsilon = 1e-12);

        let (mut kinematics, mut reference) = (Kinematics::new(&locked), Kinematics::new(&whole));
        kinematics.update_with_acceleration(&locked, &q, &v, &a);
        reference.update_with_acceleration(&whole, &q_whole, &v_whole, &a_whole);
        for frame in whole.frames() {
            let (own, other) = (locked.frame(&frame.name).unwrap(), whole.frame(&frame.name).unwrap());
            assert_relative_eq!(
                kinematics.pose(&locked, own),
                reference.pose(&whole, other),
                epsilon = 1e-12
            );
            let (own, other) = (kinematics.acceleration(&locked, own), reference.acceleration(&whole, other));
            assert_relative_eq!(own.vector(), other.vector(), epsilon = 1e-10);
        }
    }
    let error = panda(BaseMode::AsFile).locked(&[("panda_jont3", 0.0)]).unwrap_err();
    assert!(error.to_string().contains("did you mean \"panda_joint3\""), "{error}");
}

#[test]
fn attached_tool_equals_a_tool_in_the_file() {
    let tool = "<link name=\"T/palm\"><inertial><origin xyz=\"0.01 0.02 0.03\"/><mass value=\"0.5\"/>\
                <inertia ixx=\"0.01\" ixy=\"0.001\" ixz=\"0\" iyy=\"0.012\" iyz=\"0\" izz=\"0.008\"/></inertial></link>\
                <link name=\"T/claw\"><inertial><origin xyz=\"0 0 0.05\"/><mass value=\"0.2\"/>\
                <inertia ixx=\"0.002\" ixy=\"0\" ixz=\"0\" iyy=\"0.002\" iyz=\"0\" izz=\"0.001\"/></inertial></link>\
                <joint name=\"T/close\" type=\"revolute\"><origin xyz=\"0 0.1 0\" rpy=\"0.1 0 0\"/><parent link=\"T/palm\"/>\
                <child link=\"T/claw\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint>";
    let mount = "<joint name=\"mount\" type=\"fixed\"><origin xyz=\"0.1 0 0.2\" rpy=\"0.3 -0.2 0.1\"/>\
                 <parent link=\"lower\"/><child link=\"T/palm\"/></joint>";
    let whole = BRANCHING.replace("</robot>", &format!("{tool}{mount}</robot>"));
    let alone = format!("<robot name=\"tool\">{}</robot>", tool.replace("T/", ""));
    for base in [BaseMode::AsFile, BaseMode::Floating] {
        let expected = read(&whole, base).model;
        let arm = read(BRANCHING, base).model;
        let frame = arm.frame("lower").unwrap();
        let placement = Isometry3::from_parts(
            Vector3::new(0.1, 0.0, 0.2).into(),
            nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.2, 0.1),
        );
        let model = arm.attached(frame, &read(&alone, BaseMode::AsFile).model, &placement, "T/").unwrap();
        assert_eq!(model.joint_names().last().unwrap(), "T/close");
        // in the file the tool is deep in the tree, so the order of the joints differs
        let order: Vec<usize> =
            model.joint_names().iter().map(|name| expected.joint_index(name).unwrap()).collect();
        let (q, v, a) = (configuration(&model, 4.0), numbers(model.nv(), 5.0), numbers(model.nv(), 6.0));
        let arrange = |part: &[f64]| {
            let start = part.len() - order.len();
            let mut out = part.to_vec();
            order.iter().zip(&part[start..]).for_each(|(&index, x)| out[start + index] = *x);
            out
        };
        let tau = inverse(&model, &q, &v, &a);
        let reference = inverse(&expected, &arrange(&q), &arrange(&v), &arrange(&a));
        assert_relative_eq!(DVector::from_vec(arrange(tau.as_slice())), reference, epsilon = 1e-10);
    }
    let arm = read(BRANCHING, BaseMode::AsFile).model;
    let frame = arm.frame("lower").unwrap();
    let error = arm.attached(frame, &arm, &Isometry3::identity(), "").unwrap_err();
    assert!(error.to_string().contains("another prefix"), "{error}");
    let floating = read(BRANCHING, BaseMode::Floating).model;
    assert!(arm.attached(frame, &floating, &Isometry3::identity(), "b/").is_err());
}

#[test]
fn payload_loads_the_joints_like_a_force() {
    let arm = panda(BaseMode::AsFile);
    let hand = arm.frame("panda_hand_tcp").unwrap();
    let payload =
        Inertia { mass: 1.5, com: Vector3::new(0.02, 0.0, 0.1), rotational: Matrix3::identity() * 0.01 };
    let ball = [(Isometry3::translation(0.02, 0.0, 0.1), Geometry::Sphere { radius: 0.05 })];
    let loaded = arm.carrying(hand, "load", payload, &ball).unwrap();
    let q = configuration(&arm, 7.0);
    let zero = vec![0.0; arm.nv()];
    let mut kinematics = Kinematics::new(&arm);
    kinematics.update(&arm, &q);
    let mut jacobian = Matrix6xX::zeros(arm.nv());
    kinematics.jacobian(&arm, hand, Reference::LocalWorldAligned, &mut jacobian);
    let arm_of_force = kinematics.pose(&arm, hand).rotation * payload.com;
    let moment = arm_of_force.cross(&(GRAVITY * payload.mass));
    let wrench =
        nalgebra::Vector6::from_iterator((GRAVITY * payload.mass).iter().chain(moment.iter()).copied());
    let expected = inverse(&arm, &q, &zero, &zero) - jacobian.tr_mul(&wrench);
    assert_relative_eq!(inverse(&loaded, &q, &zero, &zero), expected, epsilon = 1e-10);
    assert_relative_eq!(loaded.mass() - arm.mass(), 1.5, epsilon = 1e-12);
    assert!(loaded.frame("load").is_ok());
    let solids = CollisionModel::new(&loaded, &CollisionOptions::default()).unwrap();
    assert!((0..solids.pairs().len()).any(|pair| solids.pair_links(pair).contains(&"load")));
}

#[test]
fn robots_in_one_world_are_independent() {
    let (one, other) = (panda(BaseMode::AsFile), read(BRANCHING, BaseMode::AsFile).model);
    let placement = Isometry3::new(Vector3::new(1.0, 2.0, 0.5), Vector3::new(0.2, -0.4, 2.0));
    let world = Model::world(
        "cell",
        &[
            Placed { model: &one, prefix: "a/", placement: Isometry3::identity() },
            Placed { model: &other, prefix: "b/", placement },
        ],
    )
    .unwrap();
    assert_eq!(world.nv(), one.nv() + other.nv());
    assert_eq!(world.frames()[0].name, "world");
    let n = one.nv();
    let (q, v, a) = (numbers(world.nv(), 1.0), numbers(world.nv(), 2.0), numbers(world.nv(), 3.0));
    let tau = inverse(&world, &q, &v, &a);
    let first = inverse(&one, &q[..n], &v[..n], &a[..n]);
    assert_relative_eq!(tau.rows(0, n).into_owned(), first, epsilon = 1e-11);
    // in the frame of the second robot, gravity has another direction
    let mut second = DVector::zeros(other.nv());
    let gravity = placement.rotation.inverse() * GRAVITY;
    Dynamics::new(&other).rnea(&other, &q[n..], &v[n..], &a[n..], gravity, second.as_mut_slice());
    assert_relative_eq!(tau.rows(n, other.nv()).into_owned(), second, epsilon = 1e-11);
    assert!(mass(&world, &q).view((0, n), (n, other.nv())).iter().all(|entry| *entry == 0.0));

    let (mut kinematics, mut alone) = (Kinematics::new(&world), Kinematics::new(&other));
    kinematics.update(&world, &q);
    alone.update(&other, &q[n..]);
    let pose = kinematics.pose(&world, world.frame("b/lower").unwrap());
    assert_relative_eq!(pose, placement * alone.pose(&other, other.frame("lower").unwrap()), epsilon = 1e-12);
    let solids = CollisionModel::new(&world, &CollisionOptions::default()).unwrap();
    let across = |pair: [&str; 2]| pair[0].starts_with("a/") && pair[1].starts_with("b/");
    let shaped = other.bodies().iter().any(|body| !body.shapes.is_empty());
    assert_eq!((0..solids.pairs().len()).any(|pair| across(solids.pair_links(pair))), shaped);

    let floating = panda(BaseMode::Floating);
    let robot = Placed { model: &floating, prefix: "", placement };
    assert!(Model::world("w", &[robot]).unwrap_err().to_string().contains("floating base"));
}

#[test]
fn scaled_robot_obeys_the_scaling_laws() {
    let arm = load("panda", Path::new(".")).unwrap().model.locked(&[("panda_finger_joint1", 0.0)]).unwrap();
    let scale = 1.7_f64;
    let large = arm.scaled(scale).unwrap();
    let q = configuration(&arm, 8.0);
    let (v, a) = (numbers(arm.nv(), 1.0), numbers(arm.nv(), 2.0));
    // revolute joints only: everything in M is an inertia, everything in g a mass times a length
    assert_relative_eq!(
        mass(&large, &q),
        mass(&arm, &q) * scale.powi(5),
        max_relative = 1e-12,
        epsilon = 1e-14
    );
    let zero = vec![0.0; arm.nv()];
    let (small, big) = (inverse(&arm, &q, &zero, &zero), inverse(&large, &q, &zero, &zero));
    assert_relative_eq!(big, &small * scale.powi(4), max_relative = 1e-12, epsilon = 1e-12);
    let motion = inverse(&large, &q, &v, &a) - big;
    assert_relative_eq!(
        motion,
        (inverse(&arm, &q, &v, &a) - small) * scale.powi(5),
        max_relative = 1e-10,
        epsilon = 1e-10
    );
    assert_relative_eq!(large.mass(), arm.mass() * scale.powi(3), max_relative = 1e-12);
    assert_eq!(large.lower(), arm.lower());

    let sliding = read(BRANCHING, BaseMode::AsFile).model;
    let half = sliding.scaled(0.5).unwrap();
    assert_eq!(half.upper()[1], sliding.upper()[1] * 0.5);
    let (mut q, v) = (numbers(4, 1.0), vec![0.0; 4]);
    let mut kinematics = Kinematics::new(&sliding);
    kinematics.update_with_velocity(&sliding, &q, &v);
    let expected: Vec<_> = sliding
        .frames()
        .iter()
        .map(|frame| kinematics.pose(&sliding, sliding.frame(&frame.name).unwrap()).translation.vector * 0.5)
        .collect();
    q[1] *= 0.5;
    let mut kinematics = Kinematics::new(&half);
    kinematics.update(&half, &q);
    for (frame, expected) in half.frames().iter().zip(expected) {
        let pose = kinematics.pose(&half, half.frame(&frame.name).unwrap());
        assert_relative_eq!(pose.translation.vector, expected, epsilon = 1e-12);
    }
    assert!(arm.scaled(0.0).is_err() && arm.scaled(f64::NAN).is_err());
}

/// Two hinges, the second with a motor of 1:50 whose rotor has 2e-5 kg m2, and limits for a safe controller.
const GEARED: &str = "<robot name=\"r\" xmlns:drake=\"http://drake.mit.edu\"><link name=\"a\"/>\
    <link name=\"b\"><inertial><origin xyz=\"0.3 0 0\"/><mass value=\"1\"/>\
    <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.02\"/></inertial></link>\
    <link name=\"c\"><inertial><origin xyz=\"0.2 0.1 0\"/><mass value=\"0.5\"/>\
    <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>\
    <joint name=\"one\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/></joint>\
    <joint name=\"two\" type=\"revolute\"><origin xyz=\"0.6 0 0\"/><parent link=\"b\"/><child link=\"c\"/><axis xyz=\"0 1 0\"/>\
    <limit lower=\"-2\" upper=\"2\" velocity=\"3\" effort=\"10\"/>\
    <safety_controller soft_lower_limit=\"-1.9\" soft_upper_limit=\"1.8\" k_position=\"15\" k_velocity=\"10\"/></joint>\
    <transmission name=\"t\"><type>SimpleTransmission</type><joint name=\"two\"><hardwareInterface>x</hardwareInterface></joint>\
    <actuator name=\"m\"><mechanicalReduction>50</mechanicalReduction><drake:rotor_inertia value=\"2e-5\"/></actuator>\
    </transmission></robot>";

#[test]
fn rotor_inertia_is_on_the_diagonal_of_the_mass_matrix() {
    let UrdfRobot { model, warnings } = read(GEARED, BaseMode::AsFile);
    assert_eq!(warnings, []);
    let joint = model.joint(1);
    assert_eq!(joint.drive, Drive { reduction: 50.0, rotor_inertia: 2e-5 });
    assert_relative_eq!(joint.drive.armature(), 0.05, epsilon = 1e-15);
    let soft = SafetyController { soft_lower: -1.9, soft_upper: 1.8, k_position: 15.0, k_velocity: 10.0 };
    assert_eq!((joint.safety, model.joint(0).safety), (Some(soft), None));

    let direct = read(&GEARED.replace("2e-5", "0"), BaseMode::AsFile).model;
    let (q, v, a) = ([0.3, -0.8], [0.5, 1.5], [2.0, -3.0]);
    let rotor = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 0.05]));
    assert_relative_eq!(mass(&model, &q), mass(&direct, &q) + &rotor, epsilon = 1e-15);
    let tau = inverse(&model, &q, &v, &a);
    let expected = inverse(&direct, &q, &v, &a) + &rotor * DVector::from_column_slice(&a);
    assert_relative_eq!(tau, expected, epsilon = 1e-13);
    let mut back = [0.0; 2];
    let mut dynamics = Dynamics::new(&model);
    dynamics.forward(&model, &q, &v, tau.as_slice(), GRAVITY, &mut back).unwrap();
    assert_relative_eq!(back[..], a[..], epsilon = 1e-12);
    let energy = Dynamics::new(&direct).kinetic_energy(&direct, &q, &v) + 0.5 * 0.05 * 1.5 * 1.5;
    assert_relative_eq!(dynamics.kinetic_energy(&model, &q, &v), energy, epsilon = 1e-14);
    let mut derivatives = motorium_robots::Derivatives::new(&model);
    dynamics.rnea_derivatives(&model, &q, &v, &a, GRAVITY, &mut derivatives);
    assert_relative_eq!(derivatives.input, mass(&model, &q), epsilon = 1e-13);
}

#[test]
fn faulty_transmissions_are_named() {
    let warnings = |text: String| -> Vec<String> {
        read(&text, BaseMode::AsFile).warnings.iter().map(ToString::to_string).collect()
    };
    assert_eq!(
        warnings(GEARED.replace("<joint name=\"two\"><h", "<joint name=\"tow\"><h")),
        ["transmission \"t\": its joint \"tow\" does not exist; ignored"]
    );
    let coupled = warnings(GEARED.replace("<actuator", "<joint name=\"one\"/><actuator"));
    assert_eq!(
        coupled,
        [
            "transmission \"t\" couples 2 joints and 1 actuators; ignored: only transmissions of one joint and one actuator are supported"
        ]
    );
    let error =
        parse_urdf_with(&GEARED.replace(">50<", ">fifty<"), None, &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with("URDF:1:") && error.to_string().contains("\"fifty\""), "{error}");
}

/// Every body has the inertia of the links fixed to it, also after modifications of the model.
#[test]
fn link_inertias_sum_to_body_inertias() {
    use motorium_robots::{BodyFactors, Inertia, catalogue};
    let whole = |model: &Model, name: &str| {
        for (index, body) in model.bodies().iter().enumerate() {
            let links = model.frames().iter().filter(|frame| frame.body == Some(index));
            let sum =
                links.fold(Inertia::zero(), |sum, frame| sum.merged(&frame.inertia.moved(&frame.placement)));
            let near = (sum.mass - body.inertia.mass).abs() < 1e-9
                && (sum.com * sum.mass - body.inertia.com * body.inertia.mass).norm() < 1e-9
                && (sum.about_origin() - body.inertia.about_origin()).norm() < 1e-9;
            assert!(near, "{name}, {}: {sum:?}, {:?}", body.name, body.inertia);
        }
        for (index, frame) in model.frames().iter().enumerate() {
            assert!(frame.parent.is_none_or(|parent| parent < index), "{name}, {}", frame.name);
            // the link above is on the same body, or on the body that carries it
            let above = frame.parent.and_then(|parent| model.frames()[parent].body);
            let own = frame.body;
            assert!(own == above || frame.parent.is_some() || frame.body.is_none(), "{name}, {}", frame.name);
        }
    };
    for entry in catalogue() {
        let model = motorium_robots::load(entry.name, std::path::Path::new(".")).unwrap().model;
        whole(&model, entry.name);
        whole(&model.scaled(1.7).unwrap(), entry.name);
        let factors = vec![BodyFactors { mass: 1.3, ..BodyFactors::default() }; model.bodies().len()];
        whole(&model.with_factors(0.7, &factors), entry.name);
        if let Some(joint) = model.joint_names().first() {
            whole(&model.locked(&[(joint, 0.4)]).unwrap(), entry.name);
        }
        if !model.base().floating {
            let frame = model.frame(&model.frames().last().unwrap().name).unwrap();
            let tool = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap().model;
            let both = model
                .attached(frame, &tool, &nalgebra::Isometry3::translation(0.1, 0.0, 0.2), "tool/")
                .unwrap();
            whole(&both, entry.name);
            let carried = both.carried(both.frame("tool/link2").unwrap());
            assert_eq!(carried.len(), 3, "link2, link3, tip");
        }
    }
}
