//! `control.mpc` in a graph, with a quadruped whose state is set by the test.

use std::path::Path;

use motorium::launcher::{Exit, Report};
use motorium::prelude::*;
use motorium::state::{ContactSchedule, FootContacts};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_locomotion::MpcPlanner;
use motorium_robots::{Loaded, load};
use nalgebra::Vector3;

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[track_caller]
fn refused(graph: Graph, words: &[&str]) {
    let error = graph.check().expect_err("it must be rejected").render(false);
    for word in words {
        assert!(error.contains(word), "no `{word}` in\n{error}");
    }
}

fn quadruped() -> Loaded {
    load("quadruped", Path::new(".")).unwrap()
}

/// Creates a graph with a quadruped standing in its home pose, which reports this base velocity.
fn standing(velocity: [f64; 3]) -> Graph {
    let robot = quadruped();
    let home = robot.profile.unwrap().configuration(&robot.model, "standing").unwrap();
    let joints: Vec<f64> = home.as_slice()[7..].to_vec();
    let base = BaseState {
        position: [home[0], home[1], home[2]],
        orientation: [home[3], home[4], home[5], home[6]],
        linear_velocity: velocity,
        ..BaseState::default()
    };
    Graph::new("strides")
        .robot("robot", "quadruped")
        .with(Source::new("base", "base", move |_| Some(base)).rate("1 kHz"))
        .with(
            Source::new("joints", "joints", move |_| {
                let mut state = JointState::default();
                state.set_count(joints.len());
                state.position_mut().copy_from_slice(&joints);
                Some(state)
            })
            .rate("1 kHz"),
        )
}

fn config(table: &str) -> toml::Value {
    let table: toml::Table = format!("config = {table}").parse().unwrap();
    table["config"].clone()
}

fn planner(table: &str) -> Instance {
    Instance::of::<MpcPlanner>("planner")
        .robot("robot")
        .rate("200 Hz")
        .subscribe("joint_state", "joints")
        .subscribe("base_state", "base")
        .publish("contact_schedule", "schedule")
        .publish("front_left_wrench", "front_left_wrench")
        .publish("front_left_target", "front_left_target")
        .publish("hind_right_wrench", "hind_right_wrench")
        .set("config", config(table))
}

fn no_allocations(report: &Report, name: &str) {
    assert_eq!(report.exit, Exit::Finished);
    let component = report.components.iter().find(|component| component.name == name).unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
}

const TROT: &str = "{ velocity = [0.4, 0.0, 0.0], gait = { period = \"400 ms\", duty = 0.5, stand_for = \"400 ms\", \
                    offsets = { front_left = 0.0, front_right = 0.5, hind_left = 0.5, hind_right = 0.0 } } }";

#[test]
fn planner_without_a_gait_stands_on_all_feet() {
    let (forces, schedule) =
        (Probe::<Wrench>::for_topic("front_left_wrench"), Probe::<ContactSchedule>::for_topic("schedule"));
    let report = standing([0.0; 3]).with(planner("{}")).with(&forces).with(&schedule).run("500 ms").unwrap();
    no_allocations(&report, "planner");
    let robot = quadruped();
    let weight = robot.model.mass() * 9.81;
    let last = forces.values().pop().unwrap();
    assert!((last.force[2] / (0.25 * weight) - 1.0).abs() < 0.05, "{:?} of {weight} N", last.force);
    // the torque is about the centre of the ball; the force acts below it
    let torque = Vector3::new(0.0, 0.0, -0.0165).cross(&Vector3::from(last.force));
    assert!((Vector3::from(last.torque) - torque).norm() < 1e-12);
    assert!(schedule.values().iter().all(|schedule| schedule.load() == [1.0; 4]));
    let result = &report.results["planner"];
    assert_eq!(result["steps_without_solution"], 0, "{result}");
    assert_eq!(result["swings"], serde_json::json!([0, 0, 0, 0]));
    assert!(number(&result["largest_position_error_m"]) < 1e-3, "{result}");
}

#[test]
fn moving_base_is_braked_and_target_velocity_reached() {
    let force = |velocity: [f64; 3], table: &str| {
        let forces = Probe::<Wrench>::for_topic("front_left_wrench");
        standing(velocity).with(planner(table)).with(&forces).run("100 ms").unwrap();
        Vector3::from(forces.values().pop().unwrap().force)
    };
    let (forwards, backwards) = (force([0.3, 0.0, 0.0], "{}"), force([-0.3, 0.0, 0.0], "{}"));
    assert!(forwards.x < -0.3 && backwards.x > 0.3, "{forwards} {backwards}");
    let aside = force([0.0, 0.3, 0.0], "{}");
    assert!(aside.y < -0.3, "{aside}");
    let faster = |gait: &str| {
        force([0.0; 3], &format!("{{ velocity = [0.5, 0.0, 0.0], acceleration = 100.0, {gait} }}"))
    };
    let strides = "gait = { period = \"400 ms\", stand_for = \"0 s\", \
                   offsets = { front_left = 0.0, front_right = 0.5, hind_left = 0.5, hind_right = 0.0 } }";
    assert!(faster(strides).x > 0.3, "{}", faster(strides));
}

#[test]
fn trot_swings_its_diagonals_alternately() {
    let (forces, targets) = (
        Probe::<Wrench>::for_topic("front_left_wrench"),
        Probe::<PoseTarget>::for_topic("front_left_target"),
    );
    let schedule = Probe::<ContactSchedule>::for_topic("schedule").triggered();
    let graph = standing([0.4, 0.0, 0.0]).with(planner(TROT)).with(&forces).with(&targets).with(&schedule);
    let report = graph.run("2 s").unwrap();
    no_allocations(&report, "planner");
    let loads: Vec<[f64; 4]> =
        schedule.values().iter().map(|schedule| schedule.load().try_into().unwrap()).collect();
    assert!(loads[..60].iter().all(|load| *load == [1.0; 4]), "it stands initially");
    let swings = |foot: usize| loads.iter().filter(|load| load[foot] == 0.0).count();
    for load in &loads {
        assert_eq!((load[0], load[1]), (load[3], load[2]), "diagonals are alike");
        assert!(load[0] > 0.0 || load[1] > 0.0, "some stand");
    }
    assert!(swings(0) > 120 && swings(1) > 120, "{} {}", swings(0), swings(1));
    // a swing foot has no force and moves up and ahead
    assert!(forces.values().iter().any(|wrench| wrench.force == [0.0; 3]));
    let start = targets.values()[0].position;
    let highest = targets.values().iter().map(|target| target.position[2] - start[2]).fold(0.0, f64::max);
    assert!((highest - 0.05).abs() < 5e-3, "{highest}");
    let farthest = targets.values().iter().map(|target| target.position[0] - start[0]).fold(0.0, f64::max);
    // half of the distance travelled during a stance, ahead of the body at touchdown
    assert!(farthest > 0.02 && farthest < 0.1, "{farthest}");
    assert_eq!(report.results["planner"]["swings"][0], targets.values().last().unwrap().goal);
}

#[test]
fn invalid_planners_are_rejected_with_their_key() {
    let with = |table: &str| standing([0.0; 3]).with(planner(table));
    refused(with("{ horizon = { steps = 0 } }"), &["horizon.steps", "expected 1 to 40"]);
    refused(with("{ horizon = { step = \"2 s\" } }"), &["horizon.step"]);
    refused(with("{ gravity = [1.0, 0.0, -9.81] }"), &["gravity", "along -z"]);
    refused(with("{ velocity = [0.5, 0.0, 0.0] }"), &["velocity", "without a gait"]);
    refused(with("{ weights = { turn = [1.0, -1.0, 1.0] } }"), &["weights.turn"]);
    refused(with("{ ground = { normal = [1.0, 0.0, 0.1] } }"), &["ground.normal", "points up"]);
    refused(with("{ ground = \"hilly\" }"), &["ground"]);
    refused(with("{ landing = { early_from = 2.0 } }"), &["landing.early_from"]);
    refused(with("{ landing = { early_from = 0.7 } }"), &["input `feet`", "used by `landing`"]);
    let gait = |rest: &str| with(&format!("{{ gait = {{ period = \"0.4 s\", {rest} }} }}"));
    refused(gait("offsets = { front_left = 0.0 }"), &["gait.offsets", "`front_right` has no offset"]);
    refused(gait("offsets = { left = 0.0 }"), &["gait.offsets", "no foot `left`", "it has front_left"]);
    let all = "offsets = { front_left = 0.0, front_right = 0.5, hind_left = 0.5, hind_right = 0.0 }";
    refused(gait(&format!("duty = 1.0, {all}")), &["gait", "in stance for a fraction 1 of the period"]);
    let arm = Graph::new("arm").robot("arm", "panda").with(
        Instance::of::<MpcPlanner>("planner").robot("arm").rate("200 Hz").subscribe("joint_state", "joints"),
    );
    refused(arm, &["fixed base"]);
    let airborne = Graph::new("airborne")
        .robot("airborne", "quadrotor")
        .with(Instance::of::<MpcPlanner>("planner").robot("airborne").rate("200 Hz"));
    refused(airborne, &["no feet", "[feet.NAME]"]);
}

#[test]
fn steps_with_unknown_contacts_are_reported_and_ignored() {
    let without = |feet: usize| {
        let contacts = Source::new("contacts", "feet", move |tick| {
            let mut contacts = FootContacts::default();
            contacts.set_count(feet);
            contacts.contact_mut().fill(1);
            (tick.time() < 0.25).then_some(contacts)
        });
        let planner = planner("{ landing = { early_from = 0.4 } }").subscribe("feet", "feet");
        let report = standing([0.0; 3]).with(contacts.rate("1 kHz")).with(planner).run("500 ms").unwrap();
        no_allocations(&report, "planner");
        number(&report.results["planner"]["steps_without_fresh_contacts"])
    };
    // of 100 steps, those after 0.27 s have no contacts
    let (all, of_two) = (without(4), without(2));
    assert!((44.0..=48.0).contains(&all) && of_two > 98.0, "{all} {of_two}");
    let unwired = standing([0.0; 3]).with(planner("{}")).run("100 ms").unwrap();
    assert!(unwired.results["planner"].get("steps_without_fresh_contacts").is_none());
}
