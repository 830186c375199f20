//! Orientation of a pose that is published from outside.

use anyhow::{bail, ensure};
use motorium::plan::TopicPlan;
use motorium::session::TopicReader;
use motorium::state::{PoseTarget, StateBuffer as _, from_bytes};

/// Range of quaternion norms accepted by readers of poses.
const LENGTHS: core::ops::Range<f64> = 0.5..2.0;

/// Completes an encoded value of `topic`: a pose without an orientation keeps the orientation of the newest
/// value. Values of other types stay as they are.
///
/// # Errors
/// If the topic has no value with an orientation yet, or the orientation is not a unit quaternion.
pub(super) fn complete(topic: &TopicPlan, bytes: &mut [u8], newest: &mut TopicReader) -> anyhow::Result<()> {
    if topic.layout.type_name != PoseTarget::NAME {
        return Ok(());
    }
    let Some(pose) = from_bytes::<PoseTarget>(bytes) else { return Ok(()) };
    let length = pose.orientation.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length > 0.0 {
        ensure!(
            LENGTHS.contains(&length),
            "`orientation` has the length {length:.3}, expected 1; the order is x y z w"
        );
        return Ok(());
    }
    newest.poll();
    let Some(before) = newest.value::<PoseTarget>()? else {
        bail!(
            "`orientation` is missing, and `{}` has no value yet whose orientation could be kept\nhelp: add \
             'orientation=[x, y, z, w]'",
            topic.name
        );
    };
    let Some(field) = topic.layout.fields.iter().find(|field| field.name == "orientation") else {
        return Ok(());
    };
    let parts = bytes[field.offset..field.offset + field.size].chunks_exact_mut(size_of::<f64>());
    parts.zip(before.orientation).for_each(|(part, number)| part.copy_from_slice(&number.to_ne_bytes()));
    Ok(())
}
