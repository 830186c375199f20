//! Images of cameras as inputs of a component.

use std::ops::Range;

use motorium::component::{ConfigureError, RunClock, Setup};
use motorium::declare::{Declare, StepError};
use motorium::transport::SliceInput;
use motorium_models::policy::{Observation, Policy, Term};

/// Capacity of the queue of an input.
const PICTURES: usize = 2;

/// The images that a policy observes, from the topics of `sensor.depth_camera`: an input `NAME_depth` for a
/// depth image of the camera NAME, and `NAME_grey` for a grey image. Only [`open`](Self::open) allocates.
#[derive(Debug)]
pub struct ImageInputs {
    inputs: Vec<ImageInput>,
    /// Pixels of all images, in the order of the observations.
    pixels: Vec<f32>,
    clock: RunClock,
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

impl ImageInputs {
    /// Declares the inputs for the images that a policy observes.
    pub fn declare(policy: &Policy, declare: &mut Declare) {
        for (port, doc) in policy.observations.iter().filter_map(port) {
            declare.slice_input::<u8>(&port, PICTURES, &doc);
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
        Ok(Self { inputs, pixels: vec![0.0; first], clock: setup.clock() })
    }

    /// Reads all new images. Returns `false` if an image is missing, or was published more than `longest`
    /// \[ns\] ago.
    ///
    /// # Errors
    ///
    /// [`StepError`] if the number of pixels of an image differs from the number that the policy expects.
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
