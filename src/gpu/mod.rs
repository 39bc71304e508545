//! A graphics processor: its memory, its kernels, and vectors that lie there.
//!
//! The program finds the driver when it runs, so that it also runs on machines without one. The kernels are CUDA C (`kernels/`), and are shipped
//! as PTX, which every driver since CUDA 12.0 compiles for its device. `.ci/ptx` writes the PTX.
//!
//! Every sum has the order that it has on the processor, so that both give the same bits, whichever thread or block is first.
//!
//! The tests run the kernels on a driver that is emulated by gcc (`tests/gpu/`).

mod copies;
mod device;
mod followers;
mod multigrid;
mod passes;
mod points;
mod product;
mod rows;
mod solids;
mod transfer;
mod vectors;

pub(crate) use copies::Copies;
pub(crate) use device::Buffer;
pub use device::{Gpu, GpuError};
pub(crate) use followers::Followers;
pub(crate) use multigrid::{Filter, Level, LevelArrays};
pub(crate) use points::{NO_OBSTACLE, PointArrays, Points};
pub(crate) use product::{Inertia, Masses, OfParticles, Product, SETS};
pub(crate) use rows::{Cells, Rows};
pub(crate) use solids::{InertiaOfParticles, Solids, States};
pub(crate) use transfer::{Transfer, TransferArrays};
pub use vectors::GpuVector;

#[cfg(test)]
mod tests;
