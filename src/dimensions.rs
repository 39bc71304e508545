//! The dimension of a scene is a number. The dimension of a simulation is a type.

/// The expression with the constant `$D` in place of a number of dimensions: `in_dimensions!(scene.dimension(), D => build::<D>())`.
macro_rules! in_dimensions {
    ($dimension:expr, $D:ident => $call:expr) => {
        match $dimension {
            1 => in_dimensions!(@of 1, $D => $call),
            2 => in_dimensions!(@of 2, $D => $call),
            _ => in_dimensions!(@of 3, $D => $call),
        }
    };
    (@of $number:literal, $D:ident => $call:expr) => {{
        const $D: usize = $number;
        $call
    }};
}
