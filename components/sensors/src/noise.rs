//! Reproducible Gaussian noise.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64;

/// Channel number, within a seed, of the noise of drop-outs.
pub(crate) const DROP_OUTS: u64 = 1 << 20;

/// A generator of standard normal numbers. Equal seeds and channels give equal sequences.
///
/// The generator is PCG XSL RR 128/64 (O'Neill 2014) with ziggurat sampling. Channels of one seed are
/// independent, so switching the noise of one quantity on or off does not change the noise of other
/// quantities.
#[derive(Clone, Debug)]
pub struct Noise {
    generator: Pcg64,
}

impl Noise {
    /// Creates the generator of channel `channel` of a seed.
    pub fn new(seed: u64, channel: u64) -> Self {
        // the seed selects a generator of seeds, which seeds the channel: streams of one state are correlated
        let mut seeds = Pcg64::seed_from_u64(seed);
        seeds.advance(u128::from(channel) << 32);
        Self { generator: Pcg64::from_rng(&mut seeds) }
    }

    /// Returns the next standard normal number.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.generator)
    }

    /// Returns the next uniformly distributed number from 0 to below 1.
    pub fn uniform(&mut self) -> f64 {
        StandardUniform.sample(&mut self.generator)
    }

    /// Adds Gaussian noise with one standard deviation per value. A deviation of 0 consumes no random number.
    pub fn add(&mut self, deviations: &[f64], values: &mut [f64]) {
        for (value, deviation) in values.iter_mut().zip(deviations) {
            if *deviation > 0.0 {
                *value += deviation * self.normal();
            }
        }
    }
}
