//! `control.mpc`: a planner of contact forces, contacts and swings of a legged robot.

mod config;
mod setup;

pub use config::{
    FittedConfig, GaitConfig, GroundConfig, HorizonConfig, LandingConfig, MpcConfig, WeightsConfig,
};

use motorium::prelude::*;
use motorium::state::{ContactSchedule, FootContacts};
use motorium_control::measured::{FreshStep, MeasuredState, required_robot};
use nalgebra::Vector2;

use crate::mpc::{LegPlanner, PlanarVelocity};
use setup::MpcSetup;

/// Plans contact forces, contacts and swing motions of a legged robot that follows a velocity command, by
/// model-predictive control of the centroidal motion ([`LegPlanner`]).
///
/// The planner starts with the first robot state, standing on all feet. Without a fresh state it publishes no
/// plan, so that subscribers detect a stale plan; it restarts with the next fresh state. If the solver finds
/// no solution for a horizon, the previous forces are kept.
pub struct MpcPlanner {
    measured: MeasuredState,
    target: Input<TwistTarget>,
    contacts: Input<FootContacts>,
    schedule: Output<ContactSchedule>,
    centre: Output<PoseTarget>,
    feet: Vec<FootOutputs>,
    strides: Parameter<bool>,
    speed_factor: Parameter<f64>,
    planner: LegPlanner,
    config: MpcConfig,
    stand_for: f64,
    /// Time since the start, s.
    began_for: f64,
    figures: Figures,
}

/// Outputs of a foot.
struct FootOutputs {
    wrench: Output<Wrench>,
    target: Output<PoseTarget>,
}

/// Statistics of a run.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    steps: u64,
    solved: u64,
    unsolved: u64,
    without_contacts: u64,
    iterations: u64,
    most_iterations: u32,
    largest_turn: f64,
    largest_error: f64,
    start: Option<[f64; 2]>,
    end: [f64; 2],
    /// Distance travelled along the heading, m.
    forward: f64,
}

impl Component for MpcPlanner {
    const KIND: &'static str = "control.mpc";
    const SUMMARY: &'static str = "plans contact forces, contacts and swings of legs by model-predictive control of the centroidal motion";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = MpcConfig;

    fn declare(config: &MpcConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = required_robot(declare)?;
        let setup = MpcSetup::new(config, robot)?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        declare.input::<BaseState>("base_state", "measured or estimated pose and velocity of the base");
        declare.optional_input::<TwistTarget>("target", "target velocity, in the axes of the heading");
        if config.landing == LandingConfig::default() {
            let doc = "measured contacts of the feet; without fresh contacts only the gait is used";
            declare.optional_input::<FootContacts>("feet", doc);
        } else {
            declare.input::<FootContacts>("feet", "measured contacts of the feet, used by `landing`");
        }
        let doc = "fraction of its load that each foot may carry, and the normal of the ground";
        declare.output::<ContactSchedule>("contact_schedule", doc);
        let doc = "position and velocity of the centre of mass in the world at the end of the step";
        declare.output::<PoseTarget>("centre_of_mass_target", doc);
        for name in &setup.names {
            let doc = format!(
                "force on the foot `{name}` and its torque about the origin of its frame, axes of the world"
            );
            declare.output::<Wrench>(&format!("{name}_wrench"), &doc);
            let doc = format!("pose and velocity of the foot `{name}` in the world; each swing is a goal");
            declare.output::<PoseTarget>(&format!("{name}_target"), &doc);
        }
        declare.boolean("strides", true, "true: the robot walks with its gait; false: it stands on all feet");
        declare.float("speed_factor", 1.0, 0.0..=1.0, "", "factor of the target velocity");
        Ok(())
    }

    fn configure(config: MpcConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let MpcSetup { model, names, planner, stand_for } = MpcSetup::new(&config, &robot)?;
        let feet = names
            .iter()
            .map(|name| {
                Ok(FootOutputs {
                    wrench: setup.named_output(&format!("{name}_wrench"))?,
                    target: setup.named_output(&format!("{name}_target"))?,
                })
            })
            .collect::<Result<Vec<_>, ConfigureError>>()?;
        Ok(Self {
            measured: MeasuredState::configure(model, config.state_timeout.ns, setup)?,
            target: setup.input("target")?,
            contacts: setup.input("feet")?,
            schedule: setup.output("contact_schedule")?,
            centre: setup.output("centre_of_mass_target")?,
            feet,
            strides: setup.parameter("strides")?,
            speed_factor: setup.parameter("speed_factor")?,
            planner,
            config,
            stand_for,
            began_for: 0.0,
            figures: Figures::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(FreshStep { begins, dt }) = self.measured.step(tick)? else { return Ok(()) };
        let state = self.measured.motion();
        if begins {
            self.planner.begin(&state);
            self.began_for = 0.0;
        }
        let desired = desired(&mut self.target, &self.config, self.speed_factor.get());
        let fit =
            touching(&mut self.contacts, &mut self.planner, self.feet.len(), self.config.state_timeout.ns);
        self.figures.without_contacts += u64::from(!fit);
        let strides = self.strides.get() && self.began_for >= self.stand_for;
        let solved = self.planner.step(&state, &desired, strides, dt).is_ok();
        self.began_for += dt;
        self.observe(solved, dt);
        self.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.measured.reset();
        self.figures = Figures::default();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let figures = &self.figures;
        let mean = figures.iterations as f64 / figures.solved.max(1) as f64;
        let way = figures.start.map(|start| (figures.end[0] - start[0]).hypot(figures.end[1] - start[1]));
        let landings = (0..self.feet.len()).map(|foot| self.planner.early_and_late(foot));
        let [early, late] = landings.fold([0; 2], |[early, late], [a, b]| [early + a, late + b]);
        let slope = self.planner.reference().ground().slope();
        let swings: Vec<u64> = (0..self.feet.len()).map(|foot| self.planner.swings(foot)).collect();
        let mut result = serde_json::json!({
            "distance_m": way,
            "forward_m": figures.forward,
            "swings": swings,
            "early_landings": early,
            "late_landings": late,
            // adding 0 avoids a negative zero
            "ground_slope": [slope.x + 0.0, slope.y + 0.0],
            "largest_turn_rad": figures.largest_turn,
            "largest_position_error_m": figures.largest_error,
            "iterations": { "mean": mean, "max": figures.most_iterations },
            "steps_without_solution": figures.unsolved,
            "steps_without_fresh_state": self.measured.stale(),
        });
        if self.contacts.is_wired() {
            result["steps_without_fresh_contacts"] = serde_json::json!(figures.without_contacts);
        }
        Some(result)
    }
}

/// Returns the newest target velocity, zero if it is stale, or the configured velocity if the input is not
/// connected.
fn desired(target: &mut Input<TwistTarget>, config: &MpcConfig, factor: f64) -> PlanarVelocity {
    let [x, y, yaw] = if target.is_wired() {
        let fresh = target.latest().filter(|target| target.age_ns() <= config.target_timeout.ns);
        fresh.map_or([0.0; 3], |target| [target.linear[0], target.linear[1], target.angular[2]])
    } else {
        config.velocity
    };
    PlanarVelocity { linear: Vector2::new(x, y) * factor, yaw_rate: yaw * factor }
}

/// Passes the newest contacts to the planner, or no contacts if they are stale or incomplete. Returns `true`
/// if the contacts are fresh.
fn touching(input: &mut Input<FootContacts>, planner: &mut LegPlanner, feet: usize, timeout_ns: u64) -> bool {
    let fresh = input.latest().filter(|feet| feet.age_ns() <= timeout_ns);
    let fresh = fresh.filter(|contacts| contacts.count() == feet);
    for foot in 0..feet {
        planner.set_touching(foot, fresh.as_ref().map(|contacts| contacts.contact()[foot] == 1));
    }
    fresh.is_some()
}

impl MpcPlanner {
    fn observe(&mut self, solved: bool, dt: f64) {
        let (planner, figures) = (&self.planner, &mut self.figures);
        figures.steps += 1;
        if solved {
            figures.solved += 1;
            figures.iterations += u64::from(planner.mpc().iterations());
            figures.most_iterations = figures.most_iterations.max(planner.mpc().iterations());
        } else {
            figures.unsolved += 1;
        }
        let (state, reference) = (planner.state(), planner.reference());
        let (desired, _, heading) = reference.after(0.0);
        figures.largest_turn = figures.largest_turn.max(state.turn.norm());
        figures.largest_error = figures.largest_error.max((state.position - desired).norm());
        figures.start.get_or_insert([state.position.x, state.position.y]);
        figures.end = [state.position.x, state.position.y];
        figures.forward += dt * (heading.cos() * state.velocity.x + heading.sin() * state.velocity.y);
    }

    fn publish(&mut self) -> Result<(), StepError> {
        let planner = &self.planner;
        let mut schedule = self.schedule.loan()?;
        schedule.set_count(self.feet.len());
        schedule.ground_normal = planner.reference().ground().normal().into();
        for (foot, load) in schedule.load_mut().iter_mut().enumerate() {
            *load = planner.load(foot);
        }
        schedule.publish()?;
        for (foot, outputs) in self.feet.iter_mut().enumerate() {
            let wrench = planner.wrench(foot);
            let mut message = outputs.wrench.loan()?;
            (message.force, message.torque) = (wrench.linear.into(), wrench.angular.into());
            message.publish()?;
            let (pose, velocity) = planner.target(foot);
            let mut message = outputs.target.loan()?;
            *message = PoseTarget {
                position: pose.translation.vector.into(),
                orientation: pose.rotation.coords.into(),
                linear_velocity: velocity.into(),
                angular_velocity: [0.0; 3],
                goal: planner.swings(foot),
                at_goal: u64::from(planner.load(foot) > 0.0),
            };
            message.publish()?;
        }
        let (place, velocity, _) = planner.reference().after(0.0);
        let mut message = self.centre.loan()?;
        *message = PoseTarget {
            position: place.into(),
            orientation: [0.0, 0.0, 0.0, 1.0],
            linear_velocity: velocity.into(),
            ..PoseTarget::default()
        };
        message.publish()
    }
}
