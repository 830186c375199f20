//! Goals that reach `policy.trajectory` and `policy.home` while they run, with joints that follow their
//! commands exactly.

use motorium::component::Component;
use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::state::{GoalState, GoalStatus, MotionGoal};
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_policies::{HomePolicy, TrajectoryPolicy};
use motorium_robots::Kinematics;

use crate::trajectory::{LIMITS, assert_within_limits};

const START: [f64; 3] = [0.5, 0.8, 0.8];

/// A run: its commands, the status of its goals, and its report.
struct Run {
    commands: Vec<JointCommand>,
    status: Vec<GoalStatus>,
    report: Report,
}

impl Run {
    /// Runs a policy for `time`; each goal is sent at its time, ms.
    fn new<C: Component>(config: &str, goals: Vec<(u64, MotionGoal)>, time: &str) -> Self {
        let arm = Function::new::<JointCommand, JointState>("arm", "command", "state", |_, command| {
            let mut state = JointState::default();
            state.set_count(3);
            state.position_mut().copy_from_slice(command.map_or(&START[..], JointCommand::position));
            Some(state)
        });
        let sender = Source::new::<MotionGoal>("sender", "goal", move |tick| {
            let due = goals.iter().find(|(time_ms, _)| time_ms * 1_000_000 == tick.time_ns);
            due.map(|(_, goal)| *goal)
        });
        let config: toml::Table = format!("config = {config}").parse().unwrap();
        let policy = Instance::of::<C>("policy")
            .robot("arm")
            .trigger("state")
            .subscribe("joint_state", "state")
            .subscribe("goal", "goal")
            .publish("joint_command", "command")
            .publish("goal_status", "status")
            .set("config", config["config"].clone());
        let commands = Probe::<JointCommand>::for_topic("command").triggered();
        let status = Probe::<GoalStatus>::for_topic("status").triggered();
        let graph = Graph::new("goals-test").robot("arm", "planar-3r").with(arm).with(sender).with(policy);
        let report = graph.with(&commands).with(&status).run(time).unwrap();
        let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
        assert_eq!((policy.allocations, policy.errors), (Some(0), 0));
        Self { commands: commands.values(), status: status.values(), report }
    }

    /// The last status of a goal.
    fn last_of(&self, goal: u64) -> &GoalStatus {
        let mut all = self.status.iter().rev();
        all.find(|status| status.goal == goal).unwrap_or_else(|| panic!("no status of goal {goal}"))
    }

    fn result(&self) -> &serde_json::Value {
        &self.report.results["policy"]
    }

    fn end(&self) -> &[f64] {
        self.commands.last().unwrap().position()
    }
}

fn joints(number: u64, positions: [f64; 3]) -> MotionGoal {
    let mut goal = MotionGoal::new(number);
    goal.set_count(3);
    goal.joint_mut().copy_from_slice(&positions);
    goal
}

fn position_goal(number: u64, position: [f64; 3]) -> MotionGoal {
    let mut goal = MotionGoal::new(number);
    goal.set_position(position);
    goal
}

/// Position of the tip, m.
fn tip(q: [f64; 3]) -> [f64; 3] {
    let arm = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
    let mut kinematics = Kinematics::new(&arm.model);
    kinematics.update(&arm.model, &q);
    kinematics.pose(&arm.model, arm.end_effector(None).unwrap()).translation.vector.into()
}

#[test]
fn new_goals_replace_the_motion_within_all_limits() {
    for profile in ["time_optimal", "minimum_jerk"] {
        let config =
            format!("{{ profile = \"{profile}\", {LIMITS}, goals = [{{ position = [-1.0, 0.0, 1.5] }}] }}");
        let goals = vec![
            (400, joints(1, [1.0, -0.5, 0.3])),
            (900, joints(2, [-0.5, 1.2, 0.9])),
            (950, joints(3, START)),
        ];
        let run = Run::new::<TrajectoryPolicy>(&config, goals, "6 s");
        assert_within_limits(&run.commands, profile);
        let mut before = START;
        for (step, command) in run.commands.iter().enumerate() {
            for (position, before) in command.position().iter().zip(&mut before) {
                let moved = position - *before;
                assert!(moved.abs() <= 1e-3 + 1e-9, "{profile} step {step}: a jump of {moved}");
                *before = *position;
            }
        }
        let fastest = run.commands.iter().flat_map(|command| command.velocity().to_vec()).fold(0.0, f64::max);
        assert!(fastest > 0.3, "{profile}: {fastest}");
        assert!(run.end().iter().zip(START).all(|(q, goal)| (q - goal).abs() < 1e-12), "{:?}", run.end());
        for goal in [1, 2] {
            assert_eq!(run.last_of(goal).goal_state(), Some(GoalState::Moving), "{profile} {goal}");
        }
        let last = run.last_of(3);
        assert_eq!((last.goal_state(), last.progress), (Some(GoalState::Reached), 1.0), "{profile}");
        let shares: Vec<f64> =
            run.status.iter().filter(|status| status.goal == 3).map(|status| status.progress).collect();
        assert!(shares.len() > 50 && shares.windows(2).all(|pair| pair[0] <= pair[1]), "{shares:?}");
        let result = run.result();
        assert_eq!((&result["goals_received"], &result["goals_refused"]), (&3.into(), &0.into()), "{result}");
        assert_eq!((&result["goals_reached"], &result["goals_missed"]), (&1.into(), &0.into()), "{result}");
    }
}

#[test]
fn joint_positions_of_a_pose_are_found_over_several_steps() {
    let q = [0.3, 1.0, 0.8];
    let goal = position_goal(9, tip(q));
    let config = format!("{{ {LIMITS}, goals = [\"bent\"] }}");
    let run = Run::new::<TrajectoryPolicy>(&config, vec![(100, goal)], "3 s");
    assert_eq!(run.last_of(9).goal_state(), Some(GoalState::Reached));
    let states: Vec<_> = run.status.iter().map(GoalStatus::goal_state).collect();
    assert_eq!(states[0], Some(GoalState::Planning), "the search takes more than a step");
    let end: [f64; 3] = run.end().try_into().unwrap();
    let off = tip(end).iter().zip(tip(q)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off} m off at {end:?}");
    // without an orientation the tip keeps the one of the previous goal
    assert!((end.iter().sum::<f64>() - START.iter().sum::<f64>()).abs() < 1e-5, "{end:?}");
}

#[test]
fn refused_goals_do_not_change_the_motion() {
    let far = position_goal(1, [9.0, 0.0, 0.0]);
    let out_of_plane = position_goal(2, [0.5, 0.1, 0.4]);
    let mut few = MotionGoal::new(4);
    few.set_count(2);
    let mut turned = MotionGoal::new(6);
    turned.orientation = [0.0, 0.0, 3.0, 0.0];
    let mut both = position_goal(7, tip(START));
    both.set_joint(0, 0.1);
    let mut slow = joints(8, START);
    slow.duration = -1.0;
    let refused = [
        (far, "m from the first joint, and the links reach"),
        (out_of_plane, "no joint positions within their limits reach the pose"),
        (joints(3, [0.0, 9.0, 0.0]), "joint `joint2` at 9, outside of its range -2.9 to 2.9"),
        (few, "2 joint positions, expected 3"),
        (MotionGoal::new(5), "neither a pose nor joint positions"),
        (turned, "the orientation has the length 3.000"),
        (both, "joint `joint1` has a position, but the pose determines it"),
        (slow, "a duration of -1 s"),
    ];
    let config = format!("{{ {LIMITS}, goals = [{{ position = [0.0, 0.0, 1.0] }}] }}");
    let sent = refused.iter().enumerate().map(|(index, (goal, _))| (100 + 500 * index as u64, *goal));
    let run = Run::new::<TrajectoryPolicy>(&config, sent.collect(), "5 s");
    for (goal, words) in &refused {
        let status = run.last_of(goal.number);
        assert_eq!(status.goal_state(), Some(GoalState::Refused), "{words}");
        assert!(status.as_str().contains(words), "{}", status.as_str());
    }
    let alone = Run::new::<TrajectoryPolicy>(&config, Vec::new(), "5 s");
    let positions =
        |run: &Run| run.commands.iter().map(|command| command.position().to_vec()).collect::<Vec<_>>();
    assert_eq!(positions(&run), positions(&alone));
    assert_eq!((&run.result()["goals_refused"], &run.result()["goals_reached"]), (&8.into(), &1.into()));
}

#[test]
fn home_accepts_goals_and_a_repeated_goal_has_no_effect() {
    let goal = joints(1, [0.0, 0.5, 0.5]);
    let run = Run::new::<HomePolicy>("{}", vec![(100, goal), (110, goal), (3000, goal)], "4 s");
    assert_eq!(run.end(), [0.0, 0.5, 0.5]);
    assert_eq!(run.result()["goals_received"], 1, "{}", run.result());
    assert_eq!(run.last_of(1).goal_state(), Some(GoalState::Reached));
}
