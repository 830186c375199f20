//! Robots that drive, fly and move their joints: whole graphs, measured by the simulation's true values.

use crate::support::{Ended, run, workspace};

fn whole(graph: &str, arguments: &[&str]) -> Ended {
    let arguments = [&["--clock", "lockstep"], arguments].concat();
    run(&workspace().join("graphs").join(graph), &arguments)
}

fn number(ended: &Ended, component: &str, key: &str) -> f64 {
    let result = &ended.report().results[component];
    result[key].as_f64().unwrap_or_else(|| panic!("no {key} in {result}"))
}

#[track_caller]
fn assert_nothing_allocates(ended: &Ended) {
    for component in &ended.report().components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
}

#[test]
fn a_square_of_two_metres_is_driven_accurately() {
    let ended = whole("drive-square.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(number(&ended, "policy", "goals_reached"), 4.0);
    assert!(number(&ended, "policy", "position_error_m") < 0.02);
    assert!(number(&ended, "policy", "yaw_error_rad") < 1.0_f64.to_radians());
    // the true position in the simulation, at the last corner
    let base = &ended.report().results["physics"]["base_position"];
    let place = |axis: usize| base[axis].as_f64().expect("a number");
    assert!(place(0).hypot(place(1)) < 0.02, "{base}");
    assert!(number(&ended, "controller", "distance_m") > 7.9);
    assert_nothing_allocates(&ended);
}

#[test]
fn missed_square_is_not_a_success() {
    // the robot starts at a different angle from the configured one: the odometry is right about the distance
    // travelled, but wrong about the world
    let ended = whole("drive-square.toml", &["--set", "controller.config.start.yaw=0.1", "--for", "25 s"]);
    assert_eq!(ended.code, Some(8), "{}", ended.stderr);
    assert!(number(&ended, "policy", "position_error_m") > 0.1);
}

#[test]
fn a_quadrotor_takes_off_and_hovers_within_a_centimetre() {
    let ended = whole("hover.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(number(&ended, "controller", "goals_reached"), 2.0);
    assert!(number(&ended, "controller", "position_error_m") < 0.01);
    let base = &ended.report().results["physics"]["base_position"];
    let off =
        [0.5, 0.3, 0.8].iter().enumerate().map(|(axis, goal)| base[axis].as_f64().expect("a number") - goal);
    assert!(off.map(|off| off * off).sum::<f64>().sqrt() < 0.01, "{base}");
    assert_nothing_allocates(&ended);
}

#[test]
fn a_panda_goes_through_its_waypoints() {
    let ended = whole("panda-waypoints.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(number(&ended, "policy", "goals_reached") >= 4.0);
    assert!(number(&ended, "policy", "joint_error") < 0.01);
    assert_eq!(number(&ended, "physics", "steps_beyond_a_velocity_limit"), 0.0);
    assert_eq!(number(&ended, "physics", "steps_with_saturated_drives"), 0.0);
    assert_nothing_allocates(&ended);
}

#[test]
fn panda_puts_a_cube_into_a_bin_twice_bit_for_bit() {
    let runs = [(); 2].map(|()| whole("pick-and-place.toml", &[]));
    for ended in &runs {
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let cube = &ended.report().results["physics"]["objects"]["cube"];
        let place = |axis: usize| cube["position"][axis].as_f64().expect("a number");
        // On the bottom of the bin, 10.5 cm high, within its walls.
        assert!((place(2) - 0.125).abs() < 1e-3, "{cube}");
        assert!((place(0) - 0.45).abs() < 0.05 && (place(1) + 0.25).abs() < 0.05, "{cube}");
        assert!(cube["speed"].as_f64().expect("a number") < 1e-3, "{cube}");
        assert_nothing_allocates(ended);
    }
    assert_eq!(runs[0].report().state_hash, runs[1].report().state_hash);
}

#[test]
fn a_mobile_arm_carries_a_cube_from_table_to_table() {
    let ended = whole("fetch-cube.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let results = &ended.report().results;
    let (cube, controller) = (&results["physics"]["objects"]["cube"], &results["controller"]);
    let place = |axis: usize| cube["position"][axis].as_f64().expect("a number");
    // on the table, 39.6 cm high
    assert!((place(2) - 0.416).abs() < 1e-3, "{cube}");
    assert!((place(0) + 0.6).abs() < 0.02 && (place(1) - 2.25).abs() < 0.02, "{cube}");
    assert!(cube["speed"].as_f64().expect("a number") < 1e-3, "{cube}");
    assert_eq!((&controller["finger_goals"], &controller["finger_goals_refused"]), (&3.into(), &0.into()));
    assert_eq!(controller["goals_reached"], 14, "{controller}");
    assert_nothing_allocates(&ended);
}

#[test]
fn an_arm_on_wheels_carries_a_cube_from_table_to_table() {
    let ended = whole("deliver-cube.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let results = &ended.report().results;
    let (cube, arm) = (&results["physics"]["objects"]["cube"], &results["arm"]);
    let place = |axis: usize| cube["position"][axis].as_f64().expect("a number");
    // on the table, 39.6 cm high
    assert!((place(2) - 0.416).abs() < 1e-3, "{cube}");
    assert!(place(0).abs() < 0.02 && (place(1) - 1.8).abs() < 0.02, "{cube}");
    assert!(cube["speed"].as_f64().expect("a number") < 1e-3, "{cube}");
    assert_eq!((&arm["finger_goals"], &arm["finger_goals_refused"]), (&3.into(), &0.into()));
    assert!(number(&ended, "wheels", "distance_m") > 1.1);
    assert_nothing_allocates(&ended);
}

#[test]
fn panda_puts_a_mesh_nut_into_a_mesh_tray() {
    let ended = whole("pick-nut.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let nut = &ended.report().results["physics"]["objects"]["cube"];
    let place = |axis: usize| nut["position"][axis].as_f64().expect("a number");
    // On the bottom of the tray, 10.6 cm high, made of parts that are larger than the mesh by up to a 64th of
    // 17 cm.
    assert!((place(2) - 0.121).abs() < 3e-3, "{nut}");
    assert!((place(0) - 0.45).abs() < 0.05 && (place(1) + 0.25).abs() < 0.05, "{nut}");
    assert_nothing_allocates(&ended);
}

#[test]
fn a_belt_brings_a_cube_to_the_bin_and_a_ball_rolls_to_rest() {
    let ended = whole("conveyor.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let objects = &ended.report().results["physics"]["objects"];
    assert_eq!(objects["cube"]["touching"][0], "bin", "{objects}");
    // Down 0.497 m of ramp with g (sin a - cos a b / r) / 1.4, around the corner with (cos a + 0.4) / 1.4 of
    // the speed, and on for 0.7 r v^2 / (b g).
    let (angle, radius, arm, g) = (0.2_f64, 0.04, 0.002, 9.81);
    let squared = 2.0 * 0.497 * g * (angle.sin() - angle.cos() * arm / radius) / 1.4;
    let expected = 0.7 * radius * squared * ((angle.cos() + 0.4) / 1.4).powi(2) / (arm * g);
    let travelled = objects["ball"]["position"][0].as_f64().expect("a number") + 1.099;
    assert!((travelled - expected).abs() < 0.03 * expected, "{travelled} m, expected {expected} m");
    assert!(objects["ball"]["speed"].as_f64().expect("a number") < 1e-3, "{objects}");
    assert_nothing_allocates(&ended);
}

#[test]
fn arm_with_held_fingers_reaches_with_seven_joints() {
    let overlay = workspace().join("graphs/overlays/panda-arm.toml");
    let ended = whole("panda-reach.toml", &["--for", "4 s", "--with", overlay.to_str().expect("UTF-8")]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(number(&ended, "controller", "goals_reached") >= 1.0);
    assert!(number(&ended, "controller", "position_error_m") < 1e-3);
    assert_nothing_allocates(&ended);
}

#[test]
fn an_arm_reaches_by_accelerations_and_by_torques() {
    for arguments in [&[][..], &["--set", "controller.config.inverse_dynamics.impedance=0.0"]] {
        let ended = whole("panda-accelerations.toml", &[&["--for", "5 s"], arguments].concat());
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(number(&ended, "controller", "goals_reached") >= 2.0);
        assert!(number(&ended, "controller", "position_error_m") < 1e-3);
        assert_eq!(number(&ended, "controller", "steps_without_solution"), 0.0);
        assert_nothing_allocates(&ended);
    }
}

#[test]
fn a_quadruped_sways_by_contact_forces_alone() {
    let ended = whole("quadruped-forces.toml", &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(number(&ended, "controller", "goals_missed"), 0.0);
    assert_eq!(number(&ended, "controller", "steps_without_solution"), 0.0);
    assert_eq!(ended.report().results["controller"]["solver"]["steps_relaxed"], 0);
    assert_nothing_allocates(&ended);
}
