//! A model of MuJoCo with its data, as slices and numbers.

#![allow(unsafe_code)] // the library's structures are read and written where they lie

use core::ffi::{CStr, c_int};
use std::ffi::CString;

use super::layout;
use super::library::{Library, Opaque};

/// Parts of a state that are saved together (`mjtState`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Parts(c_int);

impl Parts {
    /// Positions, velocities and the start of the solver: the state changed by a step.
    pub(super) const MOTION: Self = Self(1 << 1 | 1 << 2 | 1 << 5);
    /// All that the next step depends on: time, positions, velocities, activations, histories, the start of
    /// the solver, controls and forces, active constraints, mocap poses, the rest.
    pub(super) const INTEGRATION: Self = Self((1 << 14) - 1);
}

/// Kinds of named things (`mjtObj`).
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

// SAFETY: the library keeps no state of a thread for a model or its data; both belong to this value alone.
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
    /// Words of MuJoCo against it.
    pub(super) fn compile(library: &'static Library, mjcf: &str) -> Result<Self, String> {
        let text = CString::new(mjcf).map_err(|error| error.to_string())?;
        let mut message = [0_u8; 1000];
        let model = {
            let length = message.len() as c_int;
            // SAFETY: text and message are as the function requires: a text with a zero byte at its end, a
            // buffer of that length.
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
        // SAFETY: the model has just been made; null, where there is no memory, is looked for.
        let data = unsafe { (library.make_data)(model) };
        if data.is_null() {
            // SAFETY: nothing else has the model.
            unsafe { (library.delete_model)(model) };
            return Err("there is no memory for its data".to_owned());
        }
        let mut native = Self { library, model, data, nq: 0, nv: 0, mocaps: 0 };
        let size = |native: &Self, offset| {
            // SAFETY: every model has a number of 64 bits at this offset.
            unsafe { native.model.byte_add(offset).cast::<i64>().read() as usize }
        };
        native.nq = size(&native, layout::NQ);
        native.nv = size(&native, layout::NV);
        native.mocaps = size(&native, layout::NMOCAP);
        Ok(native)
    }

    /// Positions of all joints.
    pub(super) fn qpos(&self) -> &[f64] {
        // SAFETY: `mjData.qpos` has nq entries for the life of the data.
        unsafe { array(self.data, layout::QPOS, self.nq) }
    }

    pub(super) fn qpos_mut(&mut self) -> &mut [f64] {
        // SAFETY: as above; nothing else has the data.
        unsafe { array_mut(self.data, layout::QPOS, self.nq) }
    }

    /// Velocities of all joints.
    pub(super) fn qvel(&self) -> &[f64] {
        // SAFETY: `mjData.qvel` has nv entries for the life of the data.
        unsafe { array(self.data, layout::QVEL, self.nv) }
    }

    pub(super) fn qvel_mut(&mut self) -> &mut [f64] {
        // SAFETY: as above; nothing else has the data.
        unsafe { array_mut(self.data, layout::QVEL, self.nv) }
    }

    /// Generalized forces from outside.
    pub(super) fn forces_mut(&mut self) -> &mut [f64] {
        // SAFETY: `mjData.qfrc_applied` has nv entries; nothing else has the data.
        unsafe { array_mut(self.data, layout::QFRC_APPLIED, self.nv) }
    }

    /// Position and quaternion w x y z of the placed body `mocap`.
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

    /// Places body `mocap`.
    pub(super) fn set_mocap(&mut self, mocap: usize, position: [f64; 3], quaternion: [f64; 4]) {
        // SAFETY: as above, one after the other; nothing else has the data.
        unsafe {
            array_mut(self.data, layout::MOCAP_POS, 3 * self.mocaps)[3 * mocap..][..3]
                .copy_from_slice(&position);
            array_mut(self.data, layout::MOCAP_QUAT, 4 * self.mocaps)[4 * mocap..][..4]
                .copy_from_slice(&quaternion);
        }
    }

    /// Inertia on the diagonal of the mass matrix in addition to the bodies'.
    pub(super) fn armature(&self, dof: usize) -> f64 {
        // SAFETY: `mjModel.dof_armature` has nv entries for the life of the model.
        unsafe { array::<f64>(self.model, layout::DOF_ARMATURE, self.nv)[dof] }
    }

    /// Sets that inertia. Entries of the mass matrix that never change are kept by MuJoCo with it in them.
    pub(super) fn set_armature(&mut self, dof: usize, armature: f64) {
        // SAFETY: both arrays of the model have nv entries; nothing else has the model.
        unsafe {
            let place = &mut array_mut::<f64>(self.model, layout::DOF_ARMATURE, self.nv)[dof];
            let change = armature - *place;
            *place = armature;
            array_mut::<f64>(self.model, layout::DOF_MASS, self.nv)[dof] += change;
        }
    }

    /// Hardens the constraints of a joint: friction, stops and couplings yield to forces by this share of the
    /// default.
    pub(super) fn harden(&mut self, dof: usize, share: f64) {
        // SAFETY: the array of the model has nv entries; nothing else has the model.
        unsafe { array_mut::<f64>(self.model, layout::DOF_INVERSE_WEIGHT, self.nv)[dof] *= share }
    }

    /// Length of an integration step \[s\].
    pub(super) fn timestep(&self) -> f64 {
        // SAFETY: every model has a number at this offset.
        unsafe { self.model.byte_add(layout::TIMESTEP).cast::<f64>().read() }
    }

    /// Sets length \[s\] and gravity \[m/s2\] of the coming integration steps.
    pub(super) fn set_options(&mut self, timestep: f64, gravity: [f64; 3]) {
        // SAFETY: every model has a number, and three numbers, at these offsets; nothing else accesses the
        // model.
        unsafe {
            self.model.byte_add(layout::TIMESTEP).cast::<f64>().write(timestep);
            self.model.byte_add(layout::GRAVITY).cast::<[f64; 3]>().write(gravity);
        }
    }

    /// One integration step.
    pub(super) fn step(&mut self) {
        // SAFETY: model and data belong together and to this value.
        unsafe { (self.library.step)(self.model, self.data) }
    }

    /// Goes back to the start of the model.
    pub(super) fn reset(&mut self) {
        // SAFETY: model and data belong together and to this value.
        unsafe { (self.library.reset_data)(self.model, self.data) }
    }

    /// Numbers in a state of these parts.
    pub(super) fn state_size(&self, parts: Parts) -> usize {
        // SAFETY: the model is alive.
        unsafe { (self.library.state_size)(self.model, parts.0) as usize }
    }

    /// Writes these parts of the state to `state`, which has [`state_size`](Self::state_size) numbers.
    pub(super) fn get_state(&self, parts: Parts, state: &mut [f64]) {
        assert_eq!(state.len(), self.state_size(parts), "length of a state");
        // SAFETY: there is room for all of it.
        unsafe { (self.library.get_state)(self.model, self.data, state.as_mut_ptr(), parts.0) }
    }

    /// Sets these parts of the state, as [`get_state`](Self::get_state) wrote them.
    pub(super) fn set_state(&mut self, parts: Parts, state: &[f64]) {
        assert_eq!(state.len(), self.state_size(parts), "length of a state");
        // SAFETY: all of it is there.
        unsafe { (self.library.set_state)(self.model, self.data, state.as_ptr(), parts.0) }
    }

    /// The number of the object with this name.
    pub(super) fn id(&self, kind: Kind, name: &str) -> Option<usize> {
        let name = CString::new(name).ok()?;
        // SAFETY: the model is alive, and the name ends with a zero byte.
        let id = unsafe { (self.library.name_to_id)(self.model, kind as c_int, name.as_ptr()) };
        usize::try_from(id).ok()
    }

    /// First place of a joint in the positions and in the velocities.
    pub(super) fn joint_places(&self, joint: usize) -> (usize, usize) {
        // SAFETY: both arrays have an entry for every joint of the model, and `id` gives no other.
        unsafe {
            let joints = self.model.byte_add(layout::NJNT).cast::<i64>().read() as usize;
            let place = |offset| array::<i32>(self.model, offset, joints)[joint] as usize;
            (place(layout::JOINT_QPOS), place(layout::JOINT_DOF))
        }
    }

    /// Index of a body among the placed ones.
    pub(super) fn mocap_of(&self, body: usize) -> Option<usize> {
        // SAFETY: the array has an entry for every body of the model.
        let id = unsafe {
            let bodies = self.model.byte_add(layout::NBODY).cast::<i64>().read() as usize;
            array::<i32>(self.model, layout::BODY_MOCAP, bodies)[body]
        };
        usize::try_from(id).ok()
    }

    /// The contact points of the last step.
    pub(super) fn contacts(&self) -> &[layout::Contact] {
        // SAFETY: the library keeps this number of contacts at this address, until the next call with the
        // data.
        unsafe {
            let count = self.data.byte_add(layout::CONTACT_COUNT).cast::<i32>().read() as usize;
            array(self.data, layout::CONTACTS, count)
        }
    }

    /// Force \[N\] and torque \[N m\] at a contact along the rows of its frame.
    pub(super) fn contact_force(&self, contact: usize) -> [f64; 6] {
        let mut force = [0.0; 6];
        // SAFETY: the function writes six numbers, for a contact of the last step.
        unsafe { (self.library.contact_force)(self.model, self.data, contact as c_int, force.as_mut_ptr()) };
        force
    }

    /// True if contacts or constraints of a step had no room since the last [`reset`](Self::reset).
    pub(super) fn is_full(&self) -> bool {
        // SAFETY: the warnings are stored in the data itself, including these two.
        let warnings = unsafe { self.data.byte_add(layout::WARNINGS).cast::<layout::Warning>() };
        layout::FULL.iter().any(|place| {
            // SAFETY: as above.
            unsafe { (*warnings.add(*place)).number > 0 }
        })
    }
}

/// The array that a field of a structure points to.
///
/// # Safety
///
/// The field must point to `length` values, which nothing changes as long as the slice lives.
unsafe fn array<'a, T>(structure: Opaque, offset: usize, length: usize) -> &'a [T] {
    // SAFETY: guaranteed by the caller.
    unsafe {
        let first = structure.byte_add(offset).cast::<*const T>().read();
        if length == 0 { &[] } else { core::slice::from_raw_parts(first, length) }
    }
}

/// The array that a field of a structure points to, to be written.
///
/// # Safety
///
/// The field must point to `length` values, which nothing else reads or changes as long as the slice lives.
unsafe fn array_mut<'a, T>(structure: Opaque, offset: usize, length: usize) -> &'a mut [T] {
    // SAFETY: guaranteed by the caller.
    unsafe {
        let first = structure.byte_add(offset).cast::<*mut T>().read();
        if length == 0 { &mut [] } else { core::slice::from_raw_parts_mut(first, length) }
    }
}

/// The text before the first zero byte.
fn said(message: &[u8]) -> String {
    let text = message.split(|byte| *byte == 0).next().unwrap_or_default();
    let text = String::from_utf8_lossy(text);
    text.trim().trim_start_matches("Error: ").replace('\n', ", ")
}
