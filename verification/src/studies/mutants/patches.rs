//! The faults put into the shipped files, with the checks that must see them.

/// A check of the patched copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Check {
    /// A study of this program.
    Study(&'static str),
    /// A module of the library's test program, by the beginning of its tests' names.
    Test(&'static str),
}

impl Check {
    /// What it is called on the command line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Study(name) | Self::Test(name) => name,
        }
    }
}

const TANGENT: Check = Check::Study("tangent");
const PATCH: Check = Check::Study("patch");
const BALANCE: Check = Check::Study("balance");
const DIGITS: Check = Check::Study("digits");
const OPERATOR: Check = Check::Study("operator");
const DYNAMICS: Check = Check::Test("dynamics::");
const POINTS: Check = Check::Test("points::");
const LOADS: Check = Check::Test("loads::");
const SHAPES: Check = Check::Test("approximation::");
const SMOOTH: Check = Check::Test("smoothing::");

/// All checks that a patch can name.
pub(super) const CHECKS: &[Check] = &[TANGENT, PATCH, BALANCE, DIGITS, OPERATOR, DYNAMICS, POINTS, LOADS, SHAPES, SMOOTH];

/// What is to become of a patch.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fate {
    /// Each of the first must fail; the others, which look at something else, must still pass.
    Killed(&'static [Check], &'static [Check]),
    /// The program computes the same, for this reason: all checks must pass.
    Equivalent(&'static str),
}

/// A fault: a piece of a shipped file, there exactly once, and what takes its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub name: &'static str,
    pub file: &'static str,
    pub find: &'static str,
    pub replace: &'static str,
    pub fate: Fate,
}

const fn patch(
    name: &'static str,
    file: &'static str,
    find: &'static str,
    replace: &'static str,
    fate: Fate,
) -> Patch {
    Patch { name, file, find, replace, fate }
}

const PARTICLE: &str = "src/mechanics/point.rs";
const RESIDUAL: &str = "src/mechanics/residual.rs";
const PRODUCT: &str = "src/mechanics/tangent.rs";
const TRANSFER: &str = "src/mechanics/transfer.rs";
const SMOOTHING: &str = "src/mechanics/smoothing.rs";
const SINGLE: &str = "src/mechanics/single.rs";
const NEWMARK: &str = "src/mechanics/time.rs";
const LOADING: &str = "src/mechanics/loads.rs";
const STEP: &str = "src/simulation.rs";
const NEO_HOOKEAN: &str = "src/material/neo_hookean.rs";
const KIRCHHOFF: &str = "src/material/st_venant_kirchhoff.rs";
const CLOSED: &str = "src/material/closed_tangent.rs";
const FROM_ENERGY: &str = "src/material/from_energy.rs";
const MATERIAL: &str = "src/material/mod.rs";
const TENSOR: &str = "src/tensor.rs";

use Fate::{Equivalent, Killed};

/// The list. A statement ends in `;` on both sides or is replaced by `{}`; all else is an expression.
#[rustfmt::skip]
pub(super) const PATCHES: &[Patch] = &[
    patch("R without the consistent inertia", RESIDUAL,
        "T::lit(self.alphas.a1 * m) * (dphi[i] - T::lit(self.predicted[p][i]))",
        "T::zero()",
        Killed(&[TANGENT, BALANCE], &[DYNAMICS])),
    patch("R without the lumped inertia", RESIDUAL,
        "motion.map_or_else(Vector::zeros, |(m, a)| a * m)",
        "motion.map_or_else(Vector::zeros, |(_, a)| a * T::zero())",
        Killed(&[TANGENT, DYNAMICS, BALANCE], &[POINTS])),
    patch("+ a3 a_n in the acceleration", NEWMARK,
        "v * self.dt + a * (self.a3 / self.a1)",
        "v * self.dt - a * (self.a3 / self.a1)",
        Killed(&[DYNAMICS, BALANCE], &[TANGENT])),
    patch("a2 and a3 swapped", NEWMARK,
        "v * self.dt + a * (self.a3 / self.a1)",
        "a * self.dt + v * (self.a3 / self.a1)",
        Killed(&[DYNAMICS, BALANCE], &[TANGENT])),
    patch("transposed F_n in the internal force", PARTICLE,
        "(piola * f_n_t)",
        "(piola * f_n_t.transpose())",
        Killed(&[TANGENT, DYNAMICS], &[POINTS, BALANCE])),
    patch("F without G H_n", PARTICLE,
        "g + h_n + g * h_n",
        "g + h_n",
        Killed(&[TANGENT, PATCH, DYNAMICS], &[POINTS, BALANCE])),
    patch("sign of the follower pressure", RESIDUAL,
        "out[node] += force * T::lit(n);",
        "out[node] += force * T::lit(-n);",
        Killed(&[TANGENT, LOADS], &[DYNAMICS])),
    patch("follower pressure by F for cof F", RESIDUAL,
        "cofactor(&f) * point.force.map(T::lit)",
        "f * point.force.map(T::lit)",
        Killed(&[TANGENT], &[DYNAMICS])),
    patch("prescribed values not cleared", RESIDUAL,
        "field[dof.node][dof.component] = T::zero();",
        "let _ = dof;",
        Killed(&[DYNAMICS, TANGENT], &[POINTS])),
    patch("eps for 1 - eps in the consistent inertia", RESIDUAL,
        "(1.0 - self.lumping) * self.particles.mass[p]",
        "self.lumping * self.particles.mass[p]",
        Killed(&[BALANCE], &[TANGENT, DYNAMICS])),
    patch("a4 for a1 in the inertia's formula", PRODUCT,
        "u * (self.alphas.a1 * self.consistent_mass(p).unwrap_or(0.0))",
        "u * (self.alphas.a4 * self.consistent_mass(p).unwrap_or(0.0))",
        Killed(&[TANGENT], &[DYNAMICS, BALANCE])),
    patch("L for L F_n in the geometric term", PRODUCT,
        "delta_f * law.stress(at)",
        "l * law.stress(at)",
        Killed(&[TANGENT, DYNAMICS], &[POINTS])),
    patch("F for its transpose in the material term", PRODUCT,
        "law.elasticity(at, &(at.f.transpose() * delta_f))",
        "law.elasticity(at, &(at.f * delta_f))",
        Killed(&[TANGENT, DYNAMICS], &[POINTS])),
    patch("reactions left in Newton's residual", PRODUCT,
        "self.clear_prescribed(residual);",
        "{}",
        Killed(&[DYNAMICS], &[TANGENT])),
    patch("prescribed rows left in the product", PRODUCT,
        "eq.clear_prescribed(out);",
        "{}",
        Killed(&[TANGENT], &[POINTS])),
    patch("diagonal blocks without the material", PRODUCT,
        "eq.supports.add_blocks(tangents, &mut blocks)",
        "()",
        Killed(&[TANGENT], &[POINTS])),
    patch("sign of the pressure's diagonal blocks", PRODUCT,
        "outer(&self.force, &g) - outer(&g, &self.force)",
        "outer(&g, &self.force) - outer(&self.force, &g)",
        Killed(&[TANGENT], &[POINTS])),
    patch("1/F for its transpose in the pressure's tangent", PRODUCT,
        "f_inv_t * self.f_n(p).transpose()",
        "f_inv_t.transpose() * self.f_n(p).transpose()",
        Killed(&[TANGENT], &[DYNAMICS])),
    patch("sign in the pressure's tangent", PRODUCT,
        "w * contract(a, &l) - a * (l.transpose() * w)",
        "w * contract(a, &l) + a * (l.transpose() * w)",
        Killed(&[TANGENT], &[DYNAMICS])),
    patch("another limit of singular diagonal blocks", PRODUCT,
        "determinant(&unit).abs() > 1e-12",
        "determinant(&unit).abs() > 1e-9",
        Equivalent("only the preconditioner of ill-shaped blocks")),
    patch("eps for 1 - eps in the projection", TRANSFER,
        "at_particles[p] * ((1.0 - self.lumping) * self.particles.mass[p])",
        "at_particles[p] * (self.lumping * self.particles.mass[p])",
        Killed(&[BALANCE], &[DYNAMICS])),
    patch("another diagonal of the projection's mass", TRANSFER,
        "(1.0 - lumping) * particles.mass[p] * n * n",
        "(1.0 - lumping) * particles.mass[p] * n",
        Equivalent("only the preconditioner of the projection")),
    patch("velocities on nodes without mass", TRANSFER,
        "m < light",
        "false",
        Killed(&[BALANCE], &[DYNAMICS])),
    patch("v for v - v_n in (51)", NEWMARK,
        "bent * self.a4 + a * self.a6",
        "bent * self.a4 + v + a * self.a6",
        Killed(&[DYNAMICS, BALANCE, PATCH], &[TANGENT])),
    patch("a3 for a3 + 1 in (50)", NEWMARK,
        "a * (self.a3 + 1.0)",
        "a * self.a3",
        Killed(&[DYNAMICS, BALANCE], &[TANGENT])),
    patch("moving walls treated as resting ones", TRANSFER,
        "!dof.moving && walls == WallUpdate::Literal",
        "walls == WallUpdate::Literal",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("moving walls leave the velocity of the step's start", TRANSFER,
        "dof.step.velocity_end - projected.velocity[node][i]",
        "dof.step.velocity_start - projected.velocity[node][i]",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("the blow of a wall forgets what the forces give", TRANSFER,
        "nodal.mass[node] * (*delta_v - by_forces)",
        "nodal.mass[node] * *delta_v",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("no blow in reactions and work", STEP,
        "impulse / dt",
        "0.0 * impulse",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("loads at t = 0 push the wrong way at first", TRANSFER,
        "-r / m",
        "r / m",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("smoothing by a share of the step, not at a rate", SMOOTHING,
        "-(-self.rate * dt).exp_m1()",
        "(self.rate * dt).min(1.0)",
        Killed(&[SMOOTH], &[DYNAMICS])),
    patch("kinks are where the velocity is, not its curvature", SMOOTHING,
        "(v - v_twice).norm_squared()",
        "v.norm_squared()",
        Killed(&[SMOOTH], &[DYNAMICS])),
    patch("single precision forgets the share of lumping", SINGLE,
        "(weight / scale) as f32",
        "(weight / (self.lumping * scale)) as f32",
        Killed(&[OPERATOR], &[TANGENT, DYNAMICS])),
    patch("smoothing towards a sum that is no mean", SMOOTHING,
        "field[p] * particles.mass[p]",
        "field[p]",
        Killed(&[SMOOTH], &[DYNAMICS])),
    patch("smoothing takes the velocity for the acceleration", TRANSFER,
        "[&particles.velocity, &particles.acceleration].map(|field| change(field))",
        "[&particles.velocity, &particles.velocity].map(|field| change(field))",
        Killed(&[SMOOTH], &[DYNAMICS])),
    patch("particles move backwards", TRANSFER,
        "position[p] += delta_x;",
        "position[p] -= delta_x;",
        Killed(&[PATCH, DYNAMICS, BALANCE], &[TANGENT])),
    patch("gamma for gamma/2 in a6", NEWMARK,
        "(1.0 - gamma / (2.0 * beta)) * dt",
        "(1.0 - gamma / beta) * dt",
        Killed(&[DYNAMICS, BALANCE], &[TANGENT])),
    patch("1 for gamma in a4", NEWMARK,
        "gamma / (beta * dt)",
        "1.0 / (beta * dt)",
        Killed(&[DYNAMICS, BALANCE], &[TANGENT])),
    patch("sign of the traction", LOADING,
        "force[node] += traction * (point.area * n);",
        "force[node] -= traction * (point.area * n);",
        Killed(&[LOADS, BALANCE], &[TANGENT, DYNAMICS])),
    patch("traction without its area", LOADING,
        "force[node] += traction * (point.area * n);",
        "force[node] += traction * n;",
        Killed(&[BALANCE], &[TANGENT, DYNAMICS])),
    patch("pressure without its area", LOADING,
        "point.normal * (pressure * point.area)",
        "point.normal * pressure",
        Killed(&[LOADS], &[DYNAMICS, BALANCE])),
    patch("a wall's velocity not integrated", LOADING,
        "g.integral(t, t + dt)",
        "g.value(t) * dt",
        Killed(&[LOADS], &[TANGENT, DYNAMICS])),
    patch("gravity without its curve", LOADING,
        "gravity.acceleration * gravity.curve.value(t)",
        "gravity.acceleration",
        Killed(&[BALANCE], &[TANGENT, DYNAMICS])),
    patch("sign of a_n in the work of moving walls", STEP,
        "Alphas::START",
        "Alphas { a3: 1.0, ..Alphas::START }",
        Killed(&[LOADS], &[DYNAMICS])),
    patch("sign of q in the frozen tangent", CLOSED,
        "with.mul_sub(q_a_lt[j], a[j][k], sum)",
        "with.mul_add(q_a_lt[j], a[j][k], sum)",
        Killed(&[TANGENT, DYNAMICS], &[POINTS])),
    patch("1/F for its transpose in the frozen neo-Hookean", NEO_HOOKEAN,
        "at.inverse_transpose() * f_n.transpose()",
        "at.inverse_transpose().transpose() * f_n.transpose()",
        Killed(&[TANGENT, DYNAMICS, POINTS, PATCH], &[DIGITS])),
    patch("C:X of the neo-Hookean without sym X", NEO_HOOKEAN,
        "scaled(&(c_inv * (x + x.transpose()) * c_inv), q)",
        "scaled(&(c_inv * x * c_inv), q + q)",
        Killed(&[TANGENT, DYNAMICS], &[POINTS])),
    patch("v and b swapped in the neo-Hookean's Cmat", NEO_HOOKEAN,
        "scaled(&outer(&cb, &cv), q)",
        "scaled(&outer(&cv, &cb), q)",
        Killed(&[POINTS], &[TANGENT, DYNAMICS])),
    patch("ln J for its square in W", NEO_HOOKEAN,
        "at.log_jacobian() * at.log_jacobian()",
        "at.log_jacobian()",
        Killed(&[TANGENT, DIGITS], &[POINTS])),
    patch("J for J^2 in the bulk stiffness", NEO_HOOKEAN,
        "T::lit(lambda) * at.jacobian * at.jacobian",
        "T::lit(lambda) * at.jacobian",
        Killed(&[TANGENT, POINTS, DYNAMICS], &[DIGITS])),
    patch("G for 2G in St. Venant and Kirchhoff's S and C", KIRCHHOFF,
        "scaled(x, T::lit(2.0) * shear)",
        "scaled(x, shear)",
        Killed(&[TANGENT, POINTS], &[DYNAMICS])),
    patch("diagonal blocks without the geometric part", CLOSED,
        "with.add(block[i][i], self.right[k][l])",
        "block[i][i]",
        Killed(&[TANGENT], &[POINTS])),
    patch("shear stress of an energy twice as large", FROM_ENERGY,
        "self.0.energy(&seeded(e, &direction(i, k))).eps",
        "self.0.energy(&seeded(e, &direction(i, k))).eps * T::lit(if i == k { 1.0 } else { 2.0 })",
        Killed(&[TANGENT], &[DYNAMICS, POINTS])),
    patch("P = S F for F S", MATERIAL,
        "f_left * law.stress(at)",
        "law.stress(at) * f_left",
        Killed(&[TANGENT, POINTS, DYNAMICS], &[DIGITS])),
    patch("a coefficient of the energy's series", TENSOR,
        "T::lit(1.0 / (2 * k + 1) as f64)",
        "T::lit(1.0 / (2 * k + 3) as f64)",
        Killed(&[TANGENT], &[DIGITS])),
    patch("ln J for ln(1 + j) at small j", TENSOR,
        "if k == 0 { self.j } else { self.jacobian * T::lit(scale) - T::one() }",
        "self.jacobian * T::lit(scale) - T::one()",
        Killed(&[DIGITS], &[TANGENT, POINTS, DYNAMICS])),
    patch("J^2 - 1 by J", TENSOR,
        "self.j * (T::lit(2.0) + self.j)",
        "self.jacobian * self.jacobian - T::one()",
        Killed(&[DIGITS, TANGENT], &[POINTS, DYNAMICS])),
    patch("j - ln(1 + j) by its difference", TENSOR,
        "s.value().abs() >= 0.2",
        "s.value().abs() >= 0.0",
        Killed(&[DIGITS, TANGENT], &[POINTS, DYNAMICS])),
    patch("sign in the plane cofactor", TENSOR,
        "if i == k { minor } else { -minor }",
        "minor",
        Killed(&[TANGENT, POINTS, SHAPES], &[DIGITS])),
    patch("H H^T in the strain", TENSOR,
        "(self.h.transpose() * self.h)",
        "(self.h * self.h.transpose())",
        Killed(&[TANGENT, POINTS, PATCH], &[DIGITS])),
    patch("sign of the max-ent gradients", "src/approximation/lme/separable.rs",
        "c(-1.0) / (j * c(spacing))",
        "c(1.0) / (j * c(spacing))",
        Killed(&[PATCH, SHAPES, POINTS], &[DIGITS])),
    patch("sign of the max-ent gradients on a circle", "src/approximation/lme/circle.rs",
        "inverse(&j) / -grid.spacing",
        "inverse(&j) / grid.spacing",
        Killed(&[PATCH, SHAPES, POINTS], &[DIGITS])),
    patch("slope of the cubic spline by 1e-6", "src/approximation/bspline.rs",
        "distance * (c(1.5) * d - c(2.0))",
        "distance * (c(1.5) * d - c(2.0)) * c(1.0 + 1e-6)",
        Killed(&[PATCH, SHAPES], &[POINTS])),
    patch("ghosts folded back once", "src/approximation/kernel.rs",
        "add(0, 2.0, at);",
        "add(0, 1.0, at);",
        Killed(&[PATCH, SHAPES], &[DYNAMICS])),
    patch("nodes with N = 0 left out", "src/approximation/product.rs",
        "value != 0.0 || gradient.iter().any(|&g| g != 0.0)",
        "value != 0.0",
        Killed(&[PATCH, SHAPES], &[DIGITS])),
    patch("edge of the GIMP function", "src/approximation/gimp.rs",
        "rest * rest / c(4.0 * l)",
        "rest * rest / c(2.0 * l)",
        Killed(&[PATCH, SHAPES, POINTS], &[DYNAMICS])),
    patch("hats of the wrong node", "src/approximation/interior.rs",
        "[values[M], values[M + 1]] = [above, below];",
        "[values[M], values[M + 1]] = [below, below];",
        Killed(&[PATCH, SHAPES, POINTS], &[DIGITS])),
];
