//! The list of the particle fields that a run can show, shared by scenes and output.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Declares the fields, each with its doc comment, its name in scenes and files, and its kind.
macro_rules! fields {
    ($($(#[$sentence:meta])+ $name:literal => $field:ident: $kind:ident;)+) => {
        /// A quantity that every particle has.
        ///
        /// Vectors and tensors are given in three dimensions whatever `D` is. The missing stretches are 1, so the missing components of
        /// displacement, velocity and strain are 0. The out-of-plane normal stress is that of plane (uniaxial) strain.
        #[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
        pub enum Field {
            $($(#[$sentence])+ #[serde(rename = $name)] $field,)+
            /// The internal variable of this name; 0 in bodies whose law does not have it. An unknown name is
            /// answered by the names that the laws have.
            #[serde(rename = "internal")]
            Internal(String),
        }

        impl Field {
            /// All fields but the internal variables.
            pub const ALL: &[Self] = &[$(Self::$field),+];

            /// The name in files, and in scenes, where an internal variable is `{"internal": name}`.
            ///
            /// ```
            /// use bfree::field::Field;
            ///
            /// // Scenes and files use the same name.
            /// let read: Field = serde_json::from_str(r#""von_mises""#)?;
            /// assert_eq!(read, Field::VonMises);
            /// assert_eq!(read.name(), "von_mises");
            /// # Ok::<(), serde_json::Error>(())
            /// ```
            pub fn name(&self) -> &str {
                match self {
                    $(Self::$field => $name,)+
                    Self::Internal(name) => name,
                }
            }

            /// The kind of its components.
            ///
            /// ```
            /// use bfree::field::{Field, Kind};
            ///
            /// // F is not symmetric, E is.
            /// assert_eq!((Field::DeformationGradient.kind(), Field::Strain.kind()), (Kind::Tensor, Kind::Symmetric));
            /// ```
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$field => Kind::$kind,)+
                    Self::Internal(_) => Kind::Scalar,
                }
            }
        }
    };
}

fields! {
    /// Position x.
    "position" => Position: Vector;
    /// Displacement from the position at the start of the run.
    "displacement" => Displacement: Vector;
    /// Velocity v.
    "velocity" => Velocity: Vector;
    /// Acceleration a.
    "acceleration" => Acceleration: Vector;
    /// Deformation gradient F.
    "deformation_gradient" => DeformationGradient: Tensor;
    /// J = det F, the present volume over the reference volume.
    "jacobian" => Jacobian: Scalar;
    /// Green-Lagrange strain E = (FᵀF - I) / 2.
    "strain" => Strain: Symmetric;
    /// Cauchy stress, with the out-of-plane normal stress.
    "stress" => Stress: Symmetric;
    /// Principal values of the Cauchy stress, the largest first; tension is positive.
    "principal_stress" => PrincipalStress: Principal;
    /// Pressure, minus a third of the trace of the Cauchy stress; positive in compression.
    "pressure" => Pressure: Scalar;
    /// Von Mises equivalent of the Cauchy stress.
    "von_mises" => VonMises: Scalar;
    /// Strain energy per reference volume.
    "energy_density" => EnergyDensity: Scalar;
    /// Accumulated plastic strain; 0 for laws without plastic flow.
    "plastic_strain" => PlasticStrain: Scalar;
    /// Energy per reference volume dissipated by plastic flow and relaxation; 0 for elastic laws.
    "dissipated_density" => DissipatedDensity: Scalar;
    /// Mass.
    "mass" => Mass: Scalar;
    /// Reference volume.
    "volume" => Volume: Scalar;
    /// Number of the body, from 0.
    "body" => Body: Index;
}

/// The components of a field, and their meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One number.
    Scalar,
    /// One whole number, ≥ 0.
    Index,
    /// x, y, z
    Vector,
    /// The three principal values of a tensor, the largest first.
    Principal,
    /// xx, yy, zz, xy, yz, xz
    Symmetric,
    /// xx, xy, xz, yx, yy, yz, zx, zy, zz
    Tensor,
}

impl Kind {
    /// Names of the components. The name of a scalar's component is empty.
    ///
    /// ```
    /// use bfree::field::Kind;
    ///
    /// // A symmetric tensor has D (D + 1)/2 components, and is always given in three dimensions.
    /// assert_eq!(Kind::Symmetric.components().len(), 3 * (3 + 1) / 2);
    /// assert_eq!(Kind::Vector.components(), ["x", "y", "z"]);
    /// ```
    pub const fn components(self) -> &'static [&'static str] {
        match self {
            Self::Scalar | Self::Index => &[""],
            Self::Vector => &["x", "y", "z"],
            Self::Principal => &["1", "2", "3"],
            Self::Symmetric => &["xx", "yy", "zz", "xy", "yz", "xz"],
            Self::Tensor => &["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"],
        }
    }
}

impl Field {
    /// Whether particles have the field only if bodies have inertia.
    pub(crate) const fn needs_inertia(&self) -> bool {
        matches!(self, Self::Velocity | Self::Acceleration)
    }

    /// The columns that hold the field in a table, for a run in `dimension` dimensions. A scalar has the column `name`. A vector has
    /// `name_x`, … for its first `dimension` components. Principal values have `name_1`, …, and a tensor has `name_xx`, … for all
    /// components.
    pub(crate) fn columns(&self, name: &str, dimension: usize) -> Vec<String> {
        let count = if self.kind() == Kind::Vector { dimension } else { usize::MAX };
        self.kind().components().iter().take(count).map(|component| column(name, component)).collect()
    }
}

/// The column that holds a component of `name`.
pub(crate) fn column(name: &str, component: &str) -> String {
    if component.is_empty() { name.to_owned() } else { format!("{name}_{component}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vector_has_a_column_for_each_dimension() {
        assert_eq!(Field::Velocity.columns("tip", 2), ["tip_x", "tip_y"]);
        assert_eq!(Field::Jacobian.columns("tip", 2), ["tip"]);
    }
}
