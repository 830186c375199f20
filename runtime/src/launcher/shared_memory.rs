//! The shared memory of a run: its services, the reserve for restarts, and the slots of dead processes.

use super::places::Places;
use super::reserve::Spare;
use super::run::Run;
use super::services::Services;
use super::{Event, LaunchError};

/// The shared memory of a run.
pub(super) struct SharedMemory {
    services: Services,
    spare: Spare,
    places: Places,
}

impl SharedMemory {
    /// Creates an empty value.
    pub(super) fn none() -> Self {
        Self { services: Services::default(), spare: Spare::none(), places: Places::default() }
    }

    /// Creates the services of a run and reserves their memory.
    ///
    /// # Errors
    /// A service cannot be created, or shared memory is full.
    pub(super) fn create(run: &Run) -> Result<Self, LaunchError> {
        let services = Services::create(&run.folder, &run.plan)?;
        Ok(Self { services, spare: Spare::reserve(&run.folder)?, places: Places::default() })
    }

    /// Frees the slots of a component that has ended, and releases the reserve for its successor.
    pub(super) fn free_slots(&mut self, run: &Run) {
        self.places.free(&run.options, &run.folder, &self.services);
        self.spare.release();
    }

    /// Reserves memory for the next restart. On failure that restart uses the remaining memory.
    pub(super) fn refill(&self) {
        let _ = self.spare.take_back();
    }

    /// Releases the reserve, which makes space for results.
    pub(super) fn release_reserve(&self) {
        self.spare.release();
    }

    /// Frees the slots of dead processes periodically.
    pub(super) fn look(&mut self, run: &Run, observe: &mut dyn FnMut(Event<'_>)) {
        self.places.look(&run.options, &run.folder, observe);
    }

    /// Clears all publications for a new episode.
    pub(super) fn clear(&self) {
        self.services.clear();
    }

    /// Wakes components that wait for a publication, so that they see the command.
    pub(super) fn wake_triggered(&self) {
        self.services.waited_for.iter().for_each(|topic| topic.interrupt());
    }

    /// Removes the services.
    pub(super) fn remove(&mut self) {
        self.places.end_cleaner();
        self.services = Services::default();
    }
}
