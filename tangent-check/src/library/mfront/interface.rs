//! The C structures of the interface, and the components of MFront's tensors.

use std::ffi::{c_char, c_int};

use crate::convention::Components;

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

/// MFront's symmetric tensors: 11, 22, 33, √2·12, √2·13, √2·23, or the first four in plane strain.
pub(super) fn symmetric(plane_strain: bool) -> Components {
    crate::convention::Components {
        shear: std::f64::consts::SQRT_2,
        ..if plane_strain { Components::abaqus_plane(1.0) } else { Components::abaqus(1.0) }
    }
}

/// MFront's tensors: 11, 22, 33, 12, 21, 13, 31, 23, 32, or the first five in plane strain.
pub(super) fn full(plane_strain: bool) -> Components {
    let count = if plane_strain { 5 } else { 9 };
    let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)];
    Components { pairs: pairs[..count].to_vec(), shear: 1.0 }
}
