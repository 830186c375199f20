//! Combination of models: robots with tools or payloads, and several robots in one world.

use std::collections::HashSet;

use nalgebra::Isometry3;

use super::{Base, Body, Coordinate, Frame, FrameId, Geometry, Inertia, Model, Shape, weld};

/// A robot and its placement in a world.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// Model of the robot. Its base must be fixed.
    pub model: &'a Model,
    /// Prefix of the names of the robot's links and joints in the world, such as `left/`.
    pub prefix: &'a str,
    /// Pose of the robot's root frame in the world.
    pub placement: Isometry3<f64>,
}

/// Error of combining models.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AttachError {
    /// The tool with this name has a floating base.
    #[error("\"{0}\" has a floating base and cannot be attached to anything; load it with its base fixed")]
    Floating(String),
    /// The frame with this name is fixed to the world next to a floating base.
    #[error(
        "frame \"{0}\" is fixed to the world next to the floating base, so moving bodies cannot be attached to it"
    )]
    InWorld(String),
    /// Both models use the same name.
    #[error("both models have a {what} named \"{name}\"; choose another prefix")]
    Name {
        /// Type of the name: `link` or `joint`.
        what: &'static str,
        /// The duplicate name.
        name: String,
    },
}

impl Model {
    /// Returns the robot with `tool` (such as a gripper or an arm) fixed to `frame`. `placement` is the pose
    /// of the tool's root frame in `frame`. The names of the tool's links and joints get the `prefix`, and
    /// the tool's joints come last in `q` and `v`.
    ///
    /// # Errors
    ///
    /// [`AttachError`] if the tool's base floats, the frame is fixed to the world next to a floating base, or
    /// a name is duplicated.
    pub fn attached(
        &self,
        frame: FrameId,
        tool: &Self,
        placement: &Isometry3<f64>,
        prefix: &str,
    ) -> Result<Self, AttachError> {
        let carrier = &self.frames[frame.index()];
        if tool.base.floating {
            return Err(AttachError::Floating(tool.name.clone()));
        }
        if carrier.in_world && self.base.floating {
            return Err(AttachError::InWorld(carrier.name.clone()));
        }
        let at = carrier.placement * placement;
        let tool = tool.prefixed(prefix);
        let (mut base, mut bodies, mut frames) =
            (self.base.clone(), self.bodies.clone(), self.frames.clone());

        let shapes = tool.base.shapes.iter().map(|shape| shape.clone().moved(&at));
        weld(&mut base, &mut bodies, carrier.body, &tool.base.inertia.moved(&at), shapes);

        let (first, joints) = (bodies.len(), self.joint_count());
        bodies.extend(tool.bodies.into_iter().map(|mut body| {
            body.joint.coordinate = match body.joint.coordinate {
                Coordinate::Independent(index) => Coordinate::Independent(index + joints),
                Coordinate::Mimic { of, multiplier, offset } => {
                    Coordinate::Mimic { of: of + joints, multiplier, offset }
                }
            };
            match body.parent {
                Some(parent) => body.parent = Some(parent + first),
                None => (body.parent, body.joint.placement) = (carrier.body, at * body.joint.placement),
            }
            body
        }));
        let first_frame = frames.len();
        frames.extend(tool.frames.iter().map(|own| {
            let name = own.name.clone();
            let parent = Some(own.parent.map_or(frame.index(), |parent| parent + first_frame));
            match own.body {
                Some(body) => Frame { name, body: Some(body + first), parent, ..own.clone() },
                None => Frame {
                    name,
                    body: carrier.body,
                    in_world: false,
                    placement: at * own.placement,
                    parent,
                    inertia: own.inertia,
                },
            }
        }));
        unique("link", frames.iter().map(|frame| &*frame.name))?;
        unique("joint", bodies.iter().map(|body| &*body.joint.name))?;
        Ok(Self::new(self.name.clone(), base, bodies, frames))
    }

    /// Returns the robot with `prefix`, such as `left/`, before the names of all links and joints. This
    /// distinguishes several robots of one type.
    ///
    /// ```
    /// let robot = motorium_robots::load("pendulum", std::path::Path::new("."))?.model;
    /// assert_eq!(robot.prefixed("left/").joint_names()[0], format!("left/{}", robot.joint_names()[0]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prefixed(&self, prefix: &str) -> Self {
        let named = |name: &str| format!("{prefix}{name}");
        let renamed = |shape: &Shape| Shape { link: named(&shape.link), ..shape.clone() };
        let mut base = self.base.clone();
        base.shapes = base.shapes.iter().map(renamed).collect();
        base.world_shapes = base.world_shapes.iter().map(renamed).collect();
        let bodies = self.bodies.iter().map(|body| {
            let mut body = Body { name: named(&body.name), ..body.clone() };
            body.joint.name = named(&body.joint.name);
            body.shapes = body.shapes.iter().map(renamed).collect();
            body
        });
        let frames = self.frames.iter().map(|frame| Frame { name: named(&frame.name), ..frame.clone() });
        Self::new(self.name.clone(), base, bodies.collect(), frames.collect())
    }

    /// Returns the robot with a payload fixed to `frame`. `inertia` and `shapes` are in the axes and about
    /// the origin of `frame`. The result has a new frame called `name`, which coincides with `frame`.
    ///
    /// # Errors
    ///
    /// [`AttachError`] if the frame is fixed to the world next to a floating base, or the name exists
    /// already.
    pub fn carrying(
        &self,
        frame: FrameId,
        name: &str,
        inertia: Inertia,
        shapes: &[(Isometry3<f64>, Geometry)],
    ) -> Result<Self, AttachError> {
        let shapes = shapes
            .iter()
            .map(|(placement, geometry)| Shape {
                link: name.to_owned(),
                placement: *placement,
                geometry: geometry.clone(),
            })
            .collect();
        let mut payload = Self::of_frame(name, name);
        (payload.base.inertia, payload.frames[0].inertia) = (inertia, inertia);
        payload.base.shapes = shapes;
        self.attached(frame, &payload, &Isometry3::identity(), "")
    }

    /// Combines several robots in one world into one model. `q` and `v` are the robots' vectors, concatenated
    /// in order. The first frame is `world`.
    ///
    /// # Errors
    ///
    /// [`AttachError`] if a base floats or a prefixed name is duplicated.
    pub fn world(name: &str, robots: &[Placed<'_>]) -> Result<Self, AttachError> {
        let mut world = Self::of_frame(name, "world");
        for robot in robots {
            world = world.attached(FrameId(0), robot.model, &robot.placement, robot.prefix)?;
        }
        Ok(world)
    }

    /// Returns the robot with its root frame at `pose` in the world. A floating base has this pose in the
    /// neutral configuration. With a fixed base, all frames that are fixed to the world move with the root
    /// frame.
    ///
    /// ```
    /// use motorium_robots::{Kinematics, load};
    /// use nalgebra::Isometry3;
    ///
    /// let here = load("planar-3r", std::path::Path::new("."))?.model;
    /// let there = here.placed(&Isometry3::translation(0.5, 0.0, 0.2));
    /// let tip = here.frame(&here.frames().last().unwrap().name)?;
    /// let poses = [&here, &there].map(|model| {
    ///     let mut kinematics = Kinematics::new(model);
    ///     kinematics.update(model, &model.neutral());
    ///     kinematics.pose(model, tip).translation.vector
    /// });
    /// assert!((poses[1] - poses[0] - nalgebra::Vector3::new(0.5, 0.0, 0.2)).norm() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn placed(&self, pose: &Isometry3<f64>) -> Self {
        let (mut base, mut bodies, mut frames) =
            (self.base.clone(), self.bodies.clone(), self.frames.clone());
        if base.floating {
            base.neutral = *pose;
            return Self::new(self.name.clone(), base, bodies, frames);
        }
        base.inertia = base.inertia.moved(pose);
        base.shapes = base.shapes.into_iter().map(|shape| shape.moved(pose)).collect();
        for body in bodies.iter_mut().filter(|body| body.parent.is_none()) {
            body.joint.placement = pose * body.joint.placement;
        }
        for frame in frames.iter_mut().filter(|frame| frame.body.is_none()) {
            frame.placement = pose * frame.placement;
        }
        Self::new(self.name.clone(), base, bodies, frames)
    }

    /// Creates a model with one frame and no bodies.
    fn of_frame(name: &str, frame: &str) -> Self {
        let base = Base {
            floating: false,
            neutral: Isometry3::identity(),
            inertia: Inertia::zero(),
            shapes: Vec::new(),
            world_shapes: Vec::new(),
        };
        let frame = Frame {
            name: frame.to_owned(),
            body: None,
            in_world: false,
            placement: Isometry3::identity(),
            parent: None,
            inertia: Inertia::zero(),
        };
        Self::new(name.to_owned(), base, Vec::new(), vec![frame])
    }
}

fn unique<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), AttachError> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(AttachError::Name { what, name: name.to_owned() });
        }
    }
    Ok(())
}
