use motorium::state::encode;

use super::*;

const MS: u64 = 1_000_000;

/// Limits of two joints; half of them, 1 rad/s and 4 rad/s^2, are used.
fn limits() -> Vec<Rates> {
    ["shoulder", "elbow"].map(|name| Rates { name: name.into(), velocity: 2.0, acceleration: 8.0 }).to_vec()
}

fn eased(kp: f64, first_ms: u64, ramp_down_ms: u64) -> Result<Ease, EaseError> {
    let layout = JointCommand::layout();
    let command = |position: [f64; 2], velocity: [f64; 2]| {
        let text = format!(
            "position={position:?} velocity={velocity:?} effort=[4.0, 0.0] kp=[100.0, {kp:?}] kd=[1.0, 1.0]"
        );
        encode(&layout, &text).expect("a command")
    };
    let (first, last) = (command([1.0, -0.5], [0.0, 0.0]), command([2.0, 0.0], [0.8, -0.4]));
    let mut ease = Ease::new(limits()).expect("commands of joints");
    let ends = [(&first[..], first_ms * MS), (&last[..], first_ms * MS + 3000 * MS)];
    ease.push(Some(ends), TimeSpan { ns: ramp_down_ms * MS })?;
    Ok(ease)
}

fn measured() -> Vec<u8> {
    encode(&JointState::layout(), "position=[0.2, -0.5]").expect("a state")
}

fn command(ease: &mut Ease, time_ns: u64) -> JointCommand {
    from_bytes(ease.command(time_ns).expect("a command")).expect("whole")
}

#[test]
fn approach_is_minimum_jerk_from_the_measured_pose() {
    let mut ease = eased(50.0, 2100, 500).unwrap();
    assert!(ease.needs_start() && ease.command(0).is_none(), "nothing is commanded before it was measured");
    ease.begin(&measured(), 100 * MS).unwrap();
    let begin = command(&mut ease, 100 * MS);
    assert_eq!(
        (begin.position(), begin.velocity(), begin.effort()[0]),
        (&[0.2, -0.5][..], &[0.0, 0.0][..], 0.0)
    );
    // Half of the distance at half of the time, at 15/8 of the mean speed (Flash and Hogan 1985).
    let middle = command(&mut ease, 1100 * MS);
    assert!((middle.position()[0] - 0.6).abs() < 1e-12, "{:?}", middle.position());
    assert!((middle.velocity()[0] - 1.875 * 0.8 / 2.0).abs() < 1e-12, "{:?}", middle.velocity());
    assert_eq!((middle.position()[1], middle.velocity()[1], middle.kp()[1]), (-0.5, 0.0, 50.0));
    let end = command(&mut ease, 2100 * MS - 1);
    assert!((end.position()[0] - 1.0).abs() < 1e-12 && end.velocity()[0].abs() < 1e-12);
    assert!((end.effort()[0] - 4.0).abs() < 1e-9 && ease.made == 3);
}

#[test]
fn approach_beyond_half_of_the_limits_is_rejected() {
    // 0.8 rad at no more than 1 rad/s takes 15/8 * 0.8 s = 1.5 s: the velocity decides.
    let mut ease = eased(50.0, 1500, 500).unwrap();
    ease.begin(&measured(), 0).unwrap();
    let step = |ease: &mut Ease, ms: u64| command(ease, ms * MS).velocity()[0];
    let velocities: Vec<f64> = (0..1500).map(|ms| step(&mut ease, ms)).collect();
    let fastest = velocities.iter().copied().fold(0.0, f64::max);
    assert!((0.999..=1.0 + 1e-12).contains(&fastest), "{fastest}");
    assert!(velocities.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 4.0 * 1e-3));

    let mut late = eased(50.0, 1499, 500).unwrap();
    let error = late.begin(&measured(), 0).unwrap_err();
    assert!(
        matches!(&error, EaseError::Far { joint, needed, .. } if joint == "shoulder" && needed.ns == 1500 * MS)
    );
    let said = error.to_string();
    assert!(
        said.contains("takes 1.5 s") && said.contains("1.499 s are left") && said.contains("--ease-in"),
        "{said}"
    );
    assert!(late.needs_start() && late.command(0).is_none(), "and nothing is commanded");
}

#[test]
fn velocity_ramps_down_after_the_last_command() {
    let mut ease = eased(50.0, 2000, 500).unwrap();
    assert!(ease.is_due(5000 * MS + 1) && !ease.is_due(5000 * MS) && !ease.is_due(2000 * MS));
    ease.begin(&measured(), 0).unwrap();
    // From 0.8 rad/s at 4 rad/s^2: within 0.2 s, all joints together.
    let half = command(&mut ease, 5100 * MS);
    assert!((half.velocity()[0] - 0.4).abs() < 1e-12 && (half.velocity()[1] + 0.2).abs() < 1e-12);
    // Uniform deceleration covers v t / 2 in total, three quarters of it in the first half.
    assert!((half.position()[0] - (2.0 + 0.75 * 0.5 * 0.8 * 0.2)).abs() < 1e-12);
    for time_ms in [5200, 9000] {
        let rest = command(&mut ease, time_ms * MS);
        assert!((rest.position()[0] - 2.08).abs() < 1e-12 && (rest.position()[1] + 0.04).abs() < 1e-12);
        assert_eq!((rest.velocity(), rest.effort()[0]), (&[0.0, 0.0][..], 4.0));
    }
    let said = eased(50.0, 2000, 190).err().expect("too short").to_string();
    assert!(said.contains("takes 200 ms") && said.contains("190 ms are available"), "{said}");
}

#[test]
fn effort_only_commands_are_rejected() {
    assert_eq!(eased(0.0, 2000, 500).err(), Some(EaseError::Limp { joint: "elbow".into() }));
}

#[test]
fn each_episode_is_approached_separately() {
    let mut ease = eased(50.0, 2000, 500).unwrap();
    ease.push(None, TimeSpan { ns: 0 }).unwrap();
    ease.begin(&measured(), 0).unwrap();
    ease.reset(1);
    assert!(ease.needs_start() && !ease.is_due(0), "nothing was commanded in the second");
    ease.reset(0);
    assert!(ease.is_due(0) && ease.command(0).is_none(), "and the pose is measured again");
}

#[test]
fn catalogue_arm_has_the_limits_of_its_profile() {
    let panda = RobotReference { name: "panda".into(), urdf: "panda".into(), ..RobotReference::default() };
    let limits = rates(&panda).unwrap();
    assert_eq!((&*limits[1].name, limits[1].velocity, limits[1].acceleration), ("panda_joint2", 2.175, 7.5));
}
