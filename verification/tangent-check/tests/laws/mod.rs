//! Laws for the tests, over dual numbers, so that their tangents are exact to round-off.
#![allow(dead_code, missing_docs)]

pub mod dual;
pub mod shipped;
