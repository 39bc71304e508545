//! The museum of wrong tangents: mistakes of the past as small laws and residuals of our own, before and after the repair.
//!
//! Each file tells one story with its source. The manual tells them in `docs/src/museum.md`.

mod algebra;
mod bent_plate;
mod check;
mod damage_softening;
mod fibre_dispersion;
mod frequent;
mod green_for_cauchy;
mod half_shear;
mod hencky_axes;
mod index_order;
mod kinematic_hardening;
mod kirchhoff_for_cauchy;
mod mollifier;
mod neo_hooke;
mod plate_rebar;
mod shear_order;
mod sheet_stiffness;
mod user_element;
mod witness;
