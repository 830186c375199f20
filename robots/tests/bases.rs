//! Floating and planar joints in files.

use approx::assert_relative_eq;
use motorium_robots::{Dynamics, Kinematics, LoadOptions, Model, parse_urdf_with};
use nalgebra::{UnitQuaternion, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A box of 2 kg with its centre 0.1 m above its frame, on a joint of this type.
fn on(kind: &str) -> Model {
    let text = format!(
        r#"<robot name="r"><link name="world"/><link name="box"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
        <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
        <joint name="j" type="{kind}"><parent link="world"/><child link="box"/><origin xyz="1 2 3"/>
        <axis xyz="0 0 1"/></joint></robot>"#
    );
    parse_urdf_with(&text, None, &LoadOptions::default()).unwrap().model
}

#[test]
fn floating_root_joint_creates_a_floating_base() {
    let model = on("floating");
    assert!(model.base().floating);
    assert_eq!((model.nq(), model.nv(), model.joint_count()), (7, 6, 0));
    let q = model.neutral();
    assert_eq!(q, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &q);
    let place = |name: &str| kinematics.pose(&model, model.frame(name).unwrap()).translation.vector;
    assert_eq!(place("box"), Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(place("world"), Vector3::zeros());
}

#[test]
fn free_box_falls_and_keeps_rotating() {
    let model = on("floating");
    let mut q = model.neutral();
    let turn = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1);
    q[3..].copy_from_slice(turn.coords.as_slice());
    let mut a = [0.0; 6];
    Dynamics::new(&model).forward(&model, &q, &[0.0; 6], &[0.0; 6], GRAVITY, &mut a).unwrap();
    let falling = turn.inverse() * GRAVITY;
    assert_relative_eq!(Vector3::from_column_slice(&a[..3]), falling, epsilon = 1e-12);
    assert_relative_eq!(Vector3::from_column_slice(&a[3..]), Vector3::zeros(), epsilon = 1e-12);
}

#[test]
fn planar_joint_is_two_slides_and_a_rotation() {
    let model = on("planar");
    assert_eq!(model.joint_names(), ["j/x", "j/y", "j/yaw"]);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[0.5, -0.25, 0.3]);
    let pose = kinematics.pose(&model, model.frame("box").unwrap());
    assert_relative_eq!(pose.translation.vector, Vector3::new(1.5, 1.75, 3.0), epsilon = 1e-15);
    assert_relative_eq!(pose.rotation.scaled_axis(), Vector3::z() * 0.3, epsilon = 1e-15);
    let mut mass = nalgebra::DMatrix::zeros(3, 3);
    Dynamics::new(&model).crba(&model, &[0.5, -0.25, 0.3], &mut mass);
    assert_relative_eq!(
        mass,
        nalgebra::DMatrix::from_diagonal(&nalgebra::dvector![2.0, 2.0, 0.3]),
        epsilon = 1e-15
    );
}
