//! The list of shipped laws, from which [`Material`] and [`Parameters`] are made.

use super::{
    Ciarlet, DruckerPrager, FibreReinforced, Lame, Law, Logarithmic, MooneyRivlin, NeoHookean, Ogden, Plastic,
    StVenantKirchhoff, Viscoelastic, VonMises,
};
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a law of the list has beside its formulas.
pub trait Listed: Law + Sized {
    /// What a scene writes of it: the doc comments of the fields are the manual. Isotropic laws share [`LameParameters`](super::LameParameters).
    type Parameters;

    /// Its name in reports.
    const NAME: &'static str;

    /// The law; or `None`, and `problems` of the keys below `path`.
    fn build(given: &Self::Parameters, problems: &mut Problems, path: &str) -> Option<Self>;

    /// A member that is Hooke's law of Λ and G at small strain, but for fibres, with other constants as it likes: what tests and studies
    /// take.
    fn example(lame: Lame) -> Self;
}

/// Something to be done with a law of whatever type.
pub(crate) trait LawVisitor {
    /// What comes out.
    type Output;
    /// Does it.
    fn visit<L: Law + 'static>(self, law: L) -> Self::Output;
}

/// Makes of the list of laws what every law is in.
macro_rules! materials {
    ($($(#[$sentence:meta])+ $key:literal => $law:ident($formula:ty);)*) => {
        /// Any of the shipped laws.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Material {
            $($(#[$sentence])+ $law($formula)),*
        }

        /// A law with its constants.
        #[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
        #[schemars(rename = "Material")]
        pub enum Parameters {
            $($(#[$sentence])+ #[serde(rename = $key)] $law(<$formula as Listed>::Parameters)),*
        }

        impl Parameters {
            /// The law; or `None`, and `problems` of the keys below `path`.
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
                }
            }
        }

        impl Law for Material {
            $crate::law_of_variants!(Self: $($law),*);

            fn shipped(&self) -> Option<&Material> {
                Some(self)
            }
        }

        impl Material {
            /// Every law with its name: what tests and studies run over. At small strain all are Hooke's law of Λ and G,
            /// and fibres beside it.
            pub fn examples(lame: Lame) -> Vec<(&'static str, Self)> {
                vec![$((<$formula>::NAME, Self::$law(Listed::example(lame)))),*]
            }

            /// Calls `visitor` with the law, by a type that leaves no branch in a loop over particles.
            pub(crate) fn with<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self { $(Self::$law(law) => visitor.visit(law.clone())),* }
            }
        }

        $(impl From<$formula> for Material {
            fn from(law: $formula) -> Self {
                Self::$law(law)
            }
        })*
    };
}

// The list of laws: the sentence of the manual, the key of scenes, the type. CONTRIBUTING.md says what else a shipped law touches.
materials! {
    /// Neo-Hookean with Ciarlet's volumetric energy Λ/4 (J² − 1) − Λ/2 ln J: the paper's law.
    "neo_hookean" => NeoHookean(NeoHookean<Ciarlet>);
    /// Neo-Hookean with the volumetric energy Λ/2 (ln J)².
    "neo_hookean_logarithmic" => NeoHookeanLogarithmic(NeoHookean<Logarithmic>);
    /// St. Venant–Kirchhoff: linear in the Green–Lagrange strain; not for strong compression.
    "st_venant_kirchhoff" => StVenantKirchhoff(StVenantKirchhoff);
    /// Rubber: Mooney and Rivlin's solid, with the two invariants of C, compressible.
    "mooney_rivlin" => MooneyRivlin(MooneyRivlin);
    /// Rubber: Ogden's solid, with powers of the principal stretches, compressible.
    "ogden" => Ogden(Ogden);
    /// Tissue, reinforced rubber: one family of fibres in an elastic matrix; they bear tension alone.
    "fibre_reinforced" => FibreReinforced(FibreReinforced);
    /// Maxwell branches beside an elastic law, at finite strain.
    "viscoelastic" => Viscoelastic(Viscoelastic);
    /// Metal: linear elasticity in logarithmic strains, and flow at a von Mises stress that may harden.
    "von_mises" => VonMises(Plastic<VonMises>);
    /// Soil: linear elasticity in logarithmic strains, and Drucker and Prager's cone: cohesion, friction, dilatancy.
    "drucker_prager" => DruckerPrager(Plastic<DruckerPrager>);
}
