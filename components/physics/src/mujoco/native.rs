//! A MuJoCo model with its data, exposed as slices and numbers.

#![allow(unsafe_code)] // the library's structures are read and written in place

use core::ffi::{CStr, c_int};
use std::ffi::CString;

use super::layout;
use super::library::{Library, Opaque};

/// Parts of a state that are saved together (`mjtState`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts(c_int);

impl Parts {
    /// Positions, velocities and the warm start of the solver: everything a step changes.
    pub(super) const MOTION: Self = Self(1 << 1 | 1 << 2 | 1 << 5);
    /// Everything the next step depends on: time, positions, velocities, activations, histories, the warm
    /// start of the solver, controls and forces, active constraints, mocap poses, and the rest.
    pub(super) const INTEGRATION: Self = Self((1 << 14) - 1);
}

/// Kinds of named elements (`mjtObj`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Body = 1,
    Joint = 3,
    Geometry = 5,
}

/// A compiled model and its data.
pub(super) struct Native {
    library: &'static Library,
    model: Opaque,
    data: Opaque,
    nq: usize,
    nv: usize,
    mocaps: usize,
}

// SAFETY: the library keeps no thread-local state for a model or its data; both belong to this value alone.
unsafe impl Send for Native {}

impl Drop for Native {
    fn drop(&mut self) {
        // SAFETY: both come from this library and are deleted once, the data before its model.
        unsafe {
            (self.library.delete_data)(self.data);
            (self.library.delete_model)(self.model);
        }
    }
}

impl Native {
    /// Compiles a model from its MJCF text.
    ///
    /// # Errors
    ///
    /// The message from MuJoCo.
    pub(super) fn compile(library: &'static Library, mjcf: &str) -> Result<Self, String> {
        let text = CString::new(mjcf).map_err(|error| error.to_string())?;
        let mut message = [0_u8; 1000];
        let model = {
            let length = message.len() as c_int;
            // SAFETY: text and message meet the function's requirements: a text with a zero byte at its end,
            // and a buffer of the given length.
            let spec = unsafe {
                (library.parse_xml_string)(
                    text.as_ptr(),
                    core::ptr::null(),
                    message.as_mut_ptr().cast(),
                    length,
                )
            };
            if spec.is_null() {
                return Err(said(&message));
            }
            // SAFETY: the specification has just been made, and is deleted after its error has been copied.
            unsafe {
                let model = (library.compile)(spec, core::ptr::null());
                let error = (library.spec_error)(spec);
                if model.is_null() && !error.is_null() {
                    let error = CStr::from_ptr(error).to_bytes();
                    let length = error.len().min(message.len() - 1);
                    message[..length].copy_from_slice(&error[..length]);
                    message[length] = 0;
                }
                (library.delete_spec)(spec);
                model
            }
        };
        if model.is_null() {
            return Err(said(&message));
        }
        // SAFETY: the model has just been made; the result is checked for null, which means that there is no
        // memory.
        let data = unsafe { (library.make_data)(model) };
        if data.is_null() {
            // SAFETY: nothing else uses the model.
            unsafe { (library.delete_model)(model) };
            return Err("there is no memory for its data".to_owned());
        }
        let mut native = Self { library, model, data, nq: 0, nv: 0, mocaps: 0 };
        let size = |native: &Self, offset| {
            // SAFETY: the offset belongs to a 64-bit number in every model.
            unsafe { native.model.byte_add(offset).cast::<i64>().read() as usize }
        };
        native.nq = size(&native, layout::NQ);
        native.nv = size(&native, layout::NV);
        native.mocaps = size(&native, layout::NMOCAP);
        Ok(native)
    }

    /// Returns the positions of all joints.
    pub(super) fn qpos(&self) -> &[f64] {
        // SAFETY: `mjData.qpos` has nq entries for the life of the data.
        unsafe { array(self.data, layout::QPOS, self.nq) }
    }

    pub(super) fn qpos_mut(&mut self) -> &mut [f64] {
        // SAFETY: as above; nothing else uses the data.
        unsafe { array_mut(self.data, layout::QPOS, self.nq) }
    }

    /// Returns the velocities of all joints.
    pub(super) fn qvel(&self) -> &[f64] {
        // SAFETY: `mjData.qvel` has nv entries for the life of the data.
        unsafe { array(self.data, layout::QVEL, self.nv) }
    }

    pub(super) fn qvel_mut(&mut self) -> &mut [f64] {
        // SAFETY: as above; nothing else uses the data.
        unsafe { array_mut(self.data, layout::QVEL, self.nv) }
    }

    /// Returns the generalized external forces.
    pub(super) fn forces_mut(&mut self) -> &mut [f64] {
        // SAFETY: `mjData.qfrc_applied` has nv entries; nothing else uses the data.
        unsafe { array_mut(self.data, layout::QFRC_APPLIED, self.nv) }
    }

    /// Returns position and quaternion w x y z of body `mocap` among the placed bodies.
    pub(super) fn mocap(&self, mocap: usize) -> ([f64; 3], [f64; 4]) {
        // SAFETY: the arrays have three and four entries for each of these bodies.
        let (positions, quaternions): (&[f64], &[f64]) = unsafe {
            (
                array(self.data, layout::MOCAP_POS, 3 * self.mocaps),
                array(self.data, layout::MOCAP_QUAT, 4 * self.mocaps),
            )
        };
        let position = core::array::from_fn(|axis| positions[3 * mocap + axis]);
        (position, core::array::from_fn(|axis| quaternions[4 * mocap + axis]))
    }

    /// Sets the pose of body `mocap` among the placed bodies.
    pub(super) fn set_mocap(&mut self, mocap: usize, position: [f64; 3], quaternion: [f64; 4]) {
        // SAFETY: as above, one after the other; nothing else uses the data.
        unsafe {
            array_mut(self.data, layout::MOCAP_POS, 3 * self.mocaps)[3 * mocap..][..3]
                .copy_from_slice(&position);
            array_mut(self.data, layout::MOCAP_QUAT, 4 * self.mocaps)[4 * mocap..][..4]
                .copy_from_slice(&quaternion);
        }
    }

    /// Returns the inertia on the diagonal of the mass matrix in addition to the bodies' inertia.
    pub(super) fn armature(&self, dof: usize) -> f64 {
        // SAFETY: `mjModel.dof_armature` has nv entries for the life of the model.
        unsafe { array::<f64>(self.model, layout::DOF_ARMATURE, self.nv)[dof] }
    }

    /// Sets the diagonal inertia. MuJoCo stores constant entries of the mass matrix with it included.
    pub(super) fn set_armature(&mut self, dof: usize, armature: f64) {
        // SAFETY: both arrays of the model have nv entries; nothing else uses the model.
        unsafe {
            let place = &mut array_mut::<f64>(self.model, layout::DOF_ARMATURE, self.nv)[dof];
            let change = armature - *place;
            *place = armature;
            array_mut::<f64>(self.model, layout::DOF_MASS, self.nv)[dof] += change;
        }
    }

    /// Hardens the constraints of a joint: friction, stops and couplings yield by this fraction of their
    /// usual yield to forces.
    pub(super) fn harden(&mut self, dof: usize, share: f64) {
        // SAFETY: the array of the model has nv entries; nothing else uses the model.
        unsafe { array_mut::<f64>(self.model, layout::DOF_INVERSE_WEIGHT, self.nv)[dof] *= share }
    }

    /// Returns the length of an integration step \[s\].
    pub(super) fn timestep(&self) -> f64 {
        // SAFETY: the offset belongs to a number in every model.
        unsafe { self.model.byte_add(layout::TIMESTEP).cast::<f64>().read() }
    }

    /// Sets length \[s\] and gravity \[m/s2\] of the following integration steps.
    pub(super) fn set_options(&mut self, timestep: f64, gravity: [f64; 3]) {
        // SAFETY: the offsets belong to a number and to three numbers in every model; nothing else uses the
        // model.
        unsafe {
            self.model.byte_add(layout::TIMESTEP).cast::<f64>().write(timestep);
            self.model.byte_add(layout::GRAVITY).cast::<[f64; 3]>().write(gravity);
        }
    }

    /// Runs one integration step.
    pub(super) fn step(&mut self) {
        // SAFETY: model and data belong together and to this value.
        unsafe { (self.library.step)(self.model, self.data) }
    }

    /// Resets the data to the start of the model.
    pub(super) fn reset(&mut self) {
        // SAFETY: model and data belong together and to this value.
        unsafe { (self.library.reset_data)(self.model, self.data) }
    }

    /// Returns the number of values in a state of these parts.
    pub(super) fn state_size(&self, parts: Parts) -> usize {
        // SAFETY: the model is alive.
        unsafe { (self.library.state_size)(self.model, parts.0) as usize }
    }

    /// Writes these parts of the state to `state`, which has [`state_size`](Self::state_size) values.
    pub(super) fn get_state(&self, parts: Parts, state: &mut [f64]) {
        assert_eq!(state.len(), self.state_size(parts), "length of a state");
        // SAFETY: there is room for all of it.
        unsafe { (self.library.get_state)(self.model, self.data, state.as_mut_ptr(), parts.0) }
    }

    /// Restores these parts of the state, as written by [`get_state`](Self::get_state).
    pub(super) fn set_state(&mut self, parts: Parts, state: &[f64]) {
        assert_eq!(state.len(), self.state_size(parts), "length of a state");
        // SAFETY: the slice has the full length.
        unsafe { (self.library.set_state)(self.model, self.data, state.as_ptr(), parts.0) }
    }

    /// Returns the number of the element with this name.
    pub(super) fn id(&self, kind: Kind, name: &str) -> Option<usize> {
        let name = CString::new(name).ok()?;
        // SAFETY: the model is alive, and the name ends with a zero byte.
        let id = unsafe { (self.library.name_to_id)(self.model, kind as c_int, name.as_ptr()) };
        usize::try_from(id).ok()
    }

    /// Returns the first index of a joint in the positions and in the velocities.
    pub(super) fn joint_places(&self, joint: usize) -> (usize, usize) {
        // SAFETY: both arrays have an entry for every joint of the model, and `id` returns no other.
        unsafe {
            let joints = self.model.byte_add(layout::NJNT).cast::<i64>().read() as usize;
            let place = |offset| array::<i32>(self.model, offset, joints)[joint] as usize;
            (place(layout::JOINT_QPOS), place(layout::JOINT_DOF))
        }
    }

    /// Returns the index of a body among the placed bodies.
    pub(super) fn mocap_of(&self, body: usize) -> Option<usize> {
        // SAFETY: the array has an entry for every body of the model.
        let id = unsafe {
            let bodies = self.model.byte_add(layout::NBODY).cast::<i64>().read() as usize;
            array::<i32>(self.model, layout::BODY_MOCAP, bodies)[body]
        };
        usize::try_from(id).ok()
    }

    /// Returns the contact points of the last step.
    pub(super) fn contacts(&self) -> &[layout::Contact] {
        // SAFETY: the library stores this number of contacts at this address until the next call that uses
        // the data.
        unsafe {
            let count = self.data.byte_add(layout::CONTACT_COUNT).cast::<i32>().read() as usize;
            array(self.data, layout::CONTACTS, count)
        }
    }

    /// Returns force \[N\] and torque \[N m\] at a contact along the rows of its frame.
    pub(super) fn contact_force(&self, contact: usize) -> [f64; 6] {
        let mut force = [0.0; 6];
        // SAFETY: the function writes six numbers, for a contact of the last step.
        unsafe { (self.library.contact_force)(self.model, self.data, contact as c_int, force.as_mut_ptr()) };
        force
    }

    /// Returns `true` if contacts or constraints of a step did not fit since the last [`reset`](Self::reset).
    pub(super) fn is_full(&self) -> bool {
        // SAFETY: the warnings are stored in the data itself, these two among them.
        let warnings = unsafe { self.data.byte_add(layout::WARNINGS).cast::<layout::Warning>() };
        layout::FULL.iter().any(|place| {
            // SAFETY: as above.
            unsafe { (*warnings.add(*place)).number > 0 }
        })
    }
}

/// Returns the array that a field of a structure points to.
///
/// # Safety
///
/// The field must point to `length` values that do not change during the lifetime of the slice.
unsafe fn array<'a, T>(structure: Opaque, offset: usize, length: usize) -> &'a [T] {
    // SAFETY: guaranteed by the caller.
    unsafe {
        let first = structure.byte_add(offset).cast::<*const T>().read();
        if length == 0 { &[] } else { core::slice::from_raw_parts(first, length) }
    }
}

/// Returns the mutable array that a field of a structure points to.
///
/// # Safety
///
/// The field must point to `length` values that nothing else reads or changes during the lifetime of the
/// slice.
unsafe fn array_mut<'a, T>(structure: Opaque, offset: usize, length: usize) -> &'a mut [T] {
    // SAFETY: guaranteed by the caller.
    unsafe {
        let first = structure.byte_add(offset).cast::<*mut T>().read();
        if length == 0 { &mut [] } else { core::slice::from_raw_parts_mut(first, length) }
    }
}

/// Returns the text before the first zero byte.
fn said(message: &[u8]) -> String {
    let text = message.split(|byte| *byte == 0).next().unwrap_or_default();
    let text = String::from_utf8_lossy(text);
    text.trim().trim_start_matches("Error: ").replace('\n', ", ")
}
