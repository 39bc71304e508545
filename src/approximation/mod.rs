//! Shape functions N and ∇N: one file a family, one list ([`Approximation`]).
