//! States and paths on which laws are checked.
