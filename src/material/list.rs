//! The list of shipped laws, from which [`Material`] and [`Parameters`] are made.

use super::foreign::{CLawParameters, Foreign, MfrontParameters, Outside, UmatParameters};
use super::{
    Ciarlet, DruckerPrager, FibreReinforced, Lame, Law, Listed, Logarithmic, MooneyRivlin, NeoHookean, Ogden, Plastic,
    StVenantKirchhoff, Viscoelastic, VonMises,
};
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::any::Any;

/// A generic operation on a law of any type.
pub(crate) trait LawVisitor {
    /// The result of the operation.
    type Output;
    /// Runs the operation on `law`.
    fn visit<L: Law + 'static>(self, law: L) -> Self::Output;
}

/// Generates [`Material`], [`Parameters`] and the conversions from the list of laws.
macro_rules! materials {
    ($($(#[$sentence:meta])+ $key:literal, $name:literal => $law:ident($formula:ty);)*
     outside { $($(#[$of:meta])+ $kind:literal => $library:ident($keys:ty);)* }) => {
        /// One of the shipped laws, or a law from a shared library.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Material {
            $($(#[$sentence])+ $law($formula),)*
            /// A law from a shared library.
            Foreign(Foreign),
        }

        /// A law with its constants.
        #[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
        #[schemars(rename = "Material")]
        pub enum Parameters {
            $($(#[$sentence])+ #[serde(rename = $key)] $law(<$formula as Listed>::Parameters),)*
            $($(#[$of])+ #[serde(rename = $kind)] $library($keys)),*
        }

        impl Parameters {
            /// Builds the law. `None` if a value below the key `path` is not allowed; `problems` then says why.
            ///
            /// ```
            /// use bfree::material::{Lame, NeoHookean, Parameters};
            /// use bfree::scene::Problems;
            ///
            /// let written: Parameters = serde_json::from_str(r#"{"neo_hookean": {"lambda": 1, "shear": 2}}"#)?;
            /// let law = written.law(&mut Problems::default(), "material");
            /// assert_eq!(law, Some(NeoHookean::ciarlet(Lame::new(1.0, 2.0)?).into()));
            /// # Ok::<(), Box<dyn std::error::Error>>(())
            /// ```
            pub fn law(&self, problems: &mut Problems, path: &str) -> Option<Material> {
                match self {
                    $(Self::$law(given) => {
                        <$formula>::build(given, problems, &format!("{path}.{}", $key)).map(Material::$law)
                    })*
                    $(Self::$library(given) => given.open(problems, &format!("{path}.{}", $kind)).map(Material::Foreign),)*
                }
            }
        }

        impl Law for Material {
            const IN_SCENES: bool = true;

            $crate::law_of_variants!(Self: $($law,)* Foreign);

            fn shipped(&self) -> Option<&dyn Any> {
                Some(self)
            }
        }

        impl Listed for Material {
            type Parameters = Parameters;

            fn build(given: &Parameters, problems: &mut Problems, path: &str) -> Option<Self> {
                given.law(problems, path)
            }

            /// The paper's law.
            fn example(lame: Lame) -> Self {
                NeoHookean::ciarlet(lame).into()
            }
        }

        impl Material {
            /// An example of every shipped law, with its name, for tests and studies. At small strain each is Hooke's law of Λ and G; fibres add
            /// their stiffness.
            pub fn examples(lame: Lame) -> Vec<(&'static str, Self)> {
                vec![$(($name, Self::$law(Listed::example(lame)))),*]
            }

            /// Calls `visitor` with the concrete law, so that a loop over particles does not branch on the type of the law.
            pub(crate) fn with<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self {
                    $(Self::$law(law) => visitor.visit(law.clone()),)*
                    Self::Foreign(law) => visitor.visit(law.clone()),
                }
            }
        }

        $(impl From<$formula> for Material {
            fn from(law: $formula) -> Self {
                Self::$law(law)
            }
        })*
    };
}

// An entry has the sentence of the manual, the key in a scene, the name in reports, and the type. CONTRIBUTING.md lists the other places
// that a shipped law touches.
materials! {
    /// Neo-Hookean with Ciarlet's volumetric energy Λ/4 (J² − 1) − Λ/2 ln J: the paper's law.
    "neo_hookean", "neo-Hookean, Ciarlet" => NeoHookean(NeoHookean<Ciarlet>);
    /// Neo-Hookean with the volumetric energy Λ/2 (ln J)².
    "neo_hookean_logarithmic", "neo-Hookean, logarithmic" => NeoHookeanLogarithmic(NeoHookean<Logarithmic>);
    /// St. Venant–Kirchhoff: linear in the Green–Lagrange strain; not for strong compression.
    "st_venant_kirchhoff", "St. Venant-Kirchhoff" => StVenantKirchhoff(StVenantKirchhoff);
    /// Rubber: Mooney and Rivlin's solid, with the two invariants of C, compressible.
    "mooney_rivlin", "Mooney-Rivlin" => MooneyRivlin(MooneyRivlin);
    /// Rubber: Ogden's solid, with powers of the principal stretches, compressible.
    "ogden", "Ogden" => Ogden(Ogden);
    /// Tissue, reinforced rubber: one family of fibres in an elastic matrix. The fibres bear tension alone.
    "fibre_reinforced", "fibre-reinforced" => FibreReinforced(FibreReinforced<Material>);
    /// Maxwell branches parallel to an elastic law, at finite strain.
    "viscoelastic", "viscoelastic" => Viscoelastic(Viscoelastic<Material>);
    /// Metal: linear elasticity in logarithmic strains, and plastic flow at a von Mises yield stress that may harden.
    "von_mises", "von Mises" => VonMises(Plastic<VonMises>);
    /// Soil: linear elasticity in logarithmic strains, and Drucker and Prager's yield cone with cohesion, friction and dilatancy.
    "drucker_prager", "Drucker-Prager" => DruckerPrager(Plastic<DruckerPrager>);
    outside {
        /// A UMAT of Abaqus/Standard, from a shared library.
        "umat" => Umat(UmatParameters);
        /// A behaviour of MFront, built with the interface `generic`, from a shared library.
        "mfront" => Mfront(MfrontParameters);
        /// A law with the C header `bfree_law.h`, from a shared library.
        "c" => CLaw(CLawParameters);
    }
}
