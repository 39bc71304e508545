//! The faults in the shipped files, with the check that must fail and the check that must still pass.
//!
//! The name of a fault stands in the sources, at the line with the fault: `mutant!("name": …)`. A test compares both lists of names.

/// A check that runs in a program of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Check {
    /// A study of this program.
    Study(&'static str),
    /// Tests of the library's test program, by a part of their names, such as that of their module.
    Test(&'static str),
    /// Unit tests of the library, by a part of their names.
    Unit(&'static str),
}

impl Check {
    /// The name on the command line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Study(name) | Self::Test(name) | Self::Unit(name) => name,
        }
    }
}

const TANGENT: Check = Check::Study("tangent");
const PATCH: Check = Check::Study("patch");
const BALANCE: Check = Check::Study("balance");
const DIGITS: Check = Check::Study("digits");
const OPERATOR: Check = Check::Study("operator");
const MEMORY: Check = Check::Study("memory");
const DYNAMICS: Check = Check::Test("dynamics::");
const POINTS: Check = Check::Test("points::");
const LOADS: Check = Check::Test("loads::");
const SHAPES: Check = Check::Test("approximation::");
const SWEEP: Check = Check::Test("sweep::");
const LAWS: Check = Check::Test("laws::");
const SCHEMES: Check = Check::Test("schemes::");
const SMOOTH: Check = Check::Test("smoothing::");
const LEVELS: Check = Check::Test("multigrid::");
const INCOMPRESSIBLE: Check = Check::Test("incompressible::");
const STATICS: Check = Check::Test("statics::");
const FOLLOWS: Check = Check::Test("aggregation::");
const PATHS: Check = Check::Test("path::");
const KEPT: Check = Check::Test("kept::");
const CARRIES: Check = Check::Test("carried::");
const TRANSFERS: Check = Check::Test("transfer::");
const DAMPED: Check = Check::Test("damping::");
const CELLS: Check = Check::Test("dilatation::");
const FLOWS: Check = Check::Test("flow::");
const BONDS: Check = Check::Test("contact::");
const RESTARTS: Check = Check::Test("restart::");
const TOUCHES: Check = Check::Study("contact");
const OBSTACLES: Check = Check::Test("obstacles::");
const BETWEEN: Check = Check::Test("between::");
const FREE: Check = Check::Test("rigid_bodies::");
const ENERGY: Check = Check::Study("energy");
const MEAN: Check = Check::Unit("mechanics::constitutive::discrete_gradient");
const CONTACT_LAW: Check = Check::Unit("mechanics::contact");
const SOLVER: Check = Check::Unit("solver::");
const SOLIDS: Check = Check::Unit("shape::");
const SPACE: Check = Check::Unit("space::");
const PARTICLES: Check = Check::Unit("particles::");
const STORED: Check = Check::Unit("checkpoint::");

/// A fault in a shipped file.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShippedFault {
    pub name: &'static str,
    /// The check that must fail.
    pub killed_by: Check,
    /// A check of other properties, which must still pass.
    pub spared_by: Check,
}

const fn fault(name: &'static str, killed_by: Check, spared_by: Check) -> ShippedFault {
    ShippedFault { name, killed_by, spared_by }
}

/// The list, in the order of the rooms of `docs/src/method.md`.
#[rustfmt::skip]
pub(super) const FAULTS: &[ShippedFault] = &[
    fault("sweep: component 0 gathered for all", OPERATOR, POINTS),
    fault("sweep: stresses along x scattered by N for its slope", OPERATOR, POINTS),
    fault("sweep: a plane of the scatter one node early", OPERATOR, POINTS),
    fault("sweep: the last lane of a full group is not scattered", OPERATOR, POINTS),
    fault("sweep: blocks by the wrong power of N_x", OPERATOR, POINTS),
    fault("sweep: a general tangent is transposed", TANGENT, POINTS),
    fault("sweep: blocks without the other half of a pair", TANGENT, POINTS),
    fault("sweep: a second body in a group takes the law of the first", LAWS, TANGENT),
    fault("sweep: several threads leave out the first block of a range", SWEEP, TANGENT),
    fault("sweep: components beside each other are read from the first field", TANGENT, OPERATOR),
    fault("sweep: the plain loop scatters stresses by one slope", OPERATOR, POINTS),
    fault("sweep: functions beside a wall as if it were far", SWEEP, POINTS),
    fault("inertia: the residual lacks the consistent part", TANGENT, DYNAMICS),
    fault("deformation: F without G H_r", TANGENT, POINTS),
    fault("stress: F_r is transposed", TANGENT, POINTS),
    fault("stress: no geometric part without a closed form", TANGENT, POINTS),
    fault("stress: the energy lacks V_0", TANGENT, POINTS),
    fault("damping: the product has the factor of the acceleration", TANGENT, DYNAMICS),
    fault("damping: particles of averaged cells have the stiffness of U(J)", DAMPED, POINTS),
    fault("damping: averaged cells have no stiffness of their own", DAMPED, POINTS),
    fault("mean dilatation: the product lacks the coupling within a cell", TANGENT, POINTS),
    fault("mean dilatation: that of earlier grids is forgotten", CELLS, POINTS),
    fault("mean dilatation: means of a kept grid stay where particles were", PARTICLES, KEPT),
    fault("mean dilatation: hardly filled cells have a dilatation of their own", INCOMPRESSIBLE, LAWS),
    fault("mixed: the product lacks the compressibility", INCOMPRESSIBLE, POINTS),
    fault("mixed: the residual of a cell is that of half its volume", INCOMPRESSIBLE, POINTS),
    fault("contact: the tangent lacks the curvature of the obstacle", TOUCHES, OBSTACLES),
    fault("contact: friction does not feel the change of pressure", TOUCHES, LAWS),
    fault("contact: the tangent does not turn with the obstacle", TOUCHES, OBSTACLES),
    fault("contact: the force does not turn with the obstacle", TOUCHES, OBSTACLES),
    fault("contact: an obstacle pulls", OBSTACLES, LAWS),
    fault("contact: the other body has no reaction", BETWEEN, OBSTACLES),
    fault("contact: the reaction acts beside the point", BETWEEN, OBSTACLES),
    fault("contact: the reaction acts where the point was", BETWEEN, OBSTACLES),
    fault("contact: bodies forget their slip", BETWEEN, OBSTACLES),
    fault("contact: thin bodies clamp each other", BETWEEN, OBSTACLES),
    fault("contact: a point that did not face a body may enter it", BETWEEN, OBSTACLES),
    fault("contact: joints of a group are surfaces", BETWEEN, OBSTACLES),
    fault("reference: contact is that of the old grid", BETWEEN, OBSTACLES),
    fault("contact: friction pushes forwards", OBSTACLES, LAWS),
    fault("clouds: the area of hidden particles is lost", SOLIDS, LAWS),
    fault("clouds: planes of symmetry are surfaces", SOLIDS, LAWS),
    fault("free obstacles: contact does not push back", FREE, OBSTACLES),
    fault("free obstacles: forces do not turn with the obstacle", TOUCHES, OBSTACLES),
    fault("free obstacles: the moment does not turn with the obstacle", TOUCHES, OBSTACLES),
    fault("free obstacles: the tangent holds them", TOUCHES, OBSTACLES),
    fault("free obstacles: they stay where forces are in balance", FREE, OBSTACLES),
    fault("contact: the slip is not along the surface", TOUCHES, LAWS),
    fault("contact: a slip does not move the anchor", OBSTACLES, LAWS),
    fault("contact: the elastic slip stores nothing", CONTACT_LAW, LAWS),
    fault("contact: surfaces that stretch get no more points", OBSTACLES, LAWS),
    fault("contact: particles do not watch", OBSTACLES, LAWS),
    fault("obstacles: friction loses nothing", OBSTACLES, LAWS),
    fault("obstacle: it rests", OBSTACLES, LAWS),
    fault("obstacles: the state of friction is not kept", OBSTACLES, LAWS),
    fault("obstacles: a point may enter deeply in one step", OBSTACLES, LAWS),
    fault("obstacles: a point may come out behind a thin obstacle", OBSTACLES, LAWS),
    fault("obstacles: the forces at the start of a step do no work", OBSTACLES, LAWS),
    fault("loads: a traction has the other sign", LOADS, TANGENT),
    fault("loads: the tangent of a pressure has a wrong sign", TANGENT, DYNAMICS),
    fault("unknowns: prescribed values are not cleared", DYNAMICS, POINTS),
    fault("unknowns: forces stay at nodes that follow", FOLLOWS, POINTS),
    fault("unknowns: the diagonal blocks lack the nodes that follow", FOLLOWS, POINTS),
    fault("unknowns: outer nodes follow by nine tenths", FOLLOWS, POINTS),
    fault("mass: the product takes ε for 1 − ε", BALANCE, DYNAMICS),
    fault("mass: nodes without mass have a velocity", BALANCE, DYNAMICS),
    fault("transfer: loads at t = 0 push the wrong way", LOADS, DYNAMICS),
    fault("transfer: moving walls count as resting ones", LOADS, DYNAMICS),
    fault("transfer: the blow of a wall contains the forces", LOADS, DYNAMICS),
    fault("transfer: the end of a step forgets the motion on a kept grid", KEPT, POINTS),
    fault("transfer: smoothing takes the velocity for the acceleration", SMOOTH, DYNAMICS),
    fault("transfer: no strain resets the grid", KEPT, DYNAMICS),
    fault("transfer: affine fits lack their slope", TRANSFERS, DYNAMICS),
    fault("schemes: 1 for γ", DYNAMICS, POINTS),
    fault("discrete gradient: ΔE is that of half the step", MEAN, POINTS),
    fault("discrete gradient: Gauss's formula is not corrected", MEAN, POINTS),
    fault("discrete gradient: all points move like the middle", ENERGY, POINTS),
    fault("discrete gradient: the tangent has F of the middle on both sides", ENERGY, POINTS),
    fault("mean dilatation of a step: the gradient of J is that at the middle", ENERGY, POINTS),
    fault("mean dilatation of a step: Gauss's formula is not corrected", ENERGY, POINTS),
    fault("mean dilatation of a step: the product lacks the coupling within a cell", ENERGY, POINTS),
    fault("contact: the mean pressure has the tangent of full contact", CONTACT_LAW, LAWS),
    fault("schemes: the balance of generalised α has Newmark's α₃", SCHEMES, TANGENT),
    fault("step: Δφ is the motion to the balance, not to the end", SCHEMES, TANGENT),
    fault("step: reactions and work lack the blow of a wall", LOADS, DYNAMICS),
    fault("path: its tangent forgets the loads", PATHS, KEPT),
    fault("reference: no wall that is met resets the grid", KEPT, DYNAMICS),
    fault("reference: no body that is met resets the grid", KEPT, CARRIES),
    fault("reference: nodes of the first field hold all bodies", BETWEEN, OBSTACLES),
    fault("reference: a support that is lost still holds", CARRIES, KEPT),
    fault("reference: relaxation within a step is carried over", FLOWS, KEPT),
    fault("reference: no force is carried over", CARRIES, DYNAMICS),
    fault("tensor: ln J of small j by its difference", DIGITS, TANGENT),
    fault("laws: P = S F for F S", TANGENT, DIGITS),
    fault("laws: v and b are swapped in ℂmat", TANGENT, POINTS),
    fault("laws: J for J² in the bulk stiffness", TANGENT, DIGITS),
    fault("laws: the closed product lacks q", TANGENT, POINTS),
    fault("laws: Δ for Δ coth Δ in the moduli", MEMORY, POINTS),
    fault("laws: friction for dilatancy in the flow", MEMORY, POINTS),
    fault("laws: the plastic change of volume is forgotten", MEMORY, POINTS),
    fault("laws: Euler's step for the relaxation", FLOWS, MEMORY),
    fault("laws: plastic flow of half the size", MEMORY, POINTS),
    fault("shapes: max-ent gradients have the other sign", PATCH, DIGITS),
    fault("shapes: ghosts beyond a wall are folded back once", PATCH, DYNAMICS),
    fault("shapes: nodes with N = 0 are left out", PATCH, DIGITS),
    fault("shapes: round-off decides which nodes are active", SHAPES, DIGITS),
    fault("shapes: the edge of the GIMP function is twice as high", PATCH, DYNAMICS),
    fault("shapes: functions at a wall are a thousandth of s³ off", SHAPES, SOLIDS),
    fault("checkpoint: bonded bodies are forgotten", BONDS, KEPT),
    fault("checkpoint: the anchors of friction are forgotten", OBSTACLES, LAWS),
    fault("checkpoint: surfaces are those of the start", OBSTACLES, LAWS),
    fault("checkpoint: accelerations are not restored", RESTARTS, KEPT),
    fault("checkpoint: the length of the step along a path is forgotten", RESTARTS, KEPT),
    fault("checkpoint: a restart resets the grid", RESTARTS, KEPT),
    fault("checkpoint: every checkpoint overwrites the last one", RESTARTS, KEPT),
    fault("checkpoint: a file may be longer than its arrays", STORED, KEPT),
    fault("checkpoint: checksums of arrays are not compared", STORED, KEPT),
    fault("solver: a Givens rotation has a wrong sign", SOLVER, POINTS),
    fault("solver: a restart of GMRES forgets the solution so far", SOLVER, POINTS),
    fault("solver: the inverse of β in conjugate gradients", SOLVER, POINTS),
    fault("solver: negative curvature counts as positive", SOLVER, POINTS),
    fault("solver: several threads leave out the first chunk of a dot product", SPACE, POINTS),
    fault("solver: forcing by the ratio of residuals, not its square", SOLVER, POINTS),
    fault("solver: any fall of the residual is accepted", SOLVER, POINTS),
    fault("solver: every tangent has new diagonal blocks", SOLVER, POINTS),
    fault("solver: non-negative least squares step below zero", SOLVER, PATCH),
    fault("multigrid: no coarse levels", LEVELS, FOLLOWS),
    fault("multigrid: coarse nodes that are held move", LEVELS, FOLLOWS),
    fault("multigrid: centroids of coarse cells are a tenth off", SOLVER, KEPT),
    fault("multigrid: cubic splines have no filter", LEVELS, POINTS),
    fault("multigrid: no smoothing after the coarse levels", LEVELS, FOLLOWS),
    fault("multigrid: held values lead others in the matrix of the bottom level", LEVELS, POINTS),
    fault("multigrid: motions that nothing holds have no stiffness", STATICS, LEVELS),
    fault("multigrid: one point holds a coarse cell that is not full", LEVELS, POINTS),
    fault("saddle: cells are alone in the Schur complement", INCOMPRESSIBLE, LEVELS),
    fault("saddle: the pressures have the other sign", INCOMPRESSIBLE, LEVELS),
    fault("solids: a curved surface by one plane a box", SOLIDS, PATCH),
    fault("solids: slivers are left alone", SOLIDS, PATCH),
    fault("solids: quadrature points depend on the axes", SOLIDS, PATCH),
    fault("solids: the gap between planes and a curved surface is left out", SOLIDS, PATCH),
];
