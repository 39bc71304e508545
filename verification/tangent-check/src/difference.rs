//! Extrapolated differences of a vector function of one variable, with their own error.
