//! Drawn channels, compared with the robot models.

use foxglove::Decode as _;
use foxglove::messages::{FrameTransforms, JointStates};
use motorium::declare::RobotReference;
use motorium::state::{BaseState, JointState};
use motorium_bridges::foxglove::RobotFrames;
use motorium_robots::{Kinematics, load};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

fn isometry(transform: &foxglove::messages::FrameTransform) -> Isometry3<f64> {
    let (t, r) = (transform.translation.unwrap(), transform.rotation.unwrap());
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(r.w, r.x, r.y, r.z));
    Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation)
}

#[test]
fn placed_arm_is_drawn_at_its_kinematic_pose() {
    let reference: RobotReference = serde_json::from_value(serde_json::json!({
        "name": "left", "urdf": "panda", "base": "", "pose": { "position": [0.0, 0.5, 0.1], "rpy": [0.0, 0.0, 1.0] },
    }))
    .unwrap();
    let mut frames = RobotFrames::load(&reference, "left/", false).unwrap();
    let mut state = JointState::default();
    state.set_count(8);
    state.position_mut().copy_from_slice(&[0.1, -0.5, 0.3, -2.0, 0.2, 1.5, 0.7, 0.02]);
    let message = frames.of_joints(&state, 1_500_000_000).unwrap().transforms;
    assert_eq!(
        (message[0].parent_frame_id.as_str(), message[0].child_frame_id.as_str()),
        ("world", "left/panda_link0")
    );
    assert_eq!((message[0].timestamp.unwrap().sec(), message[0].timestamp.unwrap().nsec()), (1, 500_000_000));
    let hand = message.iter().find(|frame| frame.child_frame_id == "left/panda_hand").unwrap();
    assert_eq!(hand.parent_frame_id, "left/panda_link0");

    let model = load("panda", std::path::Path::new(".")).unwrap().model;
    let placed = model.placed(&Isometry3::from_parts(
        Translation3::new(0.0, 0.5, 0.1),
        UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0),
    ));
    let mut kinematics = Kinematics::new(&placed);
    kinematics.update(&placed, state.position());
    let expected = kinematics.pose(&placed, placed.frame("panda_hand").unwrap());
    let drawn = isometry(&message[0]) * isometry(hand);
    assert!((drawn.translation.vector - expected.translation.vector).norm() < 1e-12);
    assert!(drawn.rotation.angle_to(&expected.rotation) < 1e-7);
    state.set_count(3);
    assert!(frames.of_joints(&state, 0).is_none(), "too few joints");
}

#[test]
fn moving_base_is_drawn_from_its_own_state() {
    let reference =
        RobotReference { name: "q".to_string(), urdf: "quadrotor".to_string(), ..RobotReference::default() };
    let mut frames = RobotFrames::load(&reference, "", true).unwrap();
    let joints = frames.of_joints(&JointState::default(), 0).unwrap().transforms;
    assert!(
        joints.iter().all(|frame| frame.parent_frame_id == frames.root()),
        "none in the world: {joints:?}"
    );
    let base =
        BaseState { position: [1.0, 2.0, 3.0], orientation: [0.0, 0.0, 0.0, 1.0], ..BaseState::default() };
    let drawn = frames.of_base(&base, 0).transforms;
    assert_eq!(drawn[0].child_frame_id, frames.root());
    assert_eq!(isometry(&drawn[0]).translation.vector.as_slice(), [1.0, 2.0, 3.0]);
}

#[test]
fn schemas_match_foxglove() {
    use motorium_bridges::foxglove::Schema;
    let schema = Schema::of::<JointStates>();
    assert_eq!((schema.name.as_str(), schema.encoding), ("foxglove.JointStates", "protobuf"));
    assert!(FrameTransforms::decode(&b""[..]).unwrap().transforms.is_empty());
}
