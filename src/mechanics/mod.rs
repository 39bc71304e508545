//! The weak form: transfer, loads, residual, and the matrix-free tangent.

mod affine;
pub mod check;
pub mod constitutive;
pub(crate) mod contact;
pub(crate) mod dilatation;
mod effective;
pub(crate) mod extension;
mod joined_cells;
pub(crate) mod kinematics;
pub(crate) mod linearized;
pub mod loads;
mod local_form;
pub mod mass;
pub(crate) mod mixed;
pub mod path;
mod problem;
pub mod reference;
pub mod residual;
pub mod rigid;
pub mod schemes;
pub mod smoothing;
pub mod sweep;
pub(crate) mod symmetry;
pub mod tangent;
pub mod terms;
pub mod transfer;
pub(crate) mod trial;
