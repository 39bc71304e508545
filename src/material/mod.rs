//! Material laws. Each law has its own file, with its formulas and its parameters in a scene ([`Listed`]). One list of the laws generates
//! [`Material`] and [`Parameters`].
//!
//! A law gives its energy `W`, the second Piola–Kirchhoff stress `S`, the action `ℂ:X` of its tangent and the B-free tangent density
//! `ℂmat{v,b}` of Planas, Romero, Sancho (the paper's eq. 37). The first Piola–Kirchhoff stress `P = F S` is formed in one place only,
//! [`first_piola`]. It takes the F on the left and the F inside S separately, so that dual numbers can check the geometric and the material
//! tangent term by term.

mod closed_tangent;
mod drucker_prager;
mod fibres;
mod foreign;
mod formula;
mod from_energy;
mod hardening;
mod hencky;
mod lame;
mod law;
mod list;
mod listed;
mod moduli;
mod mooney_rivlin;
mod neo_hookean;
mod ogden;
mod plastic;
mod spectral;
mod st_venant_kirchhoff;
mod state;
mod variants;
mod viscoelastic;
mod volume;
mod von_mises;

pub use closed_tangent::ClosedTangent;
pub use drucker_prager::{Cone, DruckerPrager, DruckerPragerParameters};
pub use fibres::{FibreReinforced, FibreReinforcedParameters};
pub use foreign::{
    CLawParameters, Foreign, InternalVariables, MfrontParameters, TangentOf, UmatParameters, allow_library,
};
pub(crate) use formula::Formula;
pub use from_energy::{Energy, FromEnergy};
pub use hardening::Hardening;
pub use hencky::Radial;
pub use lame::{Lame, LameError, LameParameters};
pub(crate) use law::internal_variable_names;
pub use law::{DISSIPATED, InternalVariable, Law, PLASTIC_STRAIN, TangentBlocks, first_piola, internal_variable};
pub(crate) use list::LawVisitor;
pub use list::{Material, Parameters};
pub use listed::Listed;
pub use moduli::p_wave_modulus;
pub(crate) use moduli::{out_of_plane_stress, poissons_ratio};
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use ogden::{Ogden, OgdenTerm};
pub use plastic::{Criterion, Plastic, ReturnMapped};
pub(crate) use spectral::principal_values;
pub use st_venant_kirchhoff::StVenantKirchhoff;
pub use state::{MaterialState, NonPositiveJacobian};
pub use viscoelastic::{Branch, Viscoelastic, ViscoelasticParameters};
pub(crate) use volume::Volumetric;
pub use volume::{Ciarlet, Logarithmic, VolumeResponse};
pub use von_mises::{VonMises, VonMisesParameters};
