//! Implicit finite-strain material point method with a matrix-free, Voigt-free tangent.
//!
//! A body is a cloud of particles that carry its state. A Cartesian grid carries the unknowns. This page goes through
//! one step after a grid reset, and links each formula to its code. [`mechanics::reference`] says what changes where the grid is not reset. Numbers in parentheses are the equations of Molinos, Stickle, Navas, Yagüe,
//! Manzanal, Pastor, "Toward a local maximum-entropy material point method at finite strain within a B-free approach". The formulas here
//! correct the misprints of the paper.
//!
//! # Symbols
//!
//! I and J number nodes, p numbers particles. n is the last converged state, n+1 the state sought. D is the dimension: 1 (uniaxial strain),
//! 2 (plane strain) or 3.
//!
//! | symbol | meaning | where |
//! |---|---|---|
//! | x, v, a | position, velocity, acceleration of a particle | [`particles::Particles`] |
//! | m, V₀ | mass and reference volume of a particle | [`particles::Particles`] |
//! | F, H = F − I, J = det F | deformation gradient; H is stored, so that small strains lose no digits | [`tensor::Deformation`] |
//! | E = sym H + ½ HᵀH, C = I + 2E | Green–Lagrange and right Cauchy–Green strain | [`tensor::Deformation::green_lagrange`] |
//! | W, S = ∂W/∂E, ℂ = ∂S/∂E | energy density, second Piola–Kirchhoff stress, its tangent | [`material::Law`] |
//! | P = F S (7) | first Piola–Kirchhoff stress | [`material::first_piola`] |
//! | Λ, G | Lamé's constants | [`material::Lame`] |
//! | h | spacing of the grid | [`grid::Grid`] |
//! | N, ∇ₙN | shape functions and their gradients at the positions xₙ | [`approximation::ShapeFunction`] |
//! | ∇N = Fₙᵀ ∇ₙN (47) | gradient with respect to the undeformed body | [`mechanics::constitutive`] |
//! | γ̂, β̂ = γ̂/h² | locality of the max-ent functions | [`approximation::Lme`] |
//! | Δφ | motion of the nodes over the step: the unknowns | [`mechanics::residual`] |
//! | M̃ = (1−ε) M + ε lumped(M) (41) | mass matrix, between consistent (ε = 0) and lumped (ε = 1) | [`simulation::Settings::lumping`] |
//! | β, γ; α₁ … α₆ (19) | Newmark's parameters, and the factors that follow from them and Δt | [`mechanics::schemes`] |
//! | R(Δφ) | residual of the nodal equilibrium | [`mechanics::residual::Equilibrium`] |
//! | K(Δφ) | tangent, the derivative of R | [`mechanics::tangent::Tangent`] |
//! | Π(Δφ) | incremental potential, ∂Π/∂Δφ = R | [`mechanics::residual::Equilibrium::potential`] |
//!
//! # One step
//!
//! [`simulation::Simulation::step`] is the following, in this order. Arc length, mean dilatation and aggregation are left out.
//!
//! **1. Shape functions.** A particle at xₙ is connected to the nodes with N ≠ 0 or ∇ₙN ≠ 0. A node connected to some particle is active
//! ([`space::Nodes`]). The paper's local maximum-entropy functions (24)–(28) are, with D = x − x_I,
//!
//! ```text
//! N_I = exp(−β̂ D·D + λ·D) / Z,    λ = argmin log Z,    ∇N_I = −N_I 𝐉⁻¹ D,    𝐉 = Σ_I N_I D ⊗ D
//! ```
//!
//! On a box of nodes they factorise into functions of one coordinate, each from one scalar root ([`approximation::Lme`]).
//! [`approximation::LmeCircle`] uses the paper's circle of nodes. Other families are [`approximation::Linear`], [`approximation::Gimp`],
//! [`approximation::Bspline`], and [`approximation::NotAKnotBspline`], whose functions curve at walls. At a point on a wall of the box only
//! the nodes of that wall have N ≠ 0, for every family, so that prescribed motion is nodal.
//!
//! **2. Particle-to-grid transfer** ([`mechanics::transfer::Nodal::project`]) (40)–(42):
//!
//! ```text
//! M_IJ = Σ_p m N_I N_J        M̃ v = Σ_p N m v_p        M̃ a = Σ_p N m a_p
//! ```
//!
//! Where the motion g(t) is prescribed, ġ and g̈ then replace the projected values ([`mechanics::loads`]).
//!
//! **3. Equilibrium.** Newmark's method (19) makes the acceleration, and with it the residual (17), (33), a function of the unknowns
//! ([`mechanics::residual::Equilibrium::residual`]):
//!
//! ```text
//! a = α₁ Δφ − α₂ vₙ − α₃ aₙ          v = α₄ Δφ + α₅ vₙ + α₆ aₙ
//! α₁ = 1/(β Δt²)   α₂ = 1/(β Δt)   α₃ = (1−2β)/(2β)   α₄ = γ/(β Δt)   α₅ = 1 − γ/β   α₆ = (1 − γ/(2β)) Δt
//!
//! ΔF = I + Σ_I Δφ_I ⊗ ∇ₙN_I          F = ΔF Fₙ                                  (45), (46)
//!
//! R_I(Δφ) =   Σ_J M̃_IJ a_J            inertia
//!           + Σ_p V₀ F S ∇N_I         internal force
//!           − Σ_p m b N_I             body force
//!           − Σ_Γ A T N_I             nominal traction T, or follower pressure T = −p J F⁻ᵀ 𝐍
//!           + Σ_J (a M̃ + b K_n)_IJ v_J   damping, K_n the material stiffness at the beginning of the step
//! ```
//!
//! Without inertia ([`mechanics::schemes::Statics`]) there is no M̃, v or a. Step 2 falls away, and so does the first line of R.
//!
//! Where every load has a potential, R is the gradient of
//!
//! ```text
//! Π(Δφ) = a·M̃a / (2 α₁) + Σ_p V₀ W(F) − f_ext·Δφ
//! ```
//!
//! and the line search accepts a step by Π where ‖R‖ does not fall. It refuses a state with det F ≤ 0.
//!
//! **4. Newton's method** ([`solver::newton()`]) solves R = 0 on the free degrees of freedom. The linear systems K d = −R are solved by
//! [conjugate gradients](solver::ConjugateGradientSettings::solve), or by [GMRES](solver::GmresSettings::solve) where K is not symmetric. The product with K
//! is applied particle by particle and never assembled (30), (34), with δF = Σ_J u_J ⊗ ∇N_J:
//!
//! ```text
//! K u = α₁ M̃ u                        inertia
//!     + Σ_p V₀ (δF S) ∇N_I            geometric
//!     + Σ_p V₀ F [ℂ : Fᵀ δF] ∇N_I     material
//!     + Σ_Γ A p δ(J F⁻ᵀ) 𝐍 N_I        follower pressure
//!     + α₄ (a M̃ + b K_n) u            damping
//! ```
//!
//! [`Simulation::preconditioner`](simulation::Simulation::preconditioner) chooses the preconditioner: multigrid without inertia, block-Jacobi
//! where inertia dominates. Nearly incompressible bodies with mean dilatation have a mixed form (`mechanics/mixed.rs`).
//!
//! The block-Jacobi preconditioner inverts the blocks on the diagonal of K. In these blocks the tangent is *B-free* (34), (37), (38):
//! second-order tensors ℂmat take the place of Voigt's matrices BᵀDB,
//!
//! ```text
//! K_IJ = α₁ M̃_IJ I + Σ_p V₀ { F ℂmat{∇N_I, ∇N_J} Fᵀ + (∇N_I · S ∇N_J) I },      ℂmat{v, b} a = [ℂ : (a ⊗ b)] v
//! ```
//!
//! Each term linearises its part at one state ([`mechanics::residual::Equilibrium::tangent`]). A law with a closed form stores a handful of
//! numbers ([`material::Law::closed`]). Any other law stores the blocks above for all pairs of unit vectors. So the product, too, is
//! B-free, and the diagonal blocks come from the numbers of the product. For the paper's law, [`material::NeoHookean::ciarlet`] (39):
//!
//! ```text
//! W = Λ/4 (J² − 1) − (Λ/2 + G) ln J + G tr E          S = Λ/2 (J² − 1) C⁻¹ + G (I − C⁻¹)
//! ℂmat{v,b} = Λ J² (C⁻¹v ⊗ C⁻¹b) − q (C⁻¹b·v) C⁻¹ − q (C⁻¹b ⊗ C⁻¹v),      q = Λ/2 (J² − 1) − G
//! ```
//!
//! **5. Grid-to-particle transfer** ([`mechanics::transfer::Update`]) (45), (50)–(52):
//!
//! ```text
//! a_p += Σ_I N_I (α₁ (Δφ − Δt vₙ) − (α₃+1) aₙ)_I      x_p += Σ_I N_I Δφ_I
//! v_p += Σ_I N_I (α₄ (Δφ − Δt vₙ) + α₆ aₙ)_I          F_p  = ΔF Fₙ
//! ```
//!
//! Nothing before this transfer changes the particles. A step that fails leaves them as they were, and [`simulation::Simulation::advance`]
//! repeats the step with half of Δt.
//!
//! # The tangent is checked, term by term
//!
//! The residual is generic over its number type ([`scalar::Real`]). With dual numbers Δφ + ε u, the code that computes R gives the
//! derivative of R in the direction u, to rounding. Gather and scatter are linear, so ε is one more field in the loop over particles. R is
//! a list of terms ([`mechanics::terms`]), and each term can be evaluated alone. In F S, the F on the left alone gives the geometric part,
//! and the F inside S alone gives the material part. These pieces ([`mechanics::terms::Terms::pieces`]) can be linearised alone, too. The
//! solver's own product applies them. So each formula of K is compared with an independent derivative
//! ([`mechanics::residual::Equilibrium::check_tangent`], and the package `verification`).
//!
//! # Where to begin
//!
//! | to | read |
//! |---|---|
//! | run a scene from JSON | [`scene::read_file`], [`scene::Scene::build`], [`simulation::Simulation::advance`], [`output::Recorder`] |
//! | continue a run that was killed | [`checkpoint::Checkpoints`], [`checkpoint::restore`], [`output::Recorder::resume`] |
//! | write a law | [`material::Law`], or [`material::Energy`] for its energy alone; `examples/own_law`, `examples/law_from_energy.rs` |
//! | write a shape function | [`approximation::ShapeFunction`], or [`approximation::Separable`] for a product |
//! | see whole programs | the module `examples` |
//! | follow the loop over particles | [`mechanics::sweep`] |
//! | use the solver for something else | [`solver::NonlinearProblem`], [`solver::LinearOperator`] |

// First, because a macro is known only below its module.
#[macro_use]
mod dimensions;
#[macro_use]
mod mutant;

pub mod aggregation;
pub mod approximation;
pub mod causes;
pub mod checkpoint;
pub mod clock;
#[cfg(doc)]
pub mod examples;
pub mod field;
pub mod gpu;
pub mod grid;
mod lanes;
mod lists;
pub mod material;
pub mod mechanics;
pub mod memory;
pub mod output;
pub mod parallel;
pub mod particles;
pub mod phases;
pub mod plan;
pub mod pooled;
mod problems;
pub mod program;
pub mod scalar;
pub mod scene;
pub mod shape;
pub mod simulation;
pub mod solver;
pub mod space;
pub mod tensor;
