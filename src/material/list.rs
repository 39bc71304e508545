//! The list of shipped laws, from which [`Material`] and [`Parameters`] are made.

use super::{
    Ciarlet, ClosedTangent, DruckerPrager, Lame, Law, Logarithmic, MooneyRivlin, NeoHookean, Ogden, Plastic,
    Remembered, StVenantKirchhoff, Start, Viscoelastic, VolumeResponse, VonMises,
};
use crate::problems::Problems;
use crate::scalar::Real;
use crate::tensor::{Deformation, Tensor, Vector};
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

    /// A member that is Hooke's law of Λ and G at small strain, with other constants as it likes: what tests and studies take.
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
            fn memory(&self) -> &[Remembered] {
                match self { $(Self::$law(law) => law.memory()),* }
            }
            fn is_symmetric(&self) -> bool {
                match self { $(Self::$law(law) => law.is_symmetric()),* }
            }
            fn has_potential(&self) -> bool {
                match self { $(Self::$law(law) => law.has_potential()),* }
            }
            fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> T {
                match self { $(Self::$law(law) => Law::energy(law, at, start)),* }
            }
            fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>, start: &Start<'_>) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::stress(law, at, start)),* }
            }
            fn elasticity<T: Real, const D: usize>(
                &self, at: &Deformation<T, D>, start: &Start<'_>, x: &Tensor<T, D>,
            ) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::elasticity(law, at, start, x)),* }
            }
            fn tangent_density<T: Real, const D: usize>(
                &self, at: &Deformation<T, D>, start: &Start<'_>, v: &Vector<T, D>, b: &Vector<T, D>,
            ) -> Tensor<T, D> {
                match self { $(Self::$law(law) => Law::tangent_density(law, at, start, v, b)),* }
            }
            fn volumetric<T: Real>(&self, at: &Deformation<T, 1>) -> Option<VolumeResponse<T>> {
                match self { $(Self::$law(law) => Law::volumetric(law, at)),* }
            }
            fn closed<const D: usize>(
                &self, f_n: &Tensor<f64, D>, at: &Deformation<f64, D>, volume: f64,
            ) -> Option<ClosedTangent<f64, D>> {
                match self { $(Self::$law(law) => Law::closed(law, f_n, at, volume)),* }
            }
            fn tangent_blocks<const D: usize>(
                &self, f_n: &Tensor<f64, D>, at: &Deformation<f64, D>, start: &Start<'_>,
            ) -> [[Tensor<f64, D>; D]; D] {
                match self { $(Self::$law(law) => law.tangent_blocks(f_n, at, start)),* }
            }
            fn remember<const D: usize>(&self, at: &Deformation<f64, D>, start: &Start<'_>, next: &mut [f64]) {
                match self { $(Self::$law(law) => law.remember(at, start, next)),* }
            }
            fn shipped(&self) -> Option<&Material> {
                Some(self)
            }
        }

        impl Material {
            /// Every law with its name: what tests and studies run over. At small strain all are Hooke's law of Λ and G.
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
    /// Maxwell branches beside an elastic law, at finite strain.
    "viscoelastic" => Viscoelastic(Viscoelastic);
    /// Metal: linear elasticity in logarithmic strains, and flow at a von Mises stress that may harden.
    "von_mises" => VonMises(Plastic<VonMises>);
    /// Soil: linear elasticity in logarithmic strains, and Drucker and Prager's cone: cohesion, friction, dilatancy.
    "drucker_prager" => DruckerPrager(Plastic<DruckerPrager>);
}
