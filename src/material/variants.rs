//! The methods of an enum of laws.

/// The methods of [`Law`](crate::material::Law) except `shipped`, for an enum whose variants are laws. Used inside `impl Law`, each method
/// calls the law of the active variant.
///
/// ```
/// use bfree::material::{Lame, Law, MaterialState, NeoHookean, StVenantKirchhoff};
/// use bfree::tensor::Tensor;
///
/// enum Mine {
///     Soft(NeoHookean),
///     Hard(StVenantKirchhoff),
/// }
///
/// impl Law for Mine {
///     bfree::law_of_variants!(Self: Soft, Hard);
/// }
///
/// let lame = Lame::new(1.0, 1.0)?;
/// let (soft, at) = (NeoHookean::ciarlet(lame), MaterialState::new(Tensor::<f64, 1>::from_element(0.1)));
/// assert_eq!(Mine::Soft(soft).stress(&at), soft.stress(&at));
/// # assert!(Mine::Hard(StVenantKirchhoff { lame }).internal_variables().is_empty());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[macro_export]
macro_rules! law_of_variants {
    (Self: $($variant:ident),+) => {
        fn energy<T: $crate::scalar::Real, const D: usize>(&self, at: &$crate::material::MaterialState<T, D>) -> T {
            match self { $(Self::$variant(law) => $crate::material::Law::energy(law, at)),+ }
        }
        fn stress<T: $crate::scalar::Real, const D: usize>(
            &self,
            at: &$crate::material::MaterialState<T, D>,
        ) -> $crate::tensor::Tensor<T, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::stress(law, at)),+ }
        }
        fn elasticity<const D: usize>(
            &self,
            at: &$crate::material::MaterialState<f64, D>,
            x: &$crate::tensor::Tensor<f64, D>,
        ) -> $crate::tensor::Tensor<f64, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::elasticity(law, at, x)),+ }
        }
        fn tangent_density<const D: usize>(
            &self,
            at: &$crate::material::MaterialState<f64, D>,
            v: &$crate::tensor::Vector<f64, D>,
            b: &$crate::tensor::Vector<f64, D>,
        ) -> $crate::tensor::Tensor<f64, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::tangent_density(law, at, v, b)),+ }
        }
        fn tangent_blocks<const D: usize>(
            &self,
            f_r: &$crate::tensor::Tensor<f64, D>,
            at: &$crate::material::MaterialState<f64, D>,
        ) -> $crate::material::TangentBlocks<D> {
            match self { $(Self::$variant(law) => $crate::material::Law::tangent_blocks(law, f_r, at)),+ }
        }
        fn closed<const D: usize>(
            &self,
            f_r: &$crate::tensor::Tensor<f64, D>,
            at: &$crate::material::MaterialState<f64, D>,
            volume: f64,
        ) -> Option<$crate::material::ClosedTangent<f64, D>> {
            match self { $(Self::$variant(law) => $crate::material::Law::closed(law, f_r, at, volume)),+ }
        }
        fn volumetric<T: $crate::scalar::Real>(
            &self,
            at: &$crate::tensor::Deformation<T, 1>,
        ) -> Option<$crate::material::VolumeResponse<T>> {
            match self { $(Self::$variant(law) => $crate::material::Law::volumetric(law, at)),+ }
        }
        fn internal_variables(&self) -> &[$crate::material::InternalVariable] {
            match self { $(Self::$variant(law) => $crate::material::Law::internal_variables(law)),+ }
        }
        fn update_variables<const D: usize>(&self, at: &$crate::material::MaterialState<f64, D>, variables: &mut [f64]) {
            match self { $(Self::$variant(law) => $crate::material::Law::update_variables(law, at, variables)),+ }
        }
        fn is_symmetric(&self) -> bool {
            match self { $(Self::$variant(law) => $crate::material::Law::is_symmetric(law)),+ }
        }
        fn has_potential(&self) -> bool {
            match self { $(Self::$variant(law) => $crate::material::Law::has_potential(law)),+ }
        }
        fn check_claim<const D: usize>(&self, at: &$crate::material::MaterialState<f64, D>) -> Result<(), String> {
            match self { $(Self::$variant(law) => $crate::material::Law::check_claim(law, at)),+ }
        }
        fn last_failure(&self) -> Option<String> {
            match self { $(Self::$variant(law) => $crate::material::Law::last_failure(law)),+ }
        }
    };
}
