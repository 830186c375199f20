//! Stopping a run in the middle of a homing, in a graph. Held joints apply the graph's safe state, joints in
//! progress are disabled, and the homing continues once the run is resumed.

use std::time::Duration;

use motorium::declare::RobotReference;
use motorium::launcher::Options;
use motorium::prelude::*;
use motorium::region::{Latch, Region};
use motorium::run_folder::RunFolder;
use motorium::session::Session;
use motorium::worker::{Kind, Registry, RobotSource};
use motorium_can::{CanAdapter, DriveSimulation, JointHealth};
use motorium_physics::ArticulatedPhysics;

use super::components::{Folder, GOAL, command, pushed_graph};
use super::homing_graph::PLANAR;

/// Commands the goal in each step.
struct Commander(Output<JointCommand>);

#[derive(serde::Deserialize, schemars::JsonSchema)]
struct CommanderConfig {}

impl Component for Commander {
    const KIND: &'static str = "test.commander";
    const SUMMARY: &'static str = "commands a goal";
    type Config = CommanderConfig;

    fn declare(_: &CommanderConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointCommand>("joint_command", "the goal");
        Ok(())
    }

    fn configure(_: CommanderConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self(setup.output("joint_command")?))
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.0.send(&command())
    }
}

/// Arm whose first joint is homed before the others, while a force pushes it off its stop.
struct Arm {
    session: Session<'static>,
    region: Region,
    _folder: Folder,
}

impl Arm {
    fn launch(name: &str, safety: &str) -> Self {
        let folder = Folder::new(name, PLANAR);
        let push = r#"pushes = [{ at = "0 s", duration = "100 s", link = "link1", point = [0.4, 0.0, 0.0], force = [0.0, 5.0, 0.0] }]"#;
        let commander = motorium::testing::Instance::of::<Commander>("commander").rate("1 kHz");
        let graph = pushed_graph(&folder, push, "", safety).kind::<CanAdapter>();
        let graph = graph.with(commander.publish("joint_command", "arm/command"));
        let plan = graph.check().unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
        let check = |robot: &RobotReference| {
            let loaded = motorium_robots::load(&robot.urdf, &robot.base);
            loaded.map(|_| Vec::new()).map_err(|error| ConfigError::new(error.to_string()))
        };
        let kinds = [
            Kind::of::<ArticulatedPhysics>(),
            Kind::of::<DriveSimulation>(),
            Kind::of::<CanAdapter>(),
            Kind::of::<Commander>(),
        ];
        let registry = Registry::new(RobotSource { check }, kinds);
        let session = Session::launch(plan, &registry, &Options::threads()).unwrap();
        let region = RunFolder::find(session.id()).expect("the run continues").region().unwrap();
        Self { session, region, _folder: folder }
    }

    fn run(&mut self, seconds: f64) {
        let until = self.session.time() + Duration::from_secs_f64(seconds);
        self.session.step_until(until).unwrap();
    }

    /// Runs until the flags of the joints satisfy the condition, at most 20 s.
    fn run_until(&mut self, what: &str, wanted: impl Fn([u32; 3]) -> bool) {
        let end = self.session.time() + Duration::from_secs(20);
        while !wanted(self.flags()) {
            assert!(self.session.time() < end, "{what}: {:?}", self.flags());
            self.run(0.01);
        }
    }

    fn flags(&mut self) -> [u32; 3] {
        let health = self.session.read::<JointHealth>("arm/health").unwrap();
        health.map_or([0; 3], |health| [0, 1, 2].map(|joint| health.value.flags[joint]))
    }

    /// Positions of the joints, rad.
    fn positions(&mut self) -> [f64; 3] {
        let state = self.session.read::<JointState>("arm/true_state").unwrap().expect("physics runs");
        [0, 1, 2].map(|joint| state.value.position()[joint])
    }

    fn is_state_published(&mut self) -> bool {
        self.session.read::<JointState>("arm/state").unwrap().is_some()
    }
}

const STATES: u32 = JointHealth::ENABLED | JointHealth::HOMING | JointHealth::NOT_HOMED;

/// The first joint is held, the second is moving to its stop.
fn is_between([first, second, _]: [u32; 3]) -> bool {
    first & STATES == JointHealth::ENABLED && second & JointHealth::HOMING != 0
}

#[test]
fn held_joints_apply_the_safe_state_while_homing_is_paused() {
    // 1.92 N m against 20 N m s/rad for 0.7 s, or against 100 N m/rad
    for (safe_state, sinks_by) in [("hold", -0.02..0.02), ("damp", 0.055..0.08)] {
        let mut arm =
            Arm::launch(&format!("hand-over-{safe_state}"), &format!("safe_state = \"{safe_state}\""));
        arm.run_until("between two homings", is_between);
        arm.run(0.3);
        arm.region.header().latch(Latch::Stop);
        // braking the second joint slightly moves the first
        arm.run(0.3);
        let before = arm.positions();
        arm.run(0.7);
        let (after, flags) = (arm.positions(), arm.flags());
        let sunk = before[0] - after[0];
        assert!(sinks_by.contains(&sunk), "{safe_state}: the push moves the held joint by {sunk}");
        assert_eq!(flags[0] & STATES, JointHealth::ENABLED, "{safe_state}: it keeps following");
        for joint in [1, 2] {
            assert_eq!(
                flags[joint] & STATES,
                JointHealth::NOT_HOMED,
                "{safe_state}: joint {joint} is disabled"
            );
            let moved = (after[joint] - before[joint]).abs();
            assert!(moved < 0.02, "{safe_state}: its brake holds joint {joint}, which moved by {moved}");
        }
        assert!(!arm.is_state_published(), "{safe_state}: not all joints are known");

        arm.region.header().release();
        arm.run(0.3);
        let held = arm.positions()[0];
        assert!((held - after[0]).abs() < 0.03, "{safe_state}: {held} instead of {}", after[0]);
        assert!(is_between(arm.flags()), "{safe_state}: the homing continues: {:?}", arm.flags());
        arm.run_until("all follow", |flags| flags.iter().all(|flags| flags & STATES == JointHealth::ENABLED));
        arm.run(4.0);
        for (q, goal) in arm.positions().into_iter().zip(GOAL) {
            assert!((q - goal).abs() < 0.2, "{safe_state}: {:?}", arm.positions());
        }
        assert!(arm.is_state_published());
        let adapter = &arm.session.stop().results["adapter"];
        assert_eq!(
            (&adapter["tripped"], &adapter["missing_replies"]),
            (&false.into(), &0.into()),
            "{adapter}"
        );
    }
}
