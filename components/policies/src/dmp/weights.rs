//! Primitives whose weights arrive while the policy runs.

use motorium::component::{ConfigureError, Declare, Setup, TakeWeights, Tick, WeightsInput};
use motorium::declare::StepError;

use motorium_primitives::dmp::DmpModel;
use motorium_primitives::reach::{PoseReach, ReachPhase};

use super::waypoints::Waypoints;

/// Name of the input.
const PORT: &str = "weights";

/// The primitives of all goals with the shape `weights`, and the input that provides their weights: one goal
/// after the other, then by dimension, with a number for each kernel.
#[derive(Debug)]
pub(super) struct LiveWeights {
    input: WeightsInput,
    primitives: Vec<LivePrimitive>,
}

#[derive(Debug)]
struct LivePrimitive {
    segment: usize,
    /// The primitive as configured.
    configured: DmpModel,
    /// The primitive with the newest weights.
    model: DmpModel,
    /// `true` if the segment does not have the newest weights yet.
    is_pending: bool,
}

impl LiveWeights {
    pub(super) fn declare(waypoints: &Waypoints, declare: &mut Declare) {
        if waypoints.weighted().is_empty() {
            return;
        }
        declare.weights(PORT, "weights of the primitives of all goals with the shape `weights`");
    }

    /// Returns `None` if no goal has the shape `weights`.
    pub(super) fn open(
        waypoints: &Waypoints,
        take: TakeWeights,
        setup: &mut Setup,
    ) -> Result<Option<Self>, ConfigureError> {
        let primitives: Vec<LivePrimitive> = waypoints
            .weighted()
            .iter()
            .map(|(segment, model)| LivePrimitive {
                segment: *segment,
                configured: model.clone(),
                model: model.clone(),
                is_pending: false,
            })
            .collect();
        if primitives.is_empty() {
            return Ok(None);
        }
        let count = primitives.iter().map(|primitive| primitive.model.weights().len()).sum();
        Ok(Some(Self { input: setup.weights(PORT, count, take)?, primitives }))
    }

    /// Reads weights that have arrived, and assigns them to all segments except the current one.
    pub(super) fn apply(&mut self, reach: &mut PoseReach, tick: &Tick) -> Result<(), StepError> {
        let Self { input, primitives } = self;
        if let Some(mut weights) = input.take(tick) {
            for primitive in primitives.iter_mut() {
                let (own, rest) = weights.split_at(primitive.model.weights().len());
                primitive.model.weights_mut().copy_from_slice(own);
                primitive.is_pending = true;
                weights = rest;
            }
        }
        for primitive in primitives.iter_mut().filter(|primitive| primitive.is_pending) {
            let under_way = primitive.segment == reach.segment() && reach.phase() == ReachPhase::Moving;
            if !under_way {
                reach.reshape(primitive.segment, &primitive.model).map_err(|_| {
                    StepError::failed("the weights do not match the settings of the primitive")
                })?;
                primitive.is_pending = false;
            }
        }
        Ok(())
    }

    pub(super) fn reset(&mut self) {
        self.input.begin_episode();
        for LivePrimitive { configured, model, is_pending, .. } in &mut self.primitives {
            model.weights_mut().copy_from(configured.weights());
            *is_pending = false;
        }
    }

    pub(super) fn result(&self) -> serde_json::Value {
        self.input.result()
    }
}
