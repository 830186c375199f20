//! Load on a joint that is homed at its mechanical stop, computed from the robot model. The load determines
//! whether the effort moves the joint to the stop, holds it there and moves it away again. The model also
//! yields the impact energy.
//!
//! The joint moves with the velocity gain `effort / velocity`. The joint counts as at rest below the fraction
//! [`STILL`] of `velocity`, where its weight and Coulomb friction may use up the rest of `effort`. Viscous
//! damping slows the joint but does not stop it, so damping is included only at that velocity. Friction helps
//! to hold the joint at its stop, and opposes the motion away from it.

mod search;
mod weights;

use std::fmt;

use super::Equipped;
use crate::adapter::{EASED, RUNAWAY, STILL};
use crate::{HomingBy, HomingEntry};
use weights::{Others, Weights};

/// Homing with too little effort for its joint, or too much energy for its stop.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unfit {
    pub(super) joint: String,
    pub(super) problem: Problem,
    /// `true` if the homing fails at the stop for all positions of the other joints, or may cause damage
    /// there. Otherwise, it may fail.
    pub(super) is_refused: bool,
}

/// Effort that is too small for a homing, or velocity that is too large.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum Problem {
    #[error(transparent)]
    TooWeak(TooWeak),
    #[error(transparent)]
    TooHard(TooHard),
}

impl Problem {
    pub(super) fn advice(&self) -> &'static str {
        match self {
            Self::TooWeak(TooWeak { moment: Moment::OnTheWay, .. }) => {
                "raise `effort`, start from the other side, or home this joint later (`order`), when other joints support its weight"
            }
            Self::TooWeak(_) => "raise `effort`, or choose the stop at the other end",
            Self::TooHard(_) => {
                "write a lower `velocity`, or set `energy` to the energy that the stop and the gear withstand"
            }
        }
    }
}

/// Moment of a homing when the effort has to overcome the weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moment {
    /// On the way to the stop.
    OnTheWay,
    /// At the stop, where the effort has to press the joint against it.
    Reaching,
    /// At the stop, where half of the effort has to hold the joint.
    Holding,
    /// At the stop, where the effort has to move the joint away from it.
    Leaving,
}

/// Effort that is smaller than the load.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TooWeak {
    pub(super) moment: Moment,
    /// Positions of the other joints.
    pub(super) place: &'static str,
    /// Effort of the weight against the motion, in `unit`.
    pub(super) weight: f64,
    /// Friction close to rest, in `unit`.
    pub(super) friction: f64,
    /// Part of `effort` that is available, in `unit`.
    pub(super) available: f64,
    pub(super) unit: &'static str,
}

impl TooWeak {
    /// Returns the load that the effort has to overcome. Friction reduces it when the joint is held.
    fn load(&self) -> f64 {
        match self.moment {
            Moment::Holding => self.weight - self.friction,
            Moment::OnTheWay | Moment::Reaching | Moment::Leaving => self.weight + self.friction,
        }
    }
}

impl core::error::Error for TooWeak {}

impl fmt::Display for TooWeak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { moment, place, weight, friction, available, unit } = self;
        let moving = format!("{:.0} %", 100.0 * (1.0 - STILL));
        let (before, sign, part) = match moment {
            Moment::OnTheWay => (format!("on its way, {place}, its weight needs up to"), '+', &*moving),
            Moment::Reaching => {
                (format!("at its stop, {place}, its weight pushes it off with"), '+', &*moving)
            }
            Moment::Holding => (format!("at its stop, {place}, its weight pushes it off with"), '-', "half"),
            Moment::Leaving => {
                (format!("at its stop, {place}, its weight holds it there with"), '+', &*moving)
            }
        };
        write!(
            f,
            "{before} {weight:.3} {unit}, {sign} {friction:.3} {unit} of friction = {:.3} {unit}, \
             but {part} of `effort` is only {available:.3} {unit}",
            self.load()
        )
    }
}

/// Impact with more energy than the configured limit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TooHard {
    pub(super) is_prismatic: bool,
    /// Largest inertia at the stop, kg m2 or kg.
    pub(super) inertia: f64,
    /// Commanded velocity, rad/s or m/s.
    pub(super) velocity: f64,
    /// Factor by which the weight accelerates the joint beyond `velocity`.
    pub(super) faster: f64,
    /// Value of `energy`, J.
    pub(super) allowed: f64,
    /// Velocity at which the impact has the energy `allowed`, rad/s or m/s.
    pub(super) slow: f64,
}

impl TooHard {
    fn energy(&self) -> f64 {
        0.5 * self.inertia * (self.velocity * self.faster).powi(2)
    }
}

impl core::error::Error for TooHard {}

impl fmt::Display for TooHard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { is_prismatic, inertia, velocity, faster, allowed, slow } = self;
        let (mass, speeds) = if *is_prismatic { ("kg", "m/s") } else { ("kg m2", "rad/s") };
        write!(
            f,
            "it may hit its stop with up to 0.5 x {inertia:.4} {mass} x ({velocity} {speeds} x {faster:.2})^2 = \
             {:.3} J, but `energy` is {allowed} J, which corresponds to {slow:.3} {speeds}",
            self.energy()
        )
    }
}

/// Returns the homings at a stop whose effort is too small or whose impact is too hard.
pub(super) fn unfit(equipped: &Equipped, gravity: [f64; 3]) -> Vec<Unfit> {
    let entries = equipped.order.iter().map(|drive| equipped.table.drives[*drive].homing.as_ref());
    let entries: Vec<Option<&HomingEntry>> = entries.collect();
    let mut found = Vec::new();
    for (joint, entry) in entries.iter().enumerate() {
        if let Some(entry) = entry.filter(|entry| entry.by == HomingBy::Stop) {
            let mut load = Load::new(Weights::new(equipped, gravity, joint, entry, &entries), entry);
            found.extend(load.unmoved().into_iter().chain(load.too_hard()));
        }
    }
    found
}

/// Load on one joint.
struct Load<'a> {
    weights: Weights<'a>,
    velocity: f64,
    effort: f64,
    energy: f64,
    /// Friction of the joint close to rest, N m or N.
    friction: f64,
}

impl<'a> Load<'a> {
    fn new(weights: Weights<'a>, entry: &HomingEntry) -> Self {
        let dynamics = weights.joint().dynamics;
        let velocity = entry.velocity.unwrap_or_default();
        Self {
            friction: dynamics.friction + STILL * dynamics.damping * velocity.abs(),
            weights,
            velocity,
            effort: entry.effort.unwrap_or_default(),
            energy: entry.energy(),
        }
    }

    fn unfit(&self, problem: Problem, is_refused: bool) -> Unfit {
        Unfit { joint: self.weights.joint().name.clone(), problem, is_refused }
    }

    fn too_weak(&self, moment: Moment, place: &'static str, weight: f64) -> TooWeak {
        let available = if moment == Moment::Holding { EASED * self.effort } else { self.moving() };
        TooWeak { moment, place, weight, friction: self.friction, available, unit: self.weights.unit() }
    }

    /// Checks that the effort moves the joint to its stop, holds it there, and moves it away. The homing is
    /// refused if it fails at the stop for all positions of the other joints. It is only reported if it fails
    /// with the others at home, at some other positions, or on the way.
    fn unmoved(&mut self) -> Option<Unfit> {
        let certain = self.weights.at_stop(Others::Anywhere);
        self.at_stop((certain.least, certain.most), "at any position of the other joints", true)
            .or_else(|| self.on_the_way(Others::AtHome))
            .or_else(|| {
                let home = self.weights.at_stop(Others::AtHome);
                self.at_stop((home.most, home.least), Others::AtHome.describe(), false)
            })
            .or_else(|| self.on_the_way(Others::Anywhere))
            .or_else(|| self.at_stop((certain.most, certain.least), Others::Anywhere.describe(), false))
    }

    /// Checks for too little effort on the way to the stop.
    fn on_the_way(&mut self, others: Others) -> Option<Unfit> {
        let weight = self.weights.on_the_way(others).max(0.0);
        let weak = self.too_weak(Moment::OnTheWay, others.describe(), weight);
        (weak.load() >= weak.available).then(|| self.unfit(Problem::TooWeak(weak), false))
    }

    /// Checks for too little effort at the stop. The weight pushes the joint away from the stop with
    /// `against`, and towards it with `-least`.
    fn at_stop(&self, (against, least): (f64, f64), place: &'static str, is_refused: bool) -> Option<Unfit> {
        let reaching = self.too_weak(Moment::Reaching, place, against);
        let holding = self.too_weak(Moment::Holding, place, against);
        let leaving = self.too_weak(Moment::Leaving, place, -least);
        let weak = if is_refused && reaching.load() >= reaching.available {
            reaching
        } else if holding.load() >= holding.available * (1.0 + STILL) {
            holding
        } else if leaving.load() >= leaving.available {
            leaving
        } else {
            return None;
        };
        Some(self.unfit(Problem::TooWeak(weak), is_refused))
    }

    /// Returns the effort available before the joint counts as at rest.
    fn moving(&self) -> f64 {
        self.effort * (1.0 - STILL)
    }

    /// Checks the energy with which the joint may hit its stop. It follows from the largest inertia at the
    /// stop, and from the velocity under the largest weight on the way. For each, the other joints are in
    /// their worst positions.
    fn too_hard(&mut self) -> Option<Unfit> {
        let inertia = self.weights.inertia_at_stop();
        let helping = self.weights.helping().max(0.0);
        // the velocity gain is effort over velocity, so the weight adds a proportional velocity
        let faster = (1.0 + helping / self.effort).min(RUNAWAY);
        let hard = TooHard {
            is_prismatic: self.weights.is_prismatic(),
            inertia,
            velocity: self.velocity.abs(),
            faster,
            allowed: self.energy,
            slow: (2.0 * self.energy / inertia).sqrt() / faster,
        };
        (hard.energy() > self.energy).then(|| self.unfit(Problem::TooHard(hard), true))
    }
}

#[cfg(test)]
mod tests {
    use motorium_robots::{MimicMode, PackagePath, parse_urdf};

    use super::*;
    use crate::Table;

    /// Gravity in the plane of the arm. Its links of 1 kg and 0.4 m extend along x at zero.
    const DOWN: [f64; 3] = [0.0, -9.81, 0.0];

    /// Planar arm with these homings of its joints.
    fn arm(homings: [&str; 3]) -> Equipped {
        rubbing_arm(homings, [0.0; 2])
    }

    /// Planar arm with this friction (N m) and damping (N m s/rad) of its third joint.
    fn rubbing_arm(homings: [&str; 3], [friction, damping]: [f64; 2]) -> Equipped {
        let mut text = String::from("[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n");
        for (i, homing) in homings.iter().enumerate() {
            text += &format!(
                "[[drive]]\njoint = \"joint{0}\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = {0}\nratio = 20.0\n\
                 watchdog = \"20 ms\"\nranges = {{ position = 80.0, velocity = 120.0, torque = 8.0 }}\n{homing}\n",
                i + 1
            );
        }
        let mut robot = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
        let (before, third) = robot.entry.unwrap().urdf.split_once("<joint name=\"joint3\"").unwrap();
        let dynamics = format!("<dynamics friction=\"{friction}\" damping=\"{damping}\"/></joint>");
        let urdf = format!("{before}<joint name=\"joint3\"{}", third.replacen("</joint>", &dynamics, 1));
        robot.model = parse_urdf(&urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
        Equipped { robot, table: Table::parse(&text).unwrap(), order: vec![0, 1, 2] }
    }

    fn at_stop(velocity: f64, effort: f64, more: &str) -> String {
        format!(
            "homing = {{ by = \"stop\", velocity = {velocity}, effort = {effort}, position = 2.9{more} }}"
        )
    }

    /// Homings of an arm: the first two joints are homed, and end at 2.85 rad, before the third.
    fn third(homing: &str) -> [&str; 3] {
        const FIRST: &str = "homing = { by = \"stop\", velocity = 0.1, effort = 90.0, position = 2.9 }";
        [FIRST, FIRST, homing]
    }

    /// The only unfit homing.
    fn only(arm: &Equipped, gravity: [f64; 3]) -> Unfit {
        let found: [Unfit; 1] = unfit(arm, gravity).try_into().unwrap();
        let [found] = found;
        found
    }

    /// Load of a homing whose effort is too small.
    fn weak(unfit: &Unfit) -> &TooWeak {
        let Problem::TooWeak(weak) = &unfit.problem else { panic!("{unfit:?}") };
        weak
    }

    #[track_caller]
    fn assert_close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 5e-4, "{found}, expected {expected}");
    }

    #[test]
    fn an_effort_below_the_weight_on_the_way_is_reported() {
        // the extended arm weighs 9.81 (0.2 + 0.6 + 1.0) on its first joint, 9.81 (0.2 + 0.6) on its second
        for (joint, weight) in [(0, 17.658), (1, 7.848), (2, 1.962)] {
            let (low, high) =
                (at_stop(0.1, (weight - 0.01) / 0.97, ""), at_stop(0.1, (weight + 0.01) / 0.97, ""));
            let mut homings = [""; 3];
            homings[joint] = &low;
            let warning = only(&arm(homings), DOWN);
            assert_eq!(weak(&warning).moment, Moment::OnTheWay);
            assert_close(weak(&warning).weight, weight);
            homings[joint] = &high;
            let warnings = unfit(&arm(homings), DOWN);
            assert!(warnings.iter().all(|unfit| weak(unfit).moment != Moment::OnTheWay), "{warnings:?}");
        }
        // the joint axis is parallel to gravity
        assert_eq!(unfit(&arm([&at_stop(0.1, 0.5, ""), "", ""]), [0.0, 0.0, -9.81]), []);
    }

    #[test]
    fn a_heavy_weight_on_the_way_is_not_refused() {
        // at home the arm is bent: the load on its first joint is smaller than when extended
        let home = [0.8_f64, 1.6];
        // centres of mass at 0.2, 0.4 + 0.2 e1, 0.4 + 0.4 e1 + 0.2 e2 from the first joint
        let (x, y) =
            (1.0 + 0.6 * home[0].cos() + 0.2 * home[1].cos(), 0.6 * home[0].sin() + 0.2 * home[1].sin());
        let weight = 9.81 * x.hypot(y);
        let at = |weight: f64| only(&arm([&at_stop(0.1, weight / 0.97, ""), "", ""]), DOWN);
        for (effort, others, needs) in
            [(weight - 0.05, Others::AtHome, weight), (weight + 0.05, Others::Anywhere, 17.658)]
        {
            let warning = at(effort);
            let found = weak(&warning);
            assert_eq!((found.moment, found.place), (Moment::OnTheWay, others.describe()));
            assert_close(found.weight, needs);
            assert!(!warning.is_refused);
        }
    }

    #[test]
    fn previously_homed_joints_are_at_their_final_positions() {
        // the second and third joints end folded back at 2.85 rad, so little weight is left
        let before = at_stop(0.1, 18.0, "");
        let last = at_stop(0.1, 14.0, ", order = 1");
        let certain: Vec<Unfit> = unfit(&arm([&last, &before, &before]), DOWN);
        assert!(!certain.iter().any(|unfit| unfit.joint == "joint1"), "{certain:?}");
    }

    #[test]
    fn a_weight_pushing_the_joint_off_its_stop_is_refused() {
        let homing = |effort: f64| {
            format!(
                "homing = {{ by = \"stop\", velocity = -0.1, effort = {effort}, position = -2.9, order = 1 }}"
            )
        };
        // angle of the link: 2 x 2.85 - 2.9 rad
        let weight = -1.962 * 2.8_f64.cos();
        for friction in [0.0, 0.3] {
            let most = (weight - friction) / (0.5 * 1.03);
            let refused = only(&rubbing_arm(third(&homing(most - 0.01)), [friction, 0.0]), DOWN);
            assert_eq!((refused.is_refused, weak(&refused).moment), (true, Moment::Holding));
            assert_close(weak(&refused).weight, weight);
            let warnings = unfit(&rubbing_arm(third(&homing(most + 0.01)), [friction, 0.0]), DOWN);
            assert_eq!(warnings, [], "friction {friction} N m");
        }
    }

    #[test]
    fn a_weight_holding_the_joint_at_its_stop_is_refused() {
        // angle of the link: 2 x 2.85 + 2.9 rad
        let leaving = -1.962 * 8.6_f64.cos();
        let most = (leaving + 0.3) / 0.97;
        let found =
            |effort: f64| only(&rubbing_arm(third(&at_stop(0.1, effort, ", order = 1")), [0.3, 0.0]), DOWN);
        let refused = found(most - 0.01);
        assert_eq!((refused.is_refused, weak(&refused).moment), (true, Moment::Leaving));
        assert_close(weak(&refused).weight, leaving);
        // the weight is larger at other positions
        let warning = found(most + 0.01);
        assert_eq!((warning.is_refused, weak(&warning).moment), (false, Moment::OnTheWay));
    }

    #[test]
    fn viscous_damping_counts_near_standstill() {
        // it moves at 43 % of its velocity
        let homing = at_stop(1.0, 1.5, "");
        assert_eq!(unfit(&rubbing_arm(["", "", &homing], [0.0, 2.0]), [0.0; 3]), []);
        // it moves at 2.9 % and at 3.1 %
        for (damping, is_standing) in [(1.5 / 0.029 - 1.5, true), (1.5 / 0.031 - 1.5, false)] {
            let warnings = unfit(&rubbing_arm(["", "", &homing], [0.0, damping]), [0.0; 3]);
            assert_eq!(warnings.iter().any(|unfit| unfit.is_refused), is_standing, "{damping}: {warnings:?}");
        }
    }

    #[test]
    fn stop_energy_is_bounded_by_the_extended_arm() {
        // 3 I + m (0.2^2 + 0.6^2 + 1.0^2)
        let inertia = 3.0 * 0.013_558_333 + 1.4_f64;
        let fastest = (2.0 * 0.1 / inertia).sqrt();
        let fast = at_stop(fastest * 1.001, 12.0, "");
        let hard = |homings: [&str; 3], gravity: [f64; 3]| {
            let refused = only(&arm(homings), gravity);
            let Problem::TooHard(hard) = refused.problem else { panic!("{refused:?}") };
            assert!(refused.is_refused);
            hard
        };
        let found = hard([&fast, "", ""], [0.0; 3]);
        assert_close(found.inertia, inertia);
        assert_close(found.slow, fastest);
        let slow = at_stop(fastest * 0.999, 12.0, "");
        assert_eq!(unfit(&arm([&slow, "", ""]), [0.0; 3]), []);
        let allowed = at_stop(1.5, 12.0, ", energy = 1.7");
        assert_eq!(unfit(&arm([&allowed, "", ""]), [0.0; 3]), []);
        // the weight pulls the joint along: twice as fast if the weight equals the effort
        let found = hard(["", "", &at_stop(1.0, 3.95, ", energy = 0.05")], DOWN);
        assert_close(found.faster, RUNAWAY.min(1.0 + 1.962 / 3.95));
    }
}
