//! A component whose declaration and step are closures, referenced by number in a graph file.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Deserialize;

use crate::component::{Component, ConfigureError, Setup, Tick};
use crate::declare::{ConfigError, Declare, StepError};

/// A step.
pub(super) type Step = Box<dyn FnMut(&Tick) -> Result<(), StepError>>;
type Open = Box<dyn FnOnce(&mut Setup) -> Result<Step, ConfigureError> + Send>;

/// Closures of the parts of this process by number, because a graph file can only contain the number.
static CLOSURES: Mutex<BTreeMap<u64, Closures>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicU64 = AtomicU64::new(0);

struct Closures {
    declare: fn(&mut Declare),
    /// Taken when the component is configured.
    open: Option<Open>,
}

/// The number of a part; its closures are dropped with it.
#[derive(Debug)]
pub(super) struct Part(u64);

impl Part {
    /// Registers the closures of a part. `open` runs when its component is configured and returns the step.
    pub(super) fn new(
        declare: fn(&mut Declare),
        open: impl FnOnce(&mut Setup) -> Result<Step, ConfigureError> + Send + 'static,
    ) -> Self {
        let number = NEXT.fetch_add(1, Relaxed);
        lock(&CLOSURES).insert(number, Closures { declare, open: Some(Box::new(open)) });
        Self(number)
    }

    /// Returns the number of the part.
    pub(super) fn number(&self) -> u64 {
        self.0
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        let closures = lock(&CLOSURES).remove(&self.0);
        drop(closures);
    }
}

/// Locks a mutex, even if a thread panicked while holding it.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A component whose declaration and step are closures.
pub(super) struct Closure(Step);

#[derive(Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ClosureConfig {
    /// Number of the closures.
    part: u64,
}

impl Component for Closure {
    const KIND: &'static str = "test.closure";
    const SUMMARY: &'static str = "a component of closures, in the process of its test";
    type Config = ClosureConfig;

    fn declare(config: &ClosureConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let closures = lock(&CLOSURES);
        let found = closures
            .get(&config.part)
            .ok_or_else(|| ConfigError::key("part", "is not part of this process"))?;
        (found.declare)(declare);
        Ok(())
    }

    fn configure(config: ClosureConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let open = lock(&CLOSURES).get_mut(&config.part).and_then(|closures| closures.open.take());
        let open = open.ok_or_else(|| ConfigureError::failed("its closure has run already"))?;
        open(setup).map(Self)
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        (self.0)(tick)
    }
}
