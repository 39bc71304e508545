//! The methods of an enum of laws.

/// The methods of [`Law`](crate::material::Law) except `shipped`, for an enum whose variants are laws. Used inside `impl Law`, each method
/// calls the law of the active variant.
///
/// ```
/// use bfree::material::{Lame, Law, NeoHookean, StVenantKirchhoff, Start};
/// use bfree::tensor::{Deformation, Tensor};
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
/// let (soft, at) = (NeoHookean::ciarlet(lame), Deformation::<f64, 1>::new(Tensor::from_element(0.1)));
/// assert_eq!(Mine::Soft(soft).stress(&at, &Start::NONE), Law::stress(&soft, &at, &Start::NONE));
/// # assert!(Mine::Hard(StVenantKirchhoff { lame }).memory().is_empty());
/// # Ok::<(), bfree::material::LameError>(())
/// ```
#[macro_export]
macro_rules! law_of_variants {
    (Self: $($variant:ident),+) => {
        fn memory(&self) -> &[$crate::material::Remembered] {
            match self { $(Self::$variant(law) => $crate::material::Law::memory(law)),+ }
        }
        fn is_symmetric(&self) -> bool {
            match self { $(Self::$variant(law) => $crate::material::Law::is_symmetric(law)),+ }
        }
        fn has_potential(&self) -> bool {
            match self { $(Self::$variant(law) => $crate::material::Law::has_potential(law)),+ }
        }
        fn energy<T: $crate::scalar::Real, const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<T, D>,
            start: &$crate::material::Start<'_>,
        ) -> T {
            match self { $(Self::$variant(law) => $crate::material::Law::energy(law, at, start)),+ }
        }
        fn stress<T: $crate::scalar::Real, const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<T, D>,
            start: &$crate::material::Start<'_>,
        ) -> $crate::tensor::Tensor<T, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::stress(law, at, start)),+ }
        }
        fn elasticity<T: $crate::scalar::Real, const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<T, D>,
            start: &$crate::material::Start<'_>,
            x: &$crate::tensor::Tensor<T, D>,
        ) -> $crate::tensor::Tensor<T, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::elasticity(law, at, start, x)),+ }
        }
        fn tangent_density<T: $crate::scalar::Real, const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<T, D>,
            start: &$crate::material::Start<'_>,
            v: &$crate::tensor::Vector<T, D>,
            b: &$crate::tensor::Vector<T, D>,
        ) -> $crate::tensor::Tensor<T, D> {
            match self { $(Self::$variant(law) => $crate::material::Law::tangent_density(law, at, start, v, b)),+ }
        }
        fn volumetric<T: $crate::scalar::Real>(
            &self,
            at: &$crate::tensor::Deformation<T, 1>,
        ) -> Option<$crate::material::VolumeResponse<T>> {
            match self { $(Self::$variant(law) => $crate::material::Law::volumetric(law, at)),+ }
        }
        fn closed<const D: usize>(
            &self,
            f_n: &$crate::tensor::Tensor<f64, D>,
            at: &$crate::tensor::Deformation<f64, D>,
            volume: f64,
        ) -> Option<$crate::material::ClosedTangent<f64, D>> {
            match self { $(Self::$variant(law) => $crate::material::Law::closed(law, f_n, at, volume)),+ }
        }
        fn tangent_blocks<const D: usize>(
            &self,
            f_n: &$crate::tensor::Tensor<f64, D>,
            at: &$crate::tensor::Deformation<f64, D>,
            start: &$crate::material::Start<'_>,
        ) -> [[$crate::tensor::Tensor<f64, D>; D]; D] {
            match self { $(Self::$variant(law) => $crate::material::Law::tangent_blocks(law, f_n, at, start)),+ }
        }
        fn remember<const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<f64, D>,
            start: &$crate::material::Start<'_>,
            next: &mut [f64],
        ) {
            match self { $(Self::$variant(law) => $crate::material::Law::remember(law, at, start, next)),+ }
        }
        fn out_of_plane_stress<const D: usize>(
            &self,
            at: &$crate::tensor::Deformation<f64, D>,
            start: &$crate::material::Start<'_>,
        ) -> f64 {
            match self { $(Self::$variant(law) => $crate::material::Law::out_of_plane_stress(law, at, start)),+ }
        }
    };
}
