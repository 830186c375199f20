//! Contact sensors of feet.

use crate::channel::{Channel, ErrorModel, SettingError};

/// Contact sensors of a robot's feet: each measures a force with errors, from which a switch with hysteresis
/// derives contact.
///
/// Contact starts with the reading at which the force reaches `on` and ends with the reading at which the
/// force falls below `off`.
///
/// ```
/// use motorium_sensors::channel::ErrorModel;
/// use motorium_sensors::contact::ContactModel;
///
/// let mut feet = ContactModel::new(1, &ErrorModel::default(), (5.0, 2.0), 0)?;
/// let contact = |feet: &mut ContactModel, force: f64| {
///     let mut forces = [force];
///     feet.measure(1e-3, &mut forces);
///     feet.contacts()[0]
/// };
/// let seen = [4.0, 6.0, 3.0, 1.0].map(|force| contact(&mut feet, force));
/// assert_eq!(seen, [false, true, true, false]);
/// # Ok::<(), motorium_sensors::channel::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ContactModel {
    force: Channel,
    on: f64,
    off: f64,
    contacts: Vec<bool>,
}

impl ContactModel {
    /// Creates sensors for `feet` feet. `on` and `off` \[N\] are the thresholds at which contact starts and
    /// ends.
    ///
    /// # Errors
    /// [`SettingError`] if a number is out of range or `off` exceeds `on`.
    pub fn new(
        feet: usize,
        force: &ErrorModel,
        (on, off): (f64, f64),
        seed: u64,
    ) -> Result<Self, SettingError> {
        if !(on >= 0.0 && on.is_finite()) {
            return Err(SettingError::new("on", on, "a force of at least 0 N"));
        }
        if !(0.0..=on).contains(&off) {
            return Err(SettingError::new("off", off, "a force from 0 N to `on`"));
        }
        Ok(Self { force: Channel::new("force", force, feet, seed, 0)?, on, off, contacts: vec![false; feet] })
    }

    /// Replaces the true force of each foot \[N\] by a reading, and updates the switches. `dt` \[s\] is the
    /// time since the last reading.
    pub fn measure(&mut self, dt: f64, forces: &mut [f64]) {
        self.force.measure(dt, forces);
        for (contact, force) in self.contacts.iter_mut().zip(forces) {
            let least = if *contact { self.off } else { self.on };
            *contact = *force >= least && *force > 0.0;
        }
    }

    /// Returns `true` for each foot in contact, in the order of the feet.
    pub fn contacts(&self) -> &[bool] {
        &self.contacts
    }
}
