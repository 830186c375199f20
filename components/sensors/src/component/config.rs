//! The keys that all sensors share, defined once.

use crate::channel::Timing;
use crate::randomise::SensorRanges;

/// Settings that all sensors share: delivery and randomisation of the readings.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    pub(super) timing: Timing,
    pub(super) seed: Option<u64>,
    pub(super) randomise: &'a SensorRanges,
}

/// The configuration of a sensor.
pub trait SensorConfig {
    /// Returns latency, drop-outs, seed and randomisation.
    fn common(&self) -> Common<'_>;
}

/// Defines the configuration of a sensor: its individual keys with their defaults, and the keys that all
/// sensors share.
macro_rules! sensor_config {
    (
        $(#[$meta:meta])*
        pub struct $name:ident;

        $( $(#[$field_meta:meta])* $field:ident: $type:ty = $default:expr; )*
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $type, )*
            /// Delay from sampling until the reading is available. Default 0.
            pub latency: motorium::prelude::TimeSpan,
            /// Fraction of the readings that are dropped, 0 to 1. Default 0.
            pub drop_out: f64,
            /// Seed of the noise. Default: from the seed of the run and the name of the component.
            pub seed: Option<u64>,
            /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default:
            /// no sampling.
            pub randomise: $crate::randomise::SensorRanges,
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $( $field: $default, )*
                    latency: motorium::prelude::TimeSpan { ns: 0 },
                    drop_out: 0.0,
                    seed: None,
                    randomise: Default::default(),
                }
            }
        }

        sensor_config!(impl $name);
    };
    (impl $name:ident) => {
        impl $crate::component::config::SensorConfig for $name {
            fn common(&self) -> $crate::component::config::Common<'_> {
                $crate::component::config::Common {
                    timing: $crate::channel::Timing { latency: self.latency, drop_out: self.drop_out },
                    seed: self.seed,
                    randomise: &self.randomise,
                }
            }
        }
    };
}
