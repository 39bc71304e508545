//! Frequent mistakes, compared with a wrong tangent.
