//! The C structures of the interface.

use std::ffi::{c_char, c_int};

/// `mfront_gb_State`, and `mfront_gb_InitialState`, whose layout is the same.
#[repr(C)]
pub(super) struct State {
    pub gradients: *const f64,
    pub thermodynamic_forces: *mut f64,
    pub mass_density: *const f64,
    pub material_properties: *const f64,
    pub internal_state_variables: *mut f64,
    pub stored_energy: *mut f64,
    pub dissipated_energy: *mut f64,
    pub external_state_variables: *const f64,
}

/// `mfront_gb_BehaviourData`.
#[repr(C)]
pub(super) struct BehaviourData {
    pub error_message: *mut c_char,
    pub dt: f64,
    pub tangent: *mut f64,
    pub rdt: *mut f64,
    pub speed_of_sound: *mut f64,
    pub before: State,
    pub after: State,
}

/// A behaviour.
pub(super) type Function = unsafe extern "C" fn(*mut BehaviourData) -> c_int;
