//! Images of cameras as inputs of a component.

use std::ops::Range;

use motorium::component::{ConfigureError, RunClock, Setup};
use motorium::declare::{Declare, StepError};
use motorium::state::ImageInfo;
use motorium::transport::{Input, SliceInput};
use motorium_models::policy::{Observation, Policy, Term};

/// Capacity of the queue of an input.
const PICTURES: usize = 2;

/// The images that a policy observes, from the topics of `sensor.depth_camera`: an input `NAME_depth` for a
/// depth image of the camera NAME, `NAME_grey` for a grey image, and `NAME_info` for their width and height.
/// Only [`open`](Self::open) allocates.
#[derive(Debug)]
pub struct ImageInputs {
    inputs: Vec<ImageInput>,
    /// The cameras of these images.
    cameras: Vec<Camera>,
    /// Pixels of all images, in the order of the observations.
    pixels: Vec<f32>,
    clock: RunClock,
}

/// A camera whose images have the size that the policy expects.
#[derive(Debug)]
struct Camera {
    name: String,
    info: Input<ImageInfo>,
    /// Columns and rows.
    pixels: [usize; 2],
}

#[derive(Debug)]
struct ImageInput {
    input: SliceInput<u8>,
    term: Term,
    /// Place among the pixels.
    place: Range<usize>,
    /// Publication time of the newest image \[ns\]; `None` before the first of the episode.
    published: Option<u64>,
}

/// Returns the input of an image and its description; `None` for other terms.
fn port(observation: &Observation) -> Option<(String, String)> {
    let name = observation.camera.as_ref()?;
    let (columns, rows) = observation.pixels.map(|[columns, rows]| (columns, rows))?;
    let what = if observation.term == Term::GreyImage { "grey" } else { "depth" };
    Some((format!("{name}_{what}"), format!("{what} images of {columns} x {rows} pixels")))
}

/// Returns the cameras of a policy, each once, with the columns and rows of their images.
fn cameras(policy: &Policy) -> impl Iterator<Item = (&str, [usize; 2])> {
    let observations = &policy.observations;
    observations.iter().enumerate().filter_map(|(index, observation)| {
        let name = observation.camera.as_deref()?;
        let is_first = observations[..index].iter().all(|other| other.camera.as_deref() != Some(name));
        observation.pixels.filter(|_| is_first).map(|pixels| (name, pixels))
    })
}

/// Returns the name of the input with the format of a camera's images.
fn info_port(camera: &str) -> String {
    format!("{camera}_info")
}

impl ImageInputs {
    /// Declares the inputs for the images that a policy observes.
    pub fn declare(policy: &Policy, declare: &mut Declare) {
        for (port, doc) in policy.observations.iter().filter_map(port) {
            declare.slice_input::<u8>(&port, PICTURES, &doc);
        }
        for (camera, _) in cameras(policy) {
            let doc = format!("format of the images of `{camera}`");
            declare.input::<ImageInfo>(&info_port(camera), &doc);
        }
    }

    /// Opens the inputs.
    ///
    /// # Errors
    ///
    /// [`ConfigureError`] if an input cannot be opened.
    pub fn open(policy: &Policy, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (mut inputs, mut first) = (Vec::new(), 0);
        for observation in &policy.observations {
            let Some((port, _)) = port(observation) else { continue };
            let place = first..first + policy.width(observation);
            first = place.end;
            let input = setup.slice_input(&port)?;
            inputs.push(ImageInput { input, term: observation.term, place, published: None });
        }
        let cameras = cameras(policy).map(|(name, pixels)| {
            let info = setup.input(&info_port(name))?;
            Ok(Camera { name: name.to_owned(), info, pixels })
        });
        let cameras = cameras.collect::<Result<_, ConfigureError>>()?;
        Ok(Self { inputs, cameras, pixels: vec![0.0; first], clock: setup.clock() })
    }

    /// Reads all new images. Returns `false` if an image or its format is missing, or if an image was
    /// published more than `longest` \[ns\] ago.
    ///
    /// # Errors
    ///
    /// [`StepError`] if the width, the height or the number of pixels of an image differs from what the
    /// policy expects.
    pub fn read(&mut self, longest: u64) -> Result<bool, StepError> {
        let now = self.clock.now_ns();
        let mut are_fresh = true;
        for ImageInput { input, term, place, published } in &mut self.inputs {
            let pixels = &mut self.pixels[place.clone()];
            while let Some((stamp, bytes)) = input.next_unread() {
                *published = Some(stamp.publish_time);
                let size = if *term == Term::GreyImage { 1 } else { size_of::<f32>() };
                if bytes.len() != pixels.len() * size {
                    let (expected, found) = (pixels.len(), bytes.len() / size);
                    return Err(StepError::failed(format!(
                        "image: expected {expected} pixels as in the policy, found {found}"
                    )));
                }
                if *term == Term::GreyImage {
                    pixels.iter_mut().zip(bytes).for_each(|(pixel, level)| *pixel = f32::from(*level));
                } else {
                    let depths = bytes.chunks_exact(size_of::<f32>());
                    let depths = depths.map(|bytes| bytes.try_into().map_or(0.0, f32::from_ne_bytes));
                    pixels.iter_mut().zip(depths).for_each(|(pixel, depth)| *pixel = depth);
                }
            }
            are_fresh &= published.is_some_and(|time| now.saturating_sub(time) <= longest);
        }
        for Camera { name, info, pixels: [columns, rows] } in &mut self.cameras {
            let Some(info) = info.latest() else {
                are_fresh = false;
                continue;
            };
            let (width, height) = (info.width, info.height);
            if [width as usize, height as usize] != [*columns, *rows] {
                return Err(StepError::failed(format!(
                    "image of `{name}`: {width} x {height} pixels, expected {columns} x {rows} as in the policy; \
                     help: set `width` and `height` of the camera as in training"
                )));
            }
        }
        Ok(are_fresh)
    }

    /// Returns the pixels of the newest images, in the order of the observations. Pixels are depths \[m\],
    /// where 0 means no depth, or grey levels, 0 to 255.
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }

    /// Forgets all images. Call this at the start of an episode.
    pub fn reset(&mut self) {
        self.inputs.iter_mut().for_each(|image| image.published = None);
    }
}
