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
        $crate::law_of_variants! { @methods [$($variant),+]
            fn energy[T: $crate::scalar::Real, const D: usize](at: &$crate::material::MaterialState<T, D>) -> T;
            fn stress[T: $crate::scalar::Real, const D: usize](
                at: &$crate::material::MaterialState<T, D>
            ) -> $crate::tensor::Tensor<T, D>;
            fn elasticity[const D: usize](
                at: &$crate::material::MaterialState<f64, D>,
                x: &$crate::tensor::Tensor<f64, D>
            ) -> $crate::tensor::Tensor<f64, D>;
            fn tangent_density[const D: usize](
                at: &$crate::material::MaterialState<f64, D>,
                v: &$crate::tensor::Vector<f64, D>,
                b: &$crate::tensor::Vector<f64, D>
            ) -> $crate::tensor::Tensor<f64, D>;
            fn tangent_blocks[const D: usize](
                f_r: &$crate::tensor::Tensor<f64, D>,
                at: &$crate::material::MaterialState<f64, D>
            ) -> $crate::material::TangentBlocks<D>;
            fn closed[T: $crate::scalar::Real, const D: usize](
                f_r: &$crate::tensor::Tensor<T, D>,
                at: &$crate::material::MaterialState<T, D>,
                volume: T
            ) -> Option<$crate::material::ClosedTangent<T, D>>;
            fn volumetric[T: $crate::scalar::Real](
                at: &$crate::tensor::Deformation<T, 1>
            ) -> Option<$crate::material::VolumeResponse<T>>;
            fn internal_variables[]() -> &[$crate::material::InternalVariable];
            fn update_variables[const D: usize](
                at: &$crate::material::MaterialState<f64, D>,
                variables: &mut [f64]
            ) -> ();
            fn is_symmetric[]() -> bool;
            fn has_potential[]() -> bool;
            fn check_claim[const D: usize](at: &$crate::material::MaterialState<f64, D>) -> Result<(), String>;
            fn last_failure[]() -> Option<String>;
        }
    };
    (@methods $variants:tt $(fn $method:ident[$($generics:tt)*]($($name:ident: $type:ty),*) -> $out:ty;)+) => {
        // A name of one expansion is unknown in another one, so `law` is handed over.
        $($crate::law_of_variants! {
            @method $variants law fn $method[$($generics)*]($($name: $type),*) -> $out { (law, $($name),*) }
        })+
    };
    (@method [$($variant:ident),+] $law:ident fn $method:ident[$($generics:tt)*]($($parameters:tt)*) -> $out:ty { $call:tt }) => {
        fn $method<$($generics)*>(&self, $($parameters)*) -> $out {
            match self { $(Self::$variant($law) => $crate::material::Law::$method $call),+ }
        }
    };
}
