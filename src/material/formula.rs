//! Laws that are one formula of two constants, which a device evaluates as the processor does (`gpu/kernels/recorded.h`).

use super::{Law, Material};

/// A law with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Formula {
    /// The number of the law on the device (`gpu/kernels/data.h`).
    pub law: u32,
    /// Λ and G.
    pub constants: [f64; 2],
}

impl Formula {
    pub(crate) const CIARLET: u32 = 0;
    pub(crate) const LOGARITHMIC: u32 = 1;
    pub(crate) const ST_VENANT_KIRCHHOFF: u32 = 2;

    /// The formula of a law; `None` for laws that solve equations, have more constants, or come from outside.
    pub(crate) fn of<L: Law>(law: &L) -> Option<Self> {
        let (law, lame) = match law.shipped()?.downcast_ref()? {
            Material::NeoHookean(law) => (Self::CIARLET, law.lame),
            Material::NeoHookeanLogarithmic(law) => (Self::LOGARITHMIC, law.lame),
            Material::StVenantKirchhoff(law) => (Self::ST_VENANT_KIRCHHOFF, law.lame),
            _ => return None,
        };
        Some(Self { law, constants: [lame.lambda, lame.shear] })
    }
}
