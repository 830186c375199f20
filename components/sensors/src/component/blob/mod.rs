//! `estimator.blob`: position of a coloured object in camera images.

mod config;
mod history;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::ImageInfo;
use motorium::transport::SliceInput;
use nalgebra::Vector3;

use super::robot::{Needs, TrueMotion};
use crate::blob::{Blob, Hue, PointFilter};
use crate::pinhole::Pinhole;
pub use config::BlobConfig;
use history::PoseHistory;

/// Capacity of the image queue.
const PICTURES: usize = 2;

/// A component that detects a coloured object in each image and publishes the object's position in the world.
/// The component publishes at its own rate.
///
/// Images arrive with a delay, so the camera pose at the time of exposure is used. The published position is
/// extrapolated to the time of the step with the estimated velocity.
pub struct BlobEstimator {
    motion: TrueMotion,
    history: PoseHistory,
    image: SliceInput<u8>,
    info: Input<ImageInfo>,
    target: Output<PoseTarget>,
    config: BlobConfig,
    hue: Hue,
    filter: PointFilter,
    clock: RunClock,
    counts: Counts,
}

/// Statistics of the detections.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    pictures: u64,
    seen: u64,
    /// Images whose exposure time precedes the known camera poses.
    unplaced: u64,
    /// Distances from the optical axis \[pixels\]: in the last image, and since the object has settled in the
    /// centre.
    last: Option<f64>,
    sum: f64,
    worst: f64,
    scored: u64,
    distance: Option<f64>,
    /// Time of the first image, ns.
    since: Option<u64>,
}

impl Component for BlobEstimator {
    const KIND: &'static str = "estimator.blob";
    const SUMMARY: &'static str = "position of a coloured object in camera images";
    const RESETS: bool = true;
    type Config = BlobConfig;

    fn declare(config: &BlobConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        config.check()?;
        TrueMotion::declare(&config.camera, Needs::Measured, declare)?;
        let doc = "images: red, green and blue, one byte each";
        declare.slice_input::<u8>("image", PICTURES, doc);
        declare.input::<ImageInfo>("info", "format of the images");
        declare.output::<PoseTarget>("target", "position and velocity of the object in the world");
        Ok(())
    }

    fn configure(config: BlobConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let hue = config.check()?;
        Ok(Self {
            motion: TrueMotion::open(&config.camera, Needs::Measured, setup)?,
            history: PoseHistory::new(config.history.into(), setup.period()),
            image: setup.slice_input("image")?,
            info: setup.input("info")?,
            target: setup.output("target")?,
            hue,
            filter: PointFilter::new(config.smoothing),
            clock: setup.clock(),
            counts: Counts::default(),
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Self { motion, history, image, info, config, hue, filter, counts, .. } = self;
        if !motion.is_still()
            && let Some(motion) = motion.newest()?
        {
            history.push(motion.times.source, motion.pose);
        }
        let still = motion.is_still().then(|| motion.pose());
        let longest = config.lost_after.ns as f64 * 1e-9;
        while let Some((stamp, pixels)) = image.next_unread() {
            let Some(info) = info.latest() else { continue };
            if info.encoding != ImageInfo::RGB_8 || info.focal_length.iter().any(|length| *length <= 0.0) {
                return Err(StepError::failed(
                    "the format of the images is not supported, expected red, green and blue with a known focal length",
                ));
            }
            counts.pictures += 1;
            let camera = Pinhole {
                width: info.width,
                height: info.height,
                focal_length: info.focal_length,
                principal_point: info.principal_point,
            };
            let blob = Blob::find(hue, &camera, pixels, info.stride as usize, config.least_pixels);
            let Some(blob) = blob else { continue };
            counts.seen += 1;
            counts.score(&blob, &camera, tick.time_ns, config.settle.ns);
            let Some(pose) = still.or_else(|| history.pose_at(stamp.source_time)) else {
                counts.unplaced += 1;
                continue;
            };
            let distance = match config.radius {
                Some(radius) if !blob.on_edge => blob.distance_of_sphere(radius),
                // the object is cut off, or its size is unknown
                _ => counts.distance.filter(|_| config.radius.is_some()).unwrap_or(config.distance),
            };
            counts.distance = Some(distance);
            let place = pose * nalgebra::Point3::from(blob.direction.scale(distance));
            filter.correct(stamp.source_time, &place.coords, longest);
        }
        let now = self.clock.stamp_ns(tick.time_ns);
        self.publish(now)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.motion.reset();
        self.history.clear();
        self.filter.reset();
        self.counts = Counts::default();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Counts { pictures, seen, unplaced, last, sum, worst, scored, distance, .. } = self.counts;
        Some(serde_json::json!({
            "pictures": pictures,
            "seen": seen,
            "unplaced": unplaced,
            "distance_m": distance,
            "error_px": last,
            "mean_error_px": (scored > 0).then(|| sum / scored as f64),
            "worst_error_px": (scored > 0).then_some(worst),
        }))
    }
}

impl BlobEstimator {
    /// Publishes the current position of the object, unless it was last seen too long ago.
    fn publish(&mut self, now: u64) -> Result<(), StepError> {
        let seen =
            self.filter.last_ns().filter(|last| now.saturating_sub(*last) <= self.config.lost_after.ns);
        let Some((seen, (position, velocity))) = seen.zip(self.filter.predict(now)) else { return Ok(()) };
        let mut target = self.target.loan()?;
        *target = PoseTarget {
            position: position.into(),
            orientation: [0.0, 0.0, 0.0, 1.0],
            linear_velocity: velocity.into(),
            ..PoseTarget::default()
        };
        target.publish_from(seen)
    }
}

impl Counts {
    /// Scores the distance of the detection from the optical axis.
    fn score(&mut self, blob: &Blob, camera: &Pinhole, now: u64, settle_ns: u64) {
        let since = *self.since.get_or_insert(now);
        let Some([column, row]) = camera.project(&Vector3::from(*blob.direction)) else { return };
        let [x, y] = camera.principal_point;
        let error = (column - x).hypot(row - y);
        self.last = Some(error);
        if now.saturating_sub(since) >= settle_ns {
            self.sum += error;
            self.worst = self.worst.max(error);
            self.scored += 1;
        }
    }
}
