//! Positions that a distribution over movements is conditioned on.

use crate::mean::MeanMovement;
use crate::rollout::{Override, RolloutError, ViaPoint, places};

/// Maximum error of the mean at a conditioned position, in standard deviations.
const MISSED: f64 = 3.0;

/// Checks that a mean passes the positions it was conditioned on.
pub(crate) fn met(mean: &mut impl MeanMovement, overrides: &Override) -> Result<(), RolloutError> {
    let (mut reached, mut slope) = (vec![0.0; mean.dimensions()], vec![0.0; mean.dimensions()]);
    for ViaPoint { phase, position, deviation } in places(overrides) {
        mean.mean_into(phase, &mut reached, &mut slope);
        for (dimension, (reached, wanted)) in reached.iter().zip(position).enumerate() {
            let missed = (reached - wanted).abs();
            if missed.is_nan() || missed > MISSED * deviation {
                return Err(RolloutError::Unmet { phase, dimension, reached: *reached, wanted, deviation });
            }
        }
    }
    Ok(())
}
