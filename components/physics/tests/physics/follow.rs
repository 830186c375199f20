//! Robots of a graph that follow a state: twins of other robots, recorded motions among objects.

use motorium::graph::Checked;
use motorium::launcher::{Exit, Report};
use motorium::prelude::*;
use motorium::state::{BaseState, ObjectPoses};
use motorium::testing::{Graph, Probe, Source};
use motorium_physics::{ArticulatedPhysics, MujocoPhysics, RapierPhysics};

use crate::engines::has_mujoco;

fn kinds() -> impl Iterator<Item = &'static str> {
    ["physics.articulated", "physics.rapier"].into_iter().chain(has_mujoco().then_some("physics.mujoco"))
}

/// A graph in lockstep with these tables.
fn graph(tables: &str) -> Graph {
    let head = "name = \"follow\"\nclock = \"lockstep\"\n[safety]\nstale_after = \"5 ms\"\n";
    Graph::from_toml(format!("{head}{tables}"))
        .kind::<ArticulatedPhysics>()
        .kind::<RapierPhysics>()
        .kind::<MujocoPhysics>()
}

/// A component `twin` of this kind that follows `arm/state`.
fn twin(kind: &str, rest: &str) -> Graph {
    graph(&format!(
        "[robot.arm]\nurdf = \"planar-3r\"\n[component.twin]\nkind = \"{kind}\"\nrobot = \"arm\"\n\
         rate = \"1 kHz\"\nsubscribe = {{ follow = \"arm/state\" }}\n\
         publish = {{ joint_state = \"twin/state\" }}\n{rest}"
    ))
}

/// The state of three joints in a step: they wave.
fn wave(index: u64) -> JointState {
    let mut state = JointState::default();
    state.set_count(3);
    for i in 0..3 {
        let phase = 3e-3 * index as f64 + i as f64;
        state.position_mut()[i] = 0.4 * phase.sin();
        state.velocity_mut()[i] = 1.2 * phase.cos();
        state.effort_mut()[i] = 5.0 * phase.cos();
    }
    state
}

/// Publishes the wave until a step.
fn waving(until: u64) -> Source {
    Source::new("arm", "arm/state", move |tick| (tick.index < until).then(|| wave(tick.index)))
}

fn result<'a>(report: &'a Report, component: &str) -> &'a serde_json::Value {
    assert_eq!(report.exit, Exit::Finished, "{report:?}");
    &report.results[component]
}

#[test]
fn followed_joints_are_published_bit_for_bit() {
    for kind in kinds() {
        let probe = Probe::<JointState>::for_topic("twin/state").triggered();
        let report = twin(kind, "").with(waving(u64::MAX)).with(&probe).run("500 ms").unwrap();
        let twin = result(&report, "twin");
        assert_eq!((&twin["states_refused"], &twin["steps"]), (&0.into(), &500.into()), "{kind}");
        assert!(twin["steps_held"].as_u64().unwrap() <= 1, "{kind}: {twin}");
        let samples = probe.samples();
        assert_eq!(samples.len(), 500);
        // The components of a tick step in a fixed order.
        let delay = (0..2).find(|delay| samples[10].value == wave(10 - delay)).expect("one of two ticks");
        for (index, sample) in (0..).zip(&samples).skip(1) {
            assert_eq!(sample.value, wave(index - delay), "{kind}: step {index}");
        }
        let physics = report.components.iter().find(|component| component.name == "twin").unwrap();
        assert_eq!(physics.allocations, Some(0), "{kind}");
        assert!(physics.gate.is_none(), "{kind}: it has no command gate");
    }
}

#[test]
fn stale_states_hold_the_last_pose_at_rest() {
    for kind in kinds() {
        let probe = Probe::<JointState>::for_topic("twin/state").triggered();
        let config = "config = { follow_stale_after = \"10 ms\" }\n";
        let report = twin(kind, config).with(waving(200)).with(&probe).run("500 ms").unwrap();
        // The last state is 10 ms old at the start of step 209 or 210.
        let held = result(&report, "twin")["steps_held"].as_u64().unwrap();
        assert!((288..=291).contains(&held), "{kind}: {held}");
        let samples = probe.samples();
        let last = &samples.last().unwrap().value;
        assert_eq!(last.position(), wave(199).position(), "{kind}");
        assert_eq!((last.velocity(), last.effort()), (&[0.0; 3][..], &[0.0; 3][..]), "{kind}");
        assert_eq!(samples[205].value, wave(199), "{kind}: not stale yet");
    }
}

#[test]
fn robot_stays_at_its_start_until_the_first_state() {
    for kind in kinds() {
        let probe = Probe::<JointState>::for_topic("twin/state");
        let config = "config = { position = [0.3, -0.2, 0.1] }\n";
        let report = twin(kind, config).with(waving(0)).with(&probe).run("200 ms").unwrap();
        assert_eq!(result(&report, "twin")["steps_held"], 200, "{kind}");
        for state in probe.values() {
            assert_eq!(state.position(), [0.3, -0.2, 0.1], "{kind}: no drive, and no fall");
            assert_eq!(state.velocity(), [0.0; 3], "{kind}");
        }
    }
}

#[test]
fn states_of_another_robot_are_rejected() {
    let state = |tick: &Tick| {
        let mut state = wave(tick.index);
        state.set_count(if tick.index < 100 { 3 } else { 2 });
        Some(state)
    };
    let source = Source::new("arm", "arm/state", state);
    let probe = Probe::<JointState>::for_topic("twin/state");
    let report = twin("physics.articulated", "").with(source).with(&probe).run("300 ms").unwrap();
    let twin = result(&report, "twin");
    assert!((199..=201).contains(&twin["states_refused"].as_u64().unwrap()), "{twin}");
    assert!(twin["steps_held"].as_u64() >= twin["states_refused"].as_u64(), "{twin}");
    assert_eq!(probe.values().last().unwrap().position(), wave(99).position());
}

/// A rod whose drive moves it through a box, and its twin with the same box.
fn live_and_twin(kind: &str) -> Graph {
    let command = |tick: &Tick| {
        let mut command = JointCommand::default();
        command.set_count(1);
        command.position_mut()[0] = 0.2 - 0.3 * tick.time_ns as f64 * 1e-9;
        command.velocity_mut()[0] = -0.3;
        command.kp_mut()[0] = 200.0;
        command.kd_mut()[0] = 20.0;
        Some(command)
    };
    // As in the test of the simulators: between two smooth walls, by a smooth rod.
    let config = "config = { position = [0.2], solver = { friction = 0.0 } }";
    let wall = |name: &str, y: f64| {
        format!(
            "{{ name = \"{name}\", shape = {{ box = {{ size = [0.8, 0.1, 0.1] }} }}, friction = 0.0, \
             position = [0.35, {y}, -1.0] }}"
        )
    };
    let (left, right) = (wall("left", 0.10025), wall("right", -0.10025));
    let world = format!(
        "[world]\nground = {{ height = -1.05 }}\nobjects = [{{ name = \"box\", shape = {{ box = \
         {{ size = [0.2, 0.1, 0.1] }} }}, mass = 0.2, friction = 0.2, position = [0.15, 0.0, -1.0] }}, {left}, \
         {right}]\n[robot.rod]\nurdf = \"pendulum\"\n"
    );
    let live = format!(
        "[component.live]\nkind = \"{kind}\"\nrobot = \"rod\"\nrate = \"1 kHz\"\n\
         subscribe = {{ joint_command = \"rod/command\" }}\n\
         publish = {{ joint_state = \"rod/state\", object_poses = \"rod/objects\" }}\n{config}\n"
    );
    let twin = format!(
        "[component.twin]\nkind = \"{kind}\"\nrobot = \"rod\"\nrate = \"1 kHz\"\n\
         subscribe = {{ follow = \"rod/state\" }}\n\
         publish = {{ joint_state = \"twin/state\", object_poses = \"twin/objects\" }}\n{config}\n"
    );
    graph(&format!("{world}{live}{twin}")).with(Source::new("commands", "rod/command", command))
}

#[test]
fn twin_pushes_its_box_within_a_millimetre() {
    for kind in kinds() {
        let boxes =
            ["rod/objects", "twin/objects"].map(|topic| Probe::<ObjectPoses>::for_topic(topic).triggered());
        let report = live_and_twin(kind).with(&boxes[0]).with(&boxes[1]).run("1500 ms").unwrap();
        assert_eq!(result(&report, "twin")["states_refused"], 0, "{kind}");
        let [live, twin] = boxes.map(|probe| probe.values());
        assert!(live.last().unwrap().position_x()[0] > 0.25, "{kind}: the rod pushes the box");
        let mut worst = 0.0_f64;
        for (live, twin) in live.iter().zip(&twin) {
            let apart = [
                live.position_x()[0] - twin.position_x()[0],
                live.position_y()[0] - twin.position_y()[0],
                live.position_z()[0] - twin.position_z()[0],
            ];
            worst = worst.max(apart.iter().map(|x| x * x).sum::<f64>().sqrt());
        }
        println!("{kind}: box within {:.3} mm", worst * 1e3);
        assert!(worst < 1e-3, "{kind}: {worst} m apart");
    }
}

/// The state of a base in a step: it moves along a circle.
fn circling(index: u64) -> BaseState {
    let angle = 2e-3 * index as f64;
    BaseState {
        position: [0.3 * angle.sin(), 0.3 * (1.0 - angle.cos()), 0.4],
        orientation: [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()],
        linear_velocity: [0.6, 0.0, 0.0],
        angular_velocity: [0.0, 0.0, 2.0],
    }
}

#[test]
fn followed_base_is_published_bit_for_bit() {
    for kind in kinds().filter(|kind| *kind != "physics.rapier") {
        let text = format!(
            "[robot.dog]\nurdf = \"quadruped\"\n[component.twin]\nkind = \"{kind}\"\nrobot = \"dog\"\n\
             rate = \"1 kHz\"\nsubscribe = {{ follow_base = \"dog/base\" }}\n\
             publish = {{ base_state = \"twin/base\", joint_state = \"twin/state\" }}\n"
        );
        let (base, joints) =
            (Probe::<BaseState>::for_topic("twin/base"), Probe::<JointState>::for_topic("twin/state"));
        let source = Source::new("dog", "dog/base", |tick| Some(circling(tick.index)));
        let report = graph(&text).with(source).with(&base).with(&joints).run("300 ms").unwrap();
        assert_eq!(result(&report, "twin")["states_refused"], 0, "{kind}");
        for state in base.values().iter().skip(2) {
            assert!((0..300).any(|index| circling(index) == *state), "{kind}: {state:?}");
        }
        let joints = joints.values();
        assert!(joints.iter().all(|state| state.position() == joints[0].position()), "{kind}: joints stay");
    }
}

/// Two arms in one component: `left` follows, `right` takes commands.
fn left_follows(kind: &str, right: &str) -> Graph {
    graph(&format!(
        "[robot.left]\nurdf = \"planar-3r\"\n[robot.right]\nurdf = \"planar-3r\"\nbase = {{ position = [0.0, 3.0, 0.0] }}\n\
         [component.both]\nkind = \"{kind}\"\nrobots = [\"left\", \"right\"]\nrate = \"1 kHz\"\n\
         subscribe = {{ \"left.follow\" = \"arm/state\", {right} }}\n\
         publish = {{ \"left.joint_state\" = \"left/state\", \"right.joint_state\" = \"right/state\" }}\n"
    ))
    .with(waving(u64::MAX))
}

fn component<'a>(checked: &'a Checked, name: &str) -> &'a motorium::plan::ComponentPlan {
    checked.plan.components.iter().find(|component| component.name == name).unwrap()
}

#[test]
fn one_of_two_robots_follows() {
    let hold = |_: &Tick| {
        let mut command = JointCommand::default();
        command.set_count(3);
        command.kp_mut().fill(50.0);
        command.kd_mut().fill(5.0);
        Some(command)
    };
    for kind in kinds().filter(|kind| *kind != "physics.rapier") {
        let states =
            ["left/state", "right/state"].map(|topic| Probe::<JointState>::for_topic(topic).triggered());
        let graph = left_follows(kind, "\"right.joint_command\" = \"right/command\"");
        let graph = graph.with(Source::new("hold", "right/command", hold)).with(&states[0]).with(&states[1]);
        let checked = graph.check().unwrap();
        assert!(component(&checked, "both").actuator, "{kind}: it moves `right` by commands");
        let report = graph.run("300 ms").unwrap();
        let robots = &result(&report, "both")["robots"];
        assert_eq!(robots["left"]["states_refused"], 0, "{kind}");
        assert!(robots["right"]["steps_held"].is_null(), "{kind}: {robots}");
        assert!(robots["right"]["steps_in_safe_state"].as_u64().unwrap() < 5, "{kind}: {robots}");
        let [left, right] = states.map(|probe| probe.values());
        assert!((298..300).any(|index| left[299] == wave(index)), "{kind}: {:?}", left[299]);
        let moved = right[0].position()[0] - right[299].position()[0];
        assert!(moved > 0.01, "{kind}: its drives move `right` towards zero, by {moved} rad");
    }
}

#[test]
fn check_reports_that_a_follower_is_not_an_actuator() {
    let checked = twin("physics.articulated", "").with(waving(u64::MAX)).check().unwrap();
    let twin = component(&checked, "twin");
    assert!(!twin.actuator);
    assert!(matches!(&twin.notes[..], [note] if note.contains("without actuator")), "{:?}", twin.notes);
    let checked = live_and_twin("physics.articulated").check().unwrap();
    let live = component(&checked, "live");
    assert!(live.actuator && live.notes.is_empty(), "{:?}", live.notes);
}

/// Returns the rendered error of a graph.
fn refusal(graph: &Graph) -> String {
    graph.check().expect_err("it is refused").render(false)
}

#[test]
fn follow_and_commands_for_one_robot_are_rejected() {
    let both = twin("physics.articulated", "").set("component.twin.subscribe.joint_command", "arm/command");
    let commands = Source::new("commands", "arm/command", |_| None::<JointCommand>);
    let refused = refusal(&both.with(waving(1)).with(commands));
    assert!(refused.contains("`follow` and `joint_command` both move the robot"), "{refused}");

    let commands = Source::new("commands", "left/command", |_| None::<JointCommand>);
    let right = "\"left.joint_command\" = \"left/command\", \"right.follow\" = \"other/state\"";
    let other = Source::new("other", "other/state", |_| None::<JointState>);
    let graph = left_follows("physics.articulated", right).with(commands).with(other);
    let refused = refusal(&graph);
    assert!(refused.contains("`left.follow` and `left.joint_command` both move the robot"), "{refused}");
}

#[test]
fn rapier_rejects_a_follower_among_driven_robots() {
    let commands = Source::new("commands", "right/command", |_| None::<JointCommand>);
    let graph = left_follows("physics.rapier", "\"right.joint_command\" = \"right/command\"");
    let refused = refusal(&graph.with(commands));
    assert!(refused.contains("robot `left` follows a state"), "{refused}");
    assert!(refused.contains("moves all robots of a component together"), "{refused}");
}

#[test]
fn invalid_follow_settings_are_rejected_before_the_run() {
    let refused = |config: &str| refusal(&twin("physics.articulated", config).with(waving(1)));
    let never = refused("config = { follow_stale_after = \"0 ms\" }\n");
    assert!(never.contains("`twin.config.follow_stale_after`: 0, expected a time"), "{never}");
    let plant = refused("config = { plant = true }\n");
    assert!(plant.contains("so no robot has simulated drives"), "{plant}");
    // A fixed base has no state to follow.
    let base = twin("physics.articulated", "").set("component.twin.subscribe.follow_base", "arm/base");
    let source = Source::new("base", "arm/base", |_| None::<BaseState>);
    let fixed = refusal(&base.with(waving(1)).with(source));
    assert!(fixed.contains("follow_base"), "{fixed}");
}
