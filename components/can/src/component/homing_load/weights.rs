//! The weights and inertias of a joint over the poses of its robot.

use core::f64::consts::PI;

use motorium_robots::{Dynamics, Joint, JointKind, Model};
use nalgebra::{DMatrix, Vector3};

use crate::HomingEntry;
use crate::component::Equipped;

/// Places of a coordinate that are tried over its range.
const PLACES: usize = 9;
/// Rounds over all coordinates, after which a search ends.
const ROUNDS: usize = 8;
/// Evaluations of the dynamics after which a search ends, from each of its starts.
const EVALUATIONS: usize = 600;

/// The places at which the other joints are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Others {
    /// Home.
    AtHome,
    /// Anywhere within their limits, but for those that have been homed before.
    Anywhere,
}

impl Others {
    pub(super) fn describe(self) -> &'static str {
        match self {
            Self::AtHome => "with the other joints at home",
            Self::Anywhere => "with the other joints anywhere within their limits",
        }
    }
}

/// The least and the largest value over some poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) least: f64,
    pub(super) most: f64,
}

/// The weights of one joint.
pub(super) struct Weights<'a> {
    model: &'a Model,
    dynamics: Dynamics,
    gravity: Vector3<f64>,
    joint: usize,
    /// Direction to its stop.
    sign: f64,
    stop: f64,
    /// Positions of all joints at home; of those that have been homed before, where they ended.
    home: Vec<f64>,
    /// Range of each joint; of those that have been homed before no range.
    ranges: Vec<[f64; 2]>,
    /// The joints on whose positions its weight and its inertia depend.
    related: Vec<usize>,
    /// Configuration, efforts and mass matrix that are worked on.
    q: Vec<f64>,
    efforts: Vec<f64>,
    mass: DMatrix<f64>,
}

impl<'a> Weights<'a> {
    pub(super) fn new(
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
            sign: entry.velocity.unwrap_or_default().signum(),
            stop: entry.position.unwrap_or_default(),
            home,
            ranges,
            related: related(model, joint),
            q: model.neutral(),
            efforts: vec![0.0; model.nv()],
            mass: DMatrix::zeros(model.nv(), model.nv()),
        }
    }

    pub(super) fn joint(&self) -> &'a Joint {
        self.model.joint(self.joint)
    }

    pub(super) fn is_prismatic(&self) -> bool {
        self.joint().kind == JointKind::Prismatic
    }

    /// N m, or N.
    pub(super) fn unit(&self) -> &'static str {
        if self.is_prismatic() { "N" } else { "N m" }
    }

    /// The effort that holds the joint at its stop in the direction to it.
    pub(super) fn at_stop(&mut self, others: Others) -> Bounds {
        let stop = Some(self.stop);
        Bounds {
            least: -self.largest(others, stop, |weights, q| -weights.against(q)),
            most: self.largest(others, stop, Self::against),
        }
    }

    /// The largest effort that holds the joint anywhere within its limits, in the direction to its stop.
    pub(super) fn on_the_way(&mut self, others: Others) -> f64 {
        self.largest(others, None, Self::against)
    }

    /// The largest effort with which its weight pulls the joint to its stop.
    pub(super) fn helping(&mut self) -> f64 {
        self.largest(Others::Anywhere, None, |weights, q| -weights.against(q))
    }

    /// The largest inertia at its stop, kg m2 or kg.
    pub(super) fn inertia_at_stop(&mut self) -> f64 {
        self.largest(Others::Anywhere, Some(self.stop), Self::inertia)
    }

    /// The effort that holds the joint at these positions, in the direction to its stop.
    fn against(&mut self, joints: &[f64]) -> f64 {
        let Self { model, dynamics, gravity, joint, sign, q, efforts, .. } = self;
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
        (weight - pull) * *sign
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
    /// from the top. It leaves out coordinates that do not matter or have no range, and ends after a bounded number of values.
    fn largest(&mut self, others: Others, place: Option<f64>, value: fn(&mut Self, &[f64]) -> f64) -> f64 {
        let mut ranges = match others {
            Others::AtHome => self.home.iter().map(|at| [*at, *at]).collect(),
            Others::Anywhere => self.ranges.clone(),
        };
        ranges[self.joint] = place.map_or(self.ranges[self.joint], |at| [at, at]);
        let moving: Vec<usize> =
            self.related.iter().copied().filter(|i| ranges[*i][0] < ranges[*i][1]).collect();
        let home: Vec<f64> =
            self.home.iter().zip(&ranges).map(|(at, [lower, upper])| at.clamp(*lower, *upper)).collect();
        let mut most = value(self, &home);
        if moving.is_empty() {
            return most;
        }
        let starts = [[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]];
        let within = |share: [f64; 2]| ranges.iter().map(|[a, b]| share[0] * a + share[1] * b).collect();
        let mut starts: Vec<Vec<f64>> = starts.map(within).into();
        starts.push(home);
        for mut at in starts {
            let mut best = value(self, &at);
            let mut left = EVALUATIONS / PLACES;
            for round in 0..ROUNDS {
                let before = best;
                for i in moving.iter().copied().take(left) {
                    let [lower, upper] = ranges[i];
                    let (center, half) = match round {
                        0 | 1 => ((lower + upper) / 2.0, (upper - lower) / 2.0),
                        // about where it is, ever finer
                        _ => (at[i], (upper - lower) / f64::from(4_u32.pow(round as u32 - 1))),
                    };
                    for step in 0..PLACES {
                        let share = 2.0 * step as f64 / (PLACES - 1) as f64 - 1.0;
                        let old = at[i];
                        at[i] = (center + share * half).clamp(lower, upper);
                        let next = value(self, &at);
                        if next > best {
                            best = next;
                        } else {
                            at[i] = old;
                        }
                    }
                }
                left = left.saturating_sub(moving.len());
                if left == 0 || round > 3 && best - before <= 1e-9 * best.abs() {
                    break;
                }
            }
            most = most.max(best);
        }
        most
    }
}

/// The joints between the base and the bodies that a joint moves, and those that these bodies carry; itself too.
fn related(model: &Model, joint: usize) -> Vec<usize> {
    let bodies = model.bodies();
    // parents stand before children
    let (mut carried, mut related) = (vec![false; bodies.len()], vec![false; model.joint_count()]);
    for (i, body) in bodies.iter().enumerate() {
        let of = body.joint.coordinate.index();
        carried[i] = of == joint || body.parent.is_some_and(|parent| carried[parent]);
        related[of] |= carried[i];
        let mut above = (of == joint).then_some(body.parent).flatten();
        while let Some(parent) = above {
            related[bodies[parent].joint.coordinate.index()] = true;
            above = bodies[parent].parent;
        }
    }
    (0..related.len()).filter(|i| related[*i]).collect()
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use motorium_robots::{MimicMode, PackagePath, parse_urdf};

    use super::*;
    use crate::Table;

    thread_local!(static COUNT: Cell<usize> = const { Cell::new(0) });

    fn counted(weights: &mut Weights<'_>, joints: &[f64]) -> f64 {
        COUNT.set(COUNT.get() + 1);
        weights.against(joints)
    }

    /// A robot of these joints, each with the link that carries it; links of 1 kg lie along x, joints turn about y by up to 2 rad.
    fn robot(joints: &[(&str, &str)]) -> Model {
        let mut text = String::from("<robot name=\"chain\"><link name=\"base\"/>");
        for (name, parent) in joints {
            text += &format!(
                "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{name}\"/><origin xyz=\"0.1 0 0\"/>\
                 <axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" velocity=\"1\" effort=\"1\"/></joint><link name=\"{name}\"><inertial>\
                 <origin xyz=\"0.1 0 0\"/><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
            );
        }
        text += "</robot>";
        parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
    }

    #[test]
    fn a_search_ends_after_a_bounded_number_of_values_and_takes_one_where_nothing_moves() {
        let names: Vec<String> = (0..30).map(|i| format!("j{i}")).collect();
        let parents = std::iter::once("base").chain(names.iter().map(String::as_str));
        let joints: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(parents).collect();
        let mut loaded = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
        (loaded.model, loaded.profile) = (robot(&joints), None);
        let table = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n[[drive]]\njoint = \"j3\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = 1\n\
                     watchdog = \"20 ms\"\nranges = { position = 12.5, velocity = 30.0, torque = 8.0 }\n\
                     homing = { by = \"stop\", velocity = 0.1, effort = 0.4, position = 1.5 }\n";
        let equipped = Equipped { robot: loaded, table: Table::parse(table).unwrap(), order: vec![0; 30] };
        let entry = equipped.table.drives[0].homing.clone().unwrap();
        let mut weights = Weights::new(&equipped, [0.0, 0.0, -9.81], 3, &entry, &[None; 30]);
        let mut values = |others, place| {
            COUNT.set(0);
            weights.largest(others, place, counted);
            COUNT.get()
        };
        assert_eq!(values(Others::AtHome, Some(1.5)), 1);
        let alone = values(Others::AtHome, None);
        assert!((5..=4 * (1 + ROUNDS * PLACES) + 1).contains(&alone), "{alone}");
        let all = values(Others::Anywhere, None);
        assert!((4 * 30 * PLACES..=4 * (1 + EVALUATIONS) + 1).contains(&all), "{all}");
    }

    #[test]
    fn a_joint_depends_on_those_before_and_behind_it_and_not_on_another_arm() {
        let model = robot(&[("a1", "base"), ("a2", "a1"), ("b1", "a1"), ("b2", "b1"), ("c1", "base")]);
        let of = |name: &str| {
            let joint = model.joint_index(name).unwrap();
            related(&model, joint).into_iter().map(|i| model.joint_names()[i].as_str()).collect::<Vec<_>>()
        };
        let sorted = |name: &str| {
            let mut names = of(name);
            names.sort_unstable();
            names
        };
        assert_eq!(sorted("a1"), ["a1", "a2", "b1", "b2"]);
        assert_eq!(sorted("b1"), ["a1", "b1", "b2"]);
        assert_eq!(sorted("c1"), ["c1"]);
    }
}
