//! The load of a joint that is led to its mechanical stop, by the model of its robot: whether its effort moves it there, and with how
//! much energy it arrives.

use core::f64::consts::PI;

use motorium_robots::{Dynamics, JointKind, Model};
use nalgebra::{DMatrix, Vector3};

use super::Equipped;
use crate::adapter::RUNAWAY;
use crate::{HomingBy, HomingEntry};

/// Places of a coordinate that are tried over its range.
const PLACES: usize = 9;
/// Rounds over all coordinates, after which a search ends.
const ROUNDS: usize = 8;

/// A homing that its joint cannot follow, or that is too hard for its stop.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unfit {
    pub(super) joint: String,
    pub(super) message: String,
    pub(super) advice: &'static str,
    /// It cannot succeed, or does harm; else it may fail in some poses of the other joints.
    pub(super) is_certain: bool,
}

/// The homings at a stop whose load is too much.
pub(super) fn unfit(equipped: &Equipped, gravity: [f64; 3]) -> Vec<Unfit> {
    let entries = equipped.order.iter().map(|drive| equipped.table.drives[*drive].homing.as_ref());
    let entries: Vec<Option<&HomingEntry>> = entries.collect();
    let mut found = Vec::new();
    for (joint, entry) in entries.iter().enumerate() {
        if let Some(entry) = entry.filter(|entry| entry.by == HomingBy::Stop) {
            let mut load = Load::new(equipped, gravity, joint, entry, &entries);
            let unfit = load.stuck().or_else(|| load.pressed_off()).into_iter().chain(load.too_hard());
            found.extend(unfit);
        }
    }
    found
}

/// The places at which the other joints are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Others {
    /// Home.
    AtHome,
    /// Anywhere within their limits, but for those that have been homed before.
    Anywhere,
}

impl Others {
    fn describe(self) -> &'static str {
        match self {
            Self::AtHome => "with the other joints at home",
            Self::Anywhere => "with the other joints anywhere within their limits",
        }
    }
}

/// The load of one joint.
struct Load<'a> {
    model: &'a Model,
    dynamics: Dynamics,
    gravity: Vector3<f64>,
    joint: usize,
    velocity: f64,
    effort: f64,
    stop: f64,
    energy: f64,
    /// Positions of all joints at home; of those that have been homed before, where they ended.
    home: Vec<f64>,
    /// Range of each joint; of those that have been homed before no range.
    ranges: Vec<[f64; 2]>,
    /// Configuration, efforts and mass matrix that are worked on.
    q: Vec<f64>,
    efforts: Vec<f64>,
    mass: DMatrix<f64>,
}

impl<'a> Load<'a> {
    fn new(
        equipped: &'a Equipped,
        gravity: [f64; 3],
        joint: usize,
        entry: &HomingEntry,
        entries: &[Option<&HomingEntry>],
    ) -> Self {
        let model = &equipped.robot.model;
        let profile = equipped.robot.profile.as_ref();
        // a joint that turns without end has been everywhere after a turn
        let or = |limit: f64, turn: f64| if limit.is_finite() { limit } else { turn };
        let ends = |i: usize| [or(model.lower()[i], -PI), or(model.upper()[i], PI)];
        let mut ranges: Vec<[f64; 2]> = (0..model.joint_count()).map(ends).collect();
        let mut home = match profile.and_then(|profile| profile.home(model).ok()) {
            Some(home) => home.as_slice().to_vec(),
            None => ranges.iter().map(|[lower, upper]| 0.0_f64.clamp(*lower, *upper)).collect(),
        };
        for (i, other) in entries.iter().enumerate() {
            let is_before = other.is_some_and(|other| other.order.unwrap_or(0) < entry.order.unwrap_or(0));
            if let Some(end) = other.filter(|_| is_before).and_then(HomingEntry::end) {
                (home[i], ranges[i]) = (end, [end, end]);
            }
        }
        Self {
            model,
            dynamics: Dynamics::new(model),
            gravity: gravity.into(),
            joint,
            velocity: entry.velocity.unwrap_or_default(),
            effort: entry.effort.unwrap_or_default(),
            stop: entry.position.unwrap_or_default(),
            energy: entry.energy(),
            home,
            ranges,
            q: model.neutral(),
            efforts: vec![0.0; model.nv()],
            mass: DMatrix::zeros(model.nv(), model.nv()),
        }
    }

    fn unfit(&self, message: String, advice: &'static str, is_certain: bool) -> Option<Unfit> {
        let joint = self.model.joint_names()[self.joint].clone();
        Some(Unfit { joint, message, advice, is_certain })
    }

    fn is_prismatic(&self) -> bool {
        self.model.joint(self.joint).kind == JointKind::Prismatic
    }

    /// N m, or N.
    fn unit(&self) -> &'static str {
        if self.is_prismatic() { "N" } else { "N m" }
    }

    /// A homing whose effort does not move the joint all along its way.
    fn stuck(&mut self) -> Option<Unfit> {
        let dynamics = self.model.joint(self.joint).dynamics;
        let friction = dynamics.friction + dynamics.damping * self.velocity.abs();
        for others in [Others::AtHome, Others::Anywhere] {
            let weight = self.largest(others, None, |load, q| load.against(q)).max(0.0);
            if weight + friction >= self.effort {
                let (unit, effort) = (self.unit(), self.effort);
                let message = format!(
                    "on its way, {}, its weight needs up to {weight:.3} {unit}, + {friction:.3} {unit} of friction = {:.3} {unit}, and `effort` is {effort}",
                    others.describe(),
                    weight + friction
                );
                return self.unfit(
                    message,
                    "raise `effort`, begin from the other side, or home it later, by `order`, when the others take its weight off it",
                    others == Others::AtHome,
                );
            }
        }
        None
    }

    /// A homing in which the weight presses the joint off its stop, as soon as its effort is halved.
    fn pressed_off(&mut self) -> Option<Unfit> {
        let stop = self.stop;
        for others in [Others::AtHome, Others::Anywhere] {
            let weight = self.largest(others, Some(stop), |load, q| load.against(q));
            let leaving = self.largest(others, Some(stop), |load, q| -load.against(q));
            let (unit, effort) = (self.unit(), self.effort);
            let place = others.describe();
            let message = if 2.0 * weight >= effort {
                format!(
                    "at its stop, {place}, its weight presses it off with {weight:.3} {unit}, twice that is {:.3} {unit}, and `effort` is {effort}",
                    2.0 * weight
                )
            } else if leaving >= effort {
                format!(
                    "at its stop, {place}, its weight holds it there with {leaving:.3} {unit}, and `effort` is {effort}"
                )
            } else {
                continue;
            };
            return self.unfit(
                message,
                "raise `effort`, or choose the stop at the other end",
                others == Others::AtHome,
            );
        }
        None
    }

    /// A homing in which the joint meets its stop with more energy than it may.
    fn too_hard(&mut self) -> Option<Unfit> {
        let stop = self.stop;
        let others = Others::Anywhere;
        let inertia = self.largest(others, Some(stop), Self::inertia);
        let helping = self.largest(others, None, |load, q| -load.against(q)).max(0.0);
        // its gain is effort over velocity: by that much faster its weight pulls it
        let faster = (1.0 + helping / self.effort).min(RUNAWAY);
        let speed = self.velocity.abs() * faster;
        let energy = 0.5 * inertia * speed * speed;
        if energy <= self.energy {
            return None;
        }
        let (mass, speeds) = if self.is_prismatic() { ("kg", "m/s") } else { ("kg m2", "rad/s") };
        let slow = (2.0 * self.energy / inertia).sqrt() / faster;
        let message = format!(
            "it may meet its stop with 0.5 x {inertia:.4} {mass} x ({} {speeds} x {faster:.2})^2 = {energy:.3} J, and `energy` is {} J: that is {slow:.3} {speeds}",
            self.velocity.abs(),
            self.energy
        );
        self.unfit(message, "write a lower `velocity`, or as `energy` what its stop and its gear stand", true)
    }

    /// The effort that holds the joint at these positions, in the direction to its stop.
    fn against(&mut self, joints: &[f64]) -> f64 {
        let Self { model, dynamics, gravity, joint, q, efforts, .. } = self;
        let spring = model.joint(*joint).dynamics;
        let pull = spring.stiffness * (spring.rest - joints[*joint]);
        // how a floating base lies is not known
        let weight = match model.base().floating {
            true => 0.0,
            false => {
                q.copy_from_slice(joints);
                dynamics.gravity(model, q, *gravity, efforts);
                efforts[*joint]
            }
        };
        (weight - pull) * self.velocity.signum()
    }

    /// The inertia that meets the stop with the others held, rotors included, kg m2 or kg.
    fn inertia(&mut self, joints: &[f64]) -> f64 {
        let Self { model, dynamics, joint, q, mass, .. } = self;
        let first = q.len() - joints.len();
        q[first..].copy_from_slice(joints);
        dynamics.crba(model, q, mass);
        let place = model.nv() - joints.len() + *joint;
        mass[(place, place)]
    }

    /// The largest value of a function of the positions, with the joint anywhere, or at `place`.
    ///
    /// Coordinate by coordinate, from several places: weights go with the sine of each angle, so such a search does not end far
    /// from the top.
    fn largest(&mut self, others: Others, place: Option<f64>, value: fn(&mut Self, &[f64]) -> f64) -> f64 {
        let mut ranges = match others {
            Others::AtHome => self.home.iter().map(|at| [*at, *at]).collect(),
            Others::Anywhere => self.ranges.clone(),
        };
        ranges[self.joint] = place.map_or(self.ranges[self.joint], |at| [at, at]);
        let starts = [[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]];
        let within = |share: [f64; 2]| ranges.iter().map(|[a, b]| share[0] * a + share[1] * b).collect();
        let mut starts: Vec<Vec<f64>> = starts.map(within).into();
        starts.push(
            self.home.iter().zip(&ranges).map(|(at, [lower, upper])| at.clamp(*lower, *upper)).collect(),
        );
        let mut most = f64::NEG_INFINITY;
        for mut at in starts {
            let mut best = value(self, &at);
            for round in 0..ROUNDS {
                let before = best;
                for (i, [lower, upper]) in ranges.iter().enumerate() {
                    let (center, half) = match round {
                        0 | 1 => ((lower + upper) / 2.0, (upper - lower) / 2.0),
                        // about where it is, ever finer
                        _ => (at[i], (upper - lower) / f64::from(4_u32.pow(round as u32 - 1))),
                    };
                    for step in 0..PLACES {
                        let share = 2.0 * step as f64 / (PLACES - 1) as f64 - 1.0;
                        let old = at[i];
                        at[i] = (center + share * half).clamp(*lower, *upper);
                        let next = value(self, &at);
                        if next > best {
                            best = next;
                        } else {
                            at[i] = old;
                        }
                    }
                }
                if round > 3 && best - before <= 1e-9 * best.abs() {
                    break;
                }
            }
            most = most.max(best);
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Table;

    /// Gravity in the plane of the arm, whose links of 1 kg and 0.4 m are stretched along x at zero.
    const DOWN: [f64; 3] = [0.0, -9.81, 0.0];

    /// The planar arm, with these homings of its joints.
    fn arm(homings: [&str; 3]) -> Equipped {
        let mut text = String::from("[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n");
        for (i, homing) in homings.iter().enumerate() {
            text += &format!(
                "[[drive]]\njoint = \"joint{0}\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = {0}\nratio = 4.0\n\
                 watchdog = \"20 ms\"\nranges = {{ position = 25.0, velocity = 30.0, torque = 8.0 }}\n{homing}\n",
                i + 1
            );
        }
        let robot = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
        Equipped { robot, table: Table::parse(&text).unwrap(), order: vec![0, 1, 2] }
    }

    fn at_stop(velocity: f64, effort: f64, more: &str) -> String {
        format!(
            "homing = {{ by = \"stop\", velocity = {velocity}, effort = {effort}, position = 2.9{more} }}"
        )
    }

    /// The message of the only homing that is unfit, and whether that is certain.
    fn message(homings: [&str; 3], gravity: [f64; 3]) -> (String, bool) {
        let found = unfit(&arm(homings), gravity);
        assert_eq!(found.len(), 1, "{found:?}");
        (format!("{}: {}", found[0].joint, found[0].message), found[0].is_certain)
    }

    #[test]
    fn an_effort_below_the_weight_anywhere_on_the_way_is_told_with_the_weight() {
        // the stretched arm weighs 9.81 (0.2 + 0.6 + 1.0) on its first joint, 9.81 (0.2 + 0.6) on its second
        for (joint, weight) in [(0, 17.658), (1, 7.848), (2, 1.962)] {
            let (low, high) = (at_stop(0.1, weight - 0.01, ""), at_stop(0.1, weight + 0.01, ""));
            let mut homings = [""; 3];
            homings[joint] = &low;
            let (told, _) = message(homings, DOWN);
            assert!(told.contains(&format!("its weight needs up to {weight:.3} N m")), "{told}");
            homings[joint] = &high;
            let told = unfit(&arm(homings), DOWN);
            assert!(!told.iter().any(|unfit| unfit.message.contains("on its way")), "{told:?}");
        }
        // it turns about an axis along which gravity acts
        assert_eq!(unfit(&arm([&at_stop(0.1, 0.5, ""), "", ""]), [0.0, 0.0, -9.81]), []);
    }

    #[test]
    fn a_weight_that_is_too_much_in_some_poses_of_the_others_is_no_refusal_and_one_at_home_is() {
        // at home the arm is bent: about its first joint it weighs less than stretched
        let home = [0.8_f64, 1.6];
        // centres of mass at 0.2, 0.4 + 0.2 e1, 0.4 + 0.4 e1 + 0.2 e2 from the first joint
        let (x, y) =
            (1.0 + 0.6 * home[0].cos() + 0.2 * home[1].cos(), 0.6 * home[0].sin() + 0.2 * home[1].sin());
        let weight = 9.81 * x.hypot(y);
        let (told, is_certain) = message([&at_stop(0.1, weight - 0.05, ""), "", ""], DOWN);
        assert!(
            told.contains(&format!("at home, its weight needs up to {weight:.3}")) && is_certain,
            "{told}, {weight}"
        );
        let (told, is_certain) = message([&at_stop(0.1, weight + 0.05, ""), "", ""], DOWN);
        assert!(
            told.contains("anywhere within their limits, its weight needs up to 17.658") && !is_certain,
            "{told}"
        );
    }

    #[test]
    fn joints_that_are_homed_before_are_where_their_homing_ended() {
        // the third joint ends folded back at 2.85, and the second at 2.85: little is left to weigh
        let before = at_stop(0.1, 18.0, "");
        let last = at_stop(0.1, 14.0, ", order = 1");
        let certain: Vec<Unfit> = unfit(&arm([&last, &before, &before]), DOWN);
        assert!(!certain.iter().any(|unfit| unfit.joint == "joint1"), "{certain:?}");
    }

    #[test]
    fn a_weight_that_presses_the_joint_off_its_stop_is_told_twice() {
        // gravity along the first link: at home the others bend by 1.3 rad
        let weight = 1.962 * (0.5 + 0.8 + 2.9_f64).sin();
        let (told, is_certain) =
            message(["", "", &at_stop(0.1, 2.0 * weight.abs() - 0.01, ", energy = 9.0")], [-9.81, 0.0, 0.0]);
        assert!(is_certain && told.contains("presses it off"), "{told} {weight}");
    }

    #[test]
    fn the_energy_at_the_stop_is_bounded_by_the_inertia_of_the_stretched_arm() {
        // 3 I + m (0.2^2 + 0.6^2 + 1.0^2)
        let inertia = 3.0 * 0.013_558_333 + 1.4;
        let fastest = (2.0 * 0.1 / inertia).sqrt();
        let fast = at_stop(fastest * 1.001, 12.0, "");
        let (told, is_certain) = message([&fast, "", ""], [0.0; 3]);
        assert!(
            is_certain
                && told.contains("0.5 x 1.4407 kg m2")
                && told.contains(&format!("that is {fastest:.3} rad/s")),
            "{told}"
        );
        let slow = at_stop(fastest * 0.999, 12.0, "");
        assert_eq!(unfit(&arm([&slow, "", ""]), [0.0; 3]), []);
        let allowed = at_stop(1.5, 12.0, ", energy = 1.7");
        assert_eq!(unfit(&arm([&allowed, "", ""]), [0.0; 3]), []);
        // its weight pulls it along: twice as fast where it is as large as the effort
        let (told, _) = message(["", "", &at_stop(1.0, 3.95, ", energy = 0.05")], DOWN);
        assert!(told.contains("x 1.50)^2"), "{told}");
    }
}
