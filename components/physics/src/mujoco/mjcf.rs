//! The robot and its world in MuJoCo's text format, MJCF.
//!
//! Names are numbered: `c3` is the geometry of collider 3, `j2` the joint of body 2, `o1` body and joint of
//! object 1, `base` the free joint of a floating base. Only pairs of colliders that may touch are written,
//! each with its own surface law; other geometries do not touch.

use std::fmt::Write as _;

use motorium_robots::{Body, ConvexShape, Coordinate, Inertia, JointKind};
use motorium_worlds::{FrictionCombine, ObjectMass};
use nalgebra::{Isometry3, Vector3};

use super::contact;
use crate::World;
use crate::contact::{Collider, Colliders, Owner};
use crate::robot::Robot;
use crate::shapes::rapier_shape;

/// Law of joint friction: with time constant and impedance at MuJoCo's bounds, a joint sticks.
const FRICTION: &str = r#"solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001""#;

/// Law of joint stops: a joint that reaches a stop halts within two milliseconds. A joint beyond its stop
/// returns by a 20th of the distance per millisecond, without an impact.
const STOP: &str = r#"solreflimit="0.002 3.5" solimplimit="0.9999 0.9999 0.001""#;

/// Law of mimic joints.
const COUPLING: &str = r#"solref="0.002 1" solimp="0.9999 0.9999 0.001""#;

/// Distance within which contact points are listed before they transmit a force \[m\].
pub(super) const NEAR: f64 = 0.010;

/// Step length written into the model \[s\]. Every step sets its own length; this one is read back to check
/// the layout.
pub(super) const TIMESTEP: f64 = 0.00390625;

/// Depth of the ground below the lowest point of a terrain \[m\].
const BASE: f64 = 1.0;

/// Height of a level terrain in the MuJoCo model \[m\].
const LEVEL: f64 = 1e-3;

/// Position that no joint reaches \[rad or m\]: the open end of a range with one limit.
const NO_LIMIT: f64 = 1e6;

/// Returns `true` for a shape that MuJoCo accepts, which excludes hulls without volume.
pub(super) fn is_usable(shape: &ConvexShape) -> bool {
    !matches!(shape, ConvexShape::Hull { .. }) || rapier_shape(shape).is_some()
}

/// Returns the text of the model. The collision model provides the pairs of colliders.
pub(super) fn write(robot: &Robot, world: &World, colliders: &Colliders) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = Writer { text: &mut text, robot, world, colliders }.document();
    text
}

/// Writes one document.
struct Writer<'a> {
    text: &'a mut String,
    robot: &'a Robot,
    world: &'a World,
    colliders: &'a Colliders,
}

impl Writer<'_> {
    fn document(&mut self) -> std::fmt::Result {
        let megabytes = 16 + self.world.objects.len() / 4;
        writeln!(
            self.text,
            r#"<mujoco><compiler angle="radian" autolimits="false" inertiafromgeom="false" balanceinertia="false"/>
<option timestep="{TIMESTEP}" integrator="Euler" cone="elliptic" solver="Newton" iterations="100" tolerance="1e-10" impratio="10">
<flag autoreset="disable"/></option><size memory="{megabytes}M"/>"#
        )?;
        self.assets()?;
        writeln!(self.text, "<worldbody>")?;
        self.geometries(Owner::World)?;
        for (of, own) in self.robot.articulations.iter().enumerate() {
            let base = own.model.base();
            if base.floating {
                let name = base_joint(of);
                writeln!(self.text, r#"<body {}><freejoint name="{name}"/>"#, pose(&base.neutral))?;
                self.inertial(&base.inertia)?;
                self.geometries(Owner::Base(of))?;
            }
            self.bodies(of, None)?;
            if base.floating {
                writeln!(self.text, "</body>")?;
            }
        }
        self.objects()?;
        writeln!(self.text, "</worldbody>")?;
        self.couplings()?;
        self.pairs()?;
        writeln!(self.text, "</mujoco>")
    }

    /// Writes the points of hulls and the heights of the terrain.
    fn assets(&mut self) -> std::fmt::Result {
        writeln!(self.text, "<asset>")?;
        for (index, collider) in self.colliders.colliders.iter().enumerate() {
            if let ConvexShape::Hull { points } = &collider.shape
                && is_usable(&collider.shape)
            {
                let points = numbers(points.iter().flat_map(|point| [point.x, point.y, point.z]));
                writeln!(self.text, r#"<mesh name="m{index}" inertia="convex" vertex="{points}"/>"#)?;
            }
        }
        if let Some(field) = &self.colliders.terrain {
            let ([x, y], [columns, rows]) = field.grid();
            let (spacing, (low, high)) = (field.spacing(), field.range());
            let half = [columns, rows].map(|count| 0.5 * spacing * (count - 1) as f64);
            write!(
                self.text,
                r#"<hfield name="terrain" nrow="{rows}" ncol="{columns}" size="{} {} {} {BASE}" elevation=""#,
                half[0],
                half[1],
                (high - low).max(LEVEL)
            )?;
            // As on a map, the row with the largest y comes first.
            for row in (0..rows).rev() {
                for column in 0..columns {
                    let place = [x + spacing * column as f64, y + spacing * row as f64];
                    write!(self.text, "{} ", field.height(place[0], place[1]))?;
                }
            }
            writeln!(self.text, r#""/>"#)?;
        }
        writeln!(self.text, "</asset>")
    }

    /// Writes the geometries of a part of the robot, or of the world without its objects.
    fn geometries(&mut self, owner: Owner) -> std::fmt::Result {
        let Colliders { colliders, first_object, objects, .. } = self.colliders;
        let objects = *first_object..objects.last().map_or(*first_object, |last| last.end);
        for (index, collider) in colliders.iter().enumerate() {
            if self.terrain() == Some(index) && owner == Owner::World {
                self.terrain_geometry(index)?;
            } else if collider.owner == owner && !objects.contains(&index) {
                self.geometry(index, &collider.placement)?;
            }
        }
        Ok(())
    }

    /// Returns the collider of the terrain, which is the last.
    fn terrain(&self) -> Option<usize> {
        self.colliders.terrain.as_ref().map(|_| self.colliders.colliders.len() - 1)
    }

    fn terrain_geometry(&mut self, index: usize) -> std::fmt::Result {
        let Some(field) = &self.colliders.terrain else { return Ok(()) };
        let ([x, y], [columns, rows]) = field.grid();
        let half = |count: usize| 0.5 * field.spacing() * (count - 1) as f64;
        let middle = numbers([x + half(columns), y + half(rows), field.range().0]);
        writeln!(
            self.text,
            r#"<geom name="c{index}" type="hfield" hfield="terrain" pos="{middle}" contype="0" conaffinity="0"/>"#
        )
    }

    fn geometry(&mut self, index: usize, placement: &Isometry3<f64>) -> std::fmt::Result {
        let shape = &self.colliders.colliders[index].shape;
        if !is_usable(shape) {
            return Ok(());
        }
        let shape = match shape {
            ConvexShape::Sphere { radius } => format!(r#"type="sphere" size="{radius}""#),
            ConvexShape::Box { half } => {
                format!(r#"type="box" size="{}""#, numbers(half.iter().copied()))
            }
            ConvexShape::Capsule { radius, half_length } => {
                format!(r#"type="capsule" size="{radius} {half_length}""#)
            }
            ConvexShape::Cylinder { radius, half_length } => {
                format!(r#"type="cylinder" size="{radius} {half_length}""#)
            }
            ConvexShape::Hull { .. } => format!(r#"type="mesh" mesh="m{index}""#),
            ConvexShape::HalfSpace => r#"type="plane" size="0 0 1""#.to_owned(),
        };
        let pose = pose(placement);
        writeln!(self.text, r#"<geom name="c{index}" {shape} {pose} contype="0" conaffinity="0"/>"#)
    }

    /// Writes the bodies of an articulation on `parent`, with everything they carry.
    fn bodies(&mut self, of: usize, parent: Option<usize>) -> std::fmt::Result {
        let bodies = self.robot.articulations[of].model.bodies();
        for (index, body) in bodies.iter().enumerate().filter(|(_, body)| body.parent == parent) {
            writeln!(self.text, "<body {}>", pose(&body.joint.placement))?;
            self.joint((of, index), body)?;
            self.inertial(&body.inertia)?;
            self.geometries(Owner::Body(of, index))?;
            self.bodies(of, Some(index))?;
            writeln!(self.text, "</body>")?;
        }
        Ok(())
    }

    fn joint(&mut self, (of, index): (usize, usize), body: &Body) -> std::fmt::Result {
        let (joint, name) = (&body.joint, body_joint(of, index));
        let kind = if joint.kind == JointKind::Prismatic { "slide" } else { "hinge" };
        let axis = numbers(joint.axis.iter().copied());
        let armature = armature(self.robot, (of, index));
        let friction = joint.dynamics.friction;
        write!(
            self.text,
            r#"<joint name="{name}" type="{kind}" axis="{axis}" armature="{armature}" frictionloss="{friction}" {FRICTION}"#
        )?;
        if let Coordinate::Independent(column) = joint.coordinate {
            let joint = &self.robot.joints[self.robot.articulations[of].joints()][column];
            let (lower, upper) = (joint.lower, joint.upper);
            if lower.is_finite() || upper.is_finite() {
                let lower = lower.max(-NO_LIMIT);
                // MuJoCo requires a nonempty interval.
                let upper = upper.min(NO_LIMIT).max(lower + 1e-9);
                write!(self.text, r#" limited="true" range="{lower} {upper}" {STOP}"#)?;
            }
        }
        writeln!(self.text, "/>")
    }

    fn inertial(&mut self, inertia: &Inertia) -> std::fmt::Result {
        let Inertia { mass, com, rotational: i } = inertia;
        let com = numbers(com.iter().copied());
        let full = numbers([i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]]);
        writeln!(self.text, r#"<inertial pos="{com}" mass="{mass}" fullinertia="{full}"/>"#)
    }

    /// Writes the objects: objects with a mass are movable, the others are fixed at their poses.
    fn objects(&mut self) -> std::fmt::Result {
        let world = self.world;
        for (index, object) in world.objects.iter().enumerate() {
            let pose = pose(&object.pose());
            match object.mass_properties() {
                Some(ObjectMass { mass, frame, moments }) => {
                    let moments = numbers(moments.iter().copied());
                    let place = self::pose(&frame.unwrap_or_else(Isometry3::identity));
                    writeln!(
                        self.text,
                        r#"<body name="o{index}" {pose}><freejoint name="o{index}"/>
<inertial {place} mass="{mass}" diaginertia="{moments}"/>"#
                    )?;
                }
                None => writeln!(self.text, r#"<body name="o{index}" mocap="true" {pose}>"#)?,
            }
            for collider in self.colliders.objects[index].clone() {
                let part = self.colliders.colliders[collider].part;
                self.geometry(collider, &part.map_or_else(Isometry3::identity, |(_, frame)| frame))?;
            }
            writeln!(self.text, "</body>")?;
        }
        Ok(())
    }

    /// Writes mimic joints.
    fn couplings(&mut self) -> std::fmt::Result {
        writeln!(self.text, "<equality>")?;
        for (of, own) in self.robot.articulations.iter().enumerate() {
            for (index, body) in own.model.bodies().iter().enumerate() {
                let Coordinate::Mimic { of: leader, multiplier, offset } = body.joint.coordinate else {
                    continue;
                };
                let (name, leader) = (body_joint(of, index), body_joint(of, own.model.joint_body(leader)));
                writeln!(
                    self.text,
                    r#"<joint joint1="{name}" joint2="{leader}" polycoef="{offset} {multiplier} 0 0 0" {COUPLING}/>"#
                )?;
            }
        }
        writeln!(self.text, "</equality>")
    }

    /// Writes the pairs of colliders that may touch.
    fn pairs(&mut self) -> std::fmt::Result {
        writeln!(self.text, "<contact>")?;
        let all = &self.colliders.colliders;
        let terrain = self.terrain().into_iter().flat_map(|terrain| {
            let moving = (0..terrain).filter(move |index| all[*index].owner != Owner::World);
            moving.map(move |index| [index, terrain])
        });
        for [a, b] in self.colliders.model.pairs().iter().copied().chain(terrain) {
            let (first, second) = (&all[a], &all[b]);
            if !is_usable(&first.shape) || !is_usable(&second.shape) {
                continue;
            }
            let half = |of: fn(&Collider) -> f64| 0.5 * (of(first) + of(second));
            let friction = FrictionCombine::combined(
                (first.friction, first.friction_combine),
                (second.friction, second.friction_combine),
            );
            let lengths = |of: fn(&Collider) -> f64| {
                let [one, other] = [first, second].map(|collider| (of(collider), collider.friction_combine));
                FrictionCombine::combined_lengths(one, other)
            };
            let torsional = lengths(|collider| collider.torsional);
            let rolling = lengths(|collider| collider.rolling);
            let [time, damping] = contact::reference(half(|collider| collider.restitution));
            let dimensions = match () {
                () if rolling > 0.0 => 6,
                () if torsional > 0.0 => 4,
                () if friction > 0.0 => 3,
                () => 1,
            };
            writeln!(
                self.text,
                r#"<pair geom1="c{a}" geom2="c{b}" condim="{dimensions}" friction="{friction} {friction} {torsional} {rolling} {rolling}" gap="{NEAR}" solref="{time} {damping}" solimp="{}"/>"#,
                contact::IMPEDANCE
            )?;
        }
        writeln!(self.text, "</contact>")
    }
}

/// Returns the name of an articulation's free joint.
pub(super) fn base_joint(of: usize) -> String {
    format!("b{of}")
}

/// Returns the name of the joint of an articulation's body.
pub(super) fn body_joint(of: usize, body: usize) -> String {
    format!("j{of}_{body}")
}

/// Returns the inertia of drive and rotor on the joint of an articulation's body, without the contribution of
/// implicit drives.
pub(super) fn armature(robot: &Robot, (of, body): (usize, usize)) -> f64 {
    let own = &robot.articulations[of];
    let joint = &own.model.bodies()[body].joint;
    let added = match joint.coordinate {
        Coordinate::Independent(column) => robot.joints[own.joints()][column].armature,
        Coordinate::Mimic { .. } => 0.0,
    };
    joint.drive.armature() + added
}

/// Returns the inertia of drive and rotor on the joint of each body of each articulation.
pub(super) fn armatures(robot: &Robot) -> Vec<Vec<f64>> {
    let articulations = robot.articulations.iter().enumerate();
    articulations
        .map(|(of, own)| (0..own.model.bodies().len()).map(|body| armature(robot, (of, body))).collect())
        .collect()
}

fn numbers(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|number| number.to_string()).collect::<Vec<_>>().join(" ")
}

fn pose(pose: &Isometry3<f64>) -> String {
    let position: Vector3<f64> = pose.translation.vector;
    let r = &pose.rotation;
    format!(r#"pos="{}" quat="{}""#, numbers(position.iter().copied()), numbers([r.w, r.i, r.j, r.k]))
}
