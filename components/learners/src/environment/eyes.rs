//! The cameras of a world: images of the simulated robot and its surroundings.

use motorium_models::policy::Term;
use motorium_physics::{Engine, ObjectId, Simulation, Simulator as _};
use motorium_robots::{FrameId, Kinematics};
use motorium_sensors::component::rays::{DepthCamera, DepthCameraConfig, RangeSensor as _};
use motorium_sensors::scenery::{Scenery, solids};
use nalgebra::Isometry3;

use crate::random::{Counter, Purpose};
use crate::task::{Task, TaskError, Terms, camera};

/// A camera and its surroundings.
#[derive(Clone, Debug)]
struct Eye {
    name: String,
    config: DepthCameraConfig,
    camera: DepthCamera,
    scenery: Scenery,
    /// The link that carries the camera; `None` for the world.
    carrier: Option<FrameId>,
    mount: Isometry3<f64>,
    /// A reading: depths, then cosines.
    reading: Vec<f64>,
}

impl Eye {
    /// Returns `true` if a reading depends on a seed.
    fn is_noisy(&self) -> bool {
        self.config.lost > 0.0 || self.config.depth != Default::default()
    }
}

/// The cameras of a task in one world. [`look`](Self::look) renders the images that `sensor.depth_camera`
/// publishes in a graph, with the same code.
#[derive(Clone, Debug)]
pub(super) struct Eyes {
    eyes: Vec<Eye>,
    kinematics: Kinematics,
    /// The camera and the quantity of each image that the task observes.
    observed: Vec<(usize, Term)>,
    /// Objects that move, by their index in the world.
    objects: Vec<(usize, ObjectId)>,
    /// Pixels of all observed images.
    images: Vec<f32>,
    /// Time between two images \[s\].
    period: f64,
    is_first: bool,
}

impl Eyes {
    /// Creates the cameras of a task; `None` if it observes no image.
    pub(super) fn new<E: Engine>(
        task: &Task,
        terms: &Terms,
        simulation: &Simulation<E>,
    ) -> Result<Option<Self>, TaskError> {
        if task.cameras.is_empty() {
            return Ok(None);
        }
        let (model, world) = (simulation.model(), simulation.world());
        let eyes = task.cameras.iter().map(|(name, config)| {
            let invalid = |part: Option<String>, message: String| {
                let part = part.unwrap_or_else(|| "mount".to_owned());
                TaskError::Setting { key: format!("cameras.{name}.{part}"), message }
            };
            let camera = camera(name, config, 0)?;
            let solids = config.sees_robot.then(|| solids(model));
            Ok(Eye {
                name: name.clone(),
                config: config.clone(),
                reading: vec![0.0; camera.width()],
                camera,
                scenery: Scenery::new(model, solids.as_ref(), world),
                carrier: config.mount.carrier(model).map_err(|error| invalid(error.key, error.message))?,
                mount: config.mount.pose().map_err(|error| invalid(error.key, error.message))?,
            })
        });
        let eyes = eyes.collect::<Result<Vec<Eye>, TaskError>>()?;
        let images = terms.policy().observations.iter().filter(|observation| observation.term.is_image());
        let observed = images.filter_map(|observation| {
            let name = observation.camera.as_ref()?;
            eyes.iter().position(|eye| eye.name == *name).map(|index| (index, observation.term))
        });
        let objects = world.objects.iter().enumerate().filter(|(_, object)| object.is_dynamic());
        Ok(Some(Self {
            observed: observed.collect(),
            objects: objects
                .filter_map(|(index, object)| Some((index, simulation.object(&object.name)?)))
                .collect(),
            kinematics: Kinematics::new(model),
            images: vec![0.0; terms.pixels()],
            period: 1.0 / task.rate(),
            is_first: true,
            eyes,
        }))
    }

    /// Starts an episode. Noise is sampled from the counter.
    pub(super) fn begin(&mut self, counter: Counter) {
        self.is_first = true;
        let noisy = self.eyes.iter_mut().enumerate().filter(|(_, eye)| eye.is_noisy());
        for (index, eye) in noisy {
            let counter = Counter { step: index as u64, ..counter };
            let seed = counter.number(Purpose::Camera);
            eye.camera = camera(&eye.name, &eye.config, seed).expect("a valid camera at every seed");
        }
    }

    /// Renders the present state and returns the pixels of all observed images.
    pub(super) fn look<E: Engine>(&mut self, simulation: &Simulation<E>) -> &[f32] {
        let dt = if std::mem::take(&mut self.is_first) { 0.0 } else { self.period };
        let model = simulation.model();
        self.kinematics.update(model, simulation.configuration());
        for eye in &mut self.eyes {
            for (index, id) in &self.objects {
                let pose = simulation.object_pose(*id);
                let [x, y, z, w] = pose.rotation.coords.into();
                eye.scenery.set_object(*index, pose.translation.vector.into(), [x, y, z, w]);
            }
            eye.scenery.place_links(model, &self.kinematics);
            let pose = match eye.carrier {
                Some(frame) => self.kinematics.pose(model, frame) * eye.mount,
                None => eye.mount,
            };
            eye.camera.read(&pose, eye.scenery.scene_mut(), dt, &mut eye.reading);
        }
        let mut rest = &mut self.images[..];
        for (index, term) in &self.observed {
            let Eye { camera, reading, .. } = &self.eyes[*index];
            let (depths, cosines) = reading.split_at(reading.len() / 2);
            let (image, behind) = rest.split_at_mut(depths.len());
            match term {
                Term::GreyImage => {
                    let levels = cosines.iter().map(|cosine| f32::from(DepthCamera::grey(*cosine)));
                    image.iter_mut().zip(levels).for_each(|(pixel, level)| *pixel = level);
                }
                _ => {
                    let depths = depths.iter().map(|depth| camera.depth(*depth));
                    image.iter_mut().zip(depths).for_each(|(pixel, depth)| *pixel = depth);
                }
            }
            rest = behind;
        }
        &self.images
    }
}
