//! Weights and inertias of a joint over the poses of its robot.

use core::f64::consts::PI;

use motorium_robots::{Dynamics, Joint, JointKind, Model};
use nalgebra::{DMatrix, Vector3};

use super::search::{self, Axis, Shape};
use crate::HomingEntry;
use crate::component::Equipped;

/// Number of distributed poses from which a search starts, in addition to home and the ends and middles of
/// the ranges.
const SPREAD: usize = 4;

/// Positions of the other joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Others {
    /// Home.
    AtHome,
    /// Anywhere within their limits, except for joints that have already been homed.
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

/// Minimum and maximum over a set of poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) least: f64,
    pub(super) most: f64,
}

/// Weights of one joint.
pub(super) struct Weights<'a> {
    model: &'a Model,
    dynamics: Dynamics,
    gravity: Vector3<f64>,
    joint: usize,
    /// Sign of the direction to the stop.
    sign: f64,
    stop: f64,
    /// Home positions of all joints; final positions of joints that have already been homed.
    home: Vec<f64>,
    /// Range of each joint; a single position for joints that have already been homed.
    ranges: Vec<[f64; 2]>,
    /// Joints whose positions affect the weight.
    related: Vec<usize>,
    /// Joints carried by this joint, which affect its inertia.
    carried: Vec<usize>,
    /// Workspace: configuration, efforts and mass matrix.
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
        // a continuous joint covers all positions within a turn
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
            related: related(model, joint, true),
            carried: related(model, joint, false),
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

    /// Returns the unit of the joint's effort: N m or N.
    pub(super) fn unit(&self) -> &'static str {
        if self.is_prismatic() { "N" } else { "N m" }
    }

    /// Returns the effort that holds the joint at its stop, positive towards the stop.
    pub(super) fn at_stop(&mut self, others: Others) -> Bounds {
        let stop = Some(self.stop);
        Bounds {
            least: -self.largest(Of::Weight, others, stop, |weights, q| -weights.against(q)),
            most: self.largest(Of::Weight, others, stop, Self::against),
        }
    }

    /// Returns the largest effort that holds the joint anywhere within its limits, positive towards the stop.
    pub(super) fn on_the_way(&mut self, others: Others) -> f64 {
        self.largest(Of::Weight, others, None, Self::against)
    }

    /// Returns the largest effort with which the weight pulls the joint towards its stop.
    pub(super) fn helping(&mut self) -> f64 {
        self.largest(Of::Weight, Others::Anywhere, None, |weights, q| -weights.against(q))
    }

    /// Returns the largest inertia at the stop, kg m2 or kg.
    pub(super) fn inertia_at_stop(&mut self) -> f64 {
        self.largest(Of::Inertia, Others::Anywhere, Some(self.stop), Self::inertia)
    }

    /// Returns the effort that holds the joint at these positions, positive towards the stop.
    fn against(&mut self, joints: &[f64]) -> f64 {
        let Self { model, dynamics, gravity, joint, sign, q, efforts, .. } = self;
        let spring = model.joint(*joint).dynamics;
        let pull = spring.stiffness * (spring.rest - joints[*joint]);
        // the orientation of a floating base is unknown
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

    /// Returns the inertia at the stop with the other joints fixed, rotors included, kg m2 or kg.
    fn inertia(&mut self, joints: &[f64]) -> f64 {
        let Self { model, dynamics, joint, q, mass, .. } = self;
        let first = q.len() - joints.len();
        q[first..].copy_from_slice(joints);
        dynamics.crba(model, q, mass);
        let place = model.nv() - joints.len() + *joint;
        mass[(place, place)]
    }

    /// Returns the largest value of a function of the positions, with the joint anywhere or at `place`.
    /// Irrelevant coordinates and coordinates without a range are skipped.
    fn largest(
        &mut self,
        of: Of,
        others: Others,
        place: Option<f64>,
        value: fn(&mut Self, &[f64]) -> f64,
    ) -> f64 {
        let mut ranges = match others {
            Others::AtHome => self.home.iter().map(|at| [*at, *at]).collect(),
            Others::Anywhere => self.ranges.clone(),
        };
        ranges[self.joint] = place.map_or(self.ranges[self.joint], |at| [at, at]);
        let home: Vec<f64> =
            self.home.iter().zip(&ranges).map(|(at, [lower, upper])| at.clamp(*lower, *upper)).collect();
        let matter = if of == Of::Weight { &self.related } else { &self.carried };
        let moving = matter.iter().filter(|i| ranges[**i][0] < ranges[**i][1]);
        let axis = |i: &usize| Axis { index: *i, range: ranges[*i], shape: self.shape(of, *i) };
        let axes: Vec<Axis> = moving.map(axis).collect();
        if axes.is_empty() {
            return value(self, &home);
        }
        let pose = |share: &dyn Fn(usize) -> f64| {
            ranges.iter().enumerate().map(|(i, [a, b])| a + share(i) * (b - a)).collect()
        };
        let mut starts: Vec<Vec<f64>> = [0.0, 1.0, 0.5].map(|share| pose(&|_| share)).into();
        starts.push(home);
        // multiples of the golden ratio are evenly distributed
        starts.extend((1..=SPREAD).map(|k| pose(&|i| ((i + 1) as f64 * k as f64 * 0.618_034).fract())));
        search::largest(starts, &axes, |at| value(self, at))
    }

    /// Returns the shape of the weight or inertia over the position of a joint.
    fn shape(&self, of: Of, joint: usize) -> Shape {
        let follow = self.model.bodies().iter().filter(|body| body.joint.coordinate.index() == joint).count();
        let has_spring = joint == self.joint && self.joint().dynamics.stiffness != 0.0;
        match self.model.joint(joint).kind {
            _ if follow != 1 || of == Of::Weight && has_spring => Shape::Unknown,
            JointKind::Revolute | JointKind::Continuous => Shape::Turning,
            JointKind::Prismatic => Shape::Sliding,
        }
    }
}

/// Quantity to maximise.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Of {
    Weight,
    Inertia,
}

/// Returns the joints that a joint carries, including itself. With `above`, also includes the joints between
/// the base and the carried bodies.
fn related(model: &Model, joint: usize, above: bool) -> Vec<usize> {
    let bodies = model.bodies();
    // parents precede children
    let (mut carried, mut related) = (vec![false; bodies.len()], vec![false; model.joint_count()]);
    for (i, body) in bodies.iter().enumerate() {
        let of = body.joint.coordinate.index();
        carried[i] = of == joint || body.parent.is_some_and(|parent| carried[parent]);
        related[of] |= carried[i];
        let mut parent = (above && of == joint).then_some(body.parent).flatten();
        while let Some(below) = parent {
            related[bodies[below].joint.coordinate.index()] = true;
            parent = bodies[below].parent;
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

    /// Robot with these joints, each given with its parent link. Links of 1 kg extend along x, and joints
    /// rotate about y by up to 2 rad.
    fn robot(joints: &[(&str, &str)]) -> Model {
        bent_robot(joints, |_| 0.0)
    }

    /// Robot whose joints are rotated by an angle at position zero.
    fn bent_robot(joints: &[(&str, &str)], bend: fn(usize) -> f64) -> Model {
        let mut text = String::from("<robot name=\"chain\"><link name=\"base\"/>");
        for (i, (name, parent)) in joints.iter().enumerate() {
            let bend = bend(i);
            text += &format!(
                "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{name}\"/><origin xyz=\"0.1 0 0\" rpy=\"0 {bend} 0\"/>\
                 <axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" velocity=\"1\" effort=\"1\"/></joint><link name=\"{name}\"><inertial>\
                 <origin xyz=\"0.1 0 0\"/><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
            );
        }
        text += "</robot>";
        parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
    }

    const TABLE: &str = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n[[drive]]\njoint = \"j3\"\nbus = \"can0\"\nprotocol = \"damiao\"\n\
                         node = 1\nwatchdog = \"20 ms\"\nranges = { position = 12.5, velocity = 30.0, torque = 8.0 }\n\
                         homing = { by = \"stop\", velocity = 0.1, effort = 0.4, position = 1.5 }\n";

    /// Chain of `count` joints, of which `j3` is homed.
    fn chain(count: usize, bend: fn(usize) -> f64) -> Equipped {
        let names: Vec<String> = (0..count).map(|i| format!("j{i}")).collect();
        let parents = std::iter::once("base").chain(names.iter().map(String::as_str));
        let joints: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(parents).collect();
        let mut loaded = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
        (loaded.model, loaded.profile) = (bent_robot(&joints, bend), None);
        Equipped { robot: loaded, table: Table::parse(TABLE).unwrap(), order: vec![0; count] }
    }

    #[test]
    fn a_search_is_bounded_and_handles_a_constant() {
        let equipped = chain(30, |_| 0.0);
        let entry = equipped.table.drives[0].homing.clone().unwrap();
        let mut weights = Weights::new(&equipped, [0.0, 0.0, -9.81], 3, &entry, &[None; 30]);
        let mut values = |others, place| {
            COUNT.set(0);
            weights.largest(Of::Weight, others, place, counted);
            COUNT.get()
        };
        assert_eq!(values(Others::AtHome, Some(1.5)), 1);
        let (starts, most) = (4 + SPREAD, |axes| {
            (4 + SPREAD) * (1 + search::ROUNDS * (axes * search::VALUES + search::FURTHER))
        });
        let alone = values(Others::AtHome, None);
        assert!((starts..=most(1)).contains(&alone), "{alone}");
        let all = values(Others::Anywhere, None);
        assert!((starts * 30..=most(30)).contains(&all), "{all}");
    }

    #[test]
    fn bounds_of_any_chain_are_reached_fully_extended() {
        for count in [4, 8, 12, 16, 24] {
            // the robot is fully extended at positions other than zero, the middle or an end of a range
            let equipped = chain(count, |i| 0.37 + 0.9 * (1.7 * i as f64).sin());
            let entry = equipped.table.drives[0].homing.clone().unwrap();
            let others = vec![None; count];
            let mut weights = Weights::new(&equipped, [0.0, 0.0, -9.81], 3, &entry, &others);
            // centres of mass at 0.1 m, 0.2 m, ... from the joint
            let lengths = || (1..=count - 3).map(|i| 0.1 * i as f64);
            let heaviest = 9.81 * lengths().sum::<f64>();
            let inertia = lengths().map(|length| 1.0 + length * length).sum::<f64>();
            let close = |found: f64, expected: f64| (found - expected).abs() < 1e-4 * expected;
            let found = [weights.on_the_way(Others::Anywhere), weights.helping(), weights.inertia_at_stop()];
            let expected = [heaviest, heaviest, inertia];
            assert!(
                found.iter().zip(expected).all(|(found, expected)| close(*found, expected)),
                "{count} joints: {found:?} instead of {expected:?}"
            );
        }
    }

    #[test]
    fn a_joint_depends_only_on_its_own_chain() {
        let model = robot(&[("a1", "base"), ("a2", "a1"), ("b1", "a1"), ("b2", "b1"), ("c1", "base")]);
        let of = |name: &str| {
            let joint = model.joint_index(name).unwrap();
            related(&model, joint, true)
                .into_iter()
                .map(|i| model.joint_names()[i].as_str())
                .collect::<Vec<_>>()
        };
        let sorted = |name: &str| {
            let mut names = of(name);
            names.sort_unstable();
            names
        };
        assert_eq!(sorted("a1"), ["a1", "a2", "b1", "b2"]);
        assert_eq!(sorted("b1"), ["a1", "b1", "b2"]);
        assert_eq!(sorted("c1"), ["c1"]);
        let carried = related(&model, model.joint_index("b1").unwrap(), false);
        assert_eq!(carried.len(), 2, "b1 and b2: {carried:?}");
    }
}
