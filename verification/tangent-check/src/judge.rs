//! Verdicts: a claimed tangent beside the measured one, and the negative control.
