//! Laws for the tests, over dual numbers, so that their tangents are exact to round-off.
#![allow(dead_code, missing_docs)]

pub mod dual;
pub mod exact;
pub mod planted;
pub mod right;
pub mod shipped;
