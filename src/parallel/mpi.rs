//! MPI. The library is found when the program runs: the program itself needs none. Open MPI, MPICH, and libraries with the handles of MPICH, such
//! as Intel MPI, are known.
#![allow(unsafe_code)]

use super::processes::{Exchange, Processes};
use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW, Symbol};
use std::env;
use std::ffi::{c_int, c_void};
use std::fmt::{self, Debug};
use std::ptr::null_mut;
use std::thread::panicking;

/// The environment variable with the path of a library.
const PATH: &str = "BFREE_MPI";

/// One call hands over this many bytes at most, because MPI counts with 32 bits.
const MOST: usize = 1 << 30;

/// One call collects this many bytes at most, for which process 0 has a buffer.
const AT_ONCE: usize = 1 << 22;

/// Exit code of a program that panics.
const PANICKED: c_int = 101;

/// `MPI_THREAD_SERIALIZED`: any thread makes the calls, one at a time.
const SERIALIZED: c_int = 2;

/// MPI cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MpiError {
    /// A launcher has started several processes, but there is no library.
    #[error(
        "a launcher of MPI has started this program, but none of {names} can be loaded. Install the library of the launcher, or name it in {PATH}"
    )]
    NoLibrary {
        /// The names that were tried.
        names: String,
    },
    /// The library is no MPI.
    #[error("the library of MPI has no {name}. Give a library of Open MPI or MPICH in {PATH}")]
    NoSymbol {
        /// The missing name.
        name: &'static str,
        /// The error of the system.
        source: libloading::Error,
    },
    /// The library has started other processes than the launcher.
    #[error(
        "the launcher of MPI has started {launched} processes, but its library counts {count}: name the library of the launcher in {PATH}"
    )]
    OtherLauncher {
        /// The processes of the launcher.
        launched: usize,
        /// The processes of the library.
        count: usize,
    },
    /// The library allows calls from one thread only.
    #[error(
        "the library of MPI does not allow calls from several threads (MPI_THREAD_SERIALIZED): name another one in {PATH}"
    )]
    OneThread,
    /// A call failed.
    #[error("{name} failed with the code {code}")]
    Call {
        /// The function.
        name: &'static str,
        /// Its result.
        code: c_int,
    },
}

/// The calls of an MPI library, whose handles are of type H.
struct Mpi<H: Copy> {
    all_gather: AllGather<H>,
    broadcast: Broadcast<H>,
    gather: Gather<H>,
    finalize: Finalize,
    abort: Abort<H>,
    world: H,
    byte: H,
    /// `MPI_IN_PLACE`
    in_place: usize,
    rank: usize,
    count: usize,
    /// The calls belong to it.
    _library: Library,
}

type Init = unsafe extern "C" fn(*mut c_int, *mut *mut *mut c_void, c_int, *mut c_int) -> c_int;
type Number<H> = unsafe extern "C" fn(H, *mut c_int) -> c_int;
type AllGather<H> =
    unsafe extern "C" fn(*const c_void, c_int, H, *mut c_void, *const c_int, *const c_int, H, H) -> c_int;
type Broadcast<H> = unsafe extern "C" fn(*mut c_void, c_int, H, c_int, H) -> c_int;
type Gather<H> =
    unsafe extern "C" fn(*const c_void, c_int, H, *mut c_void, *const c_int, *const c_int, H, c_int, H) -> c_int;
type Abort<H> = unsafe extern "C" fn(H, c_int) -> c_int;
type Finalize = unsafe extern "C" fn() -> c_int;

impl Processes {
    /// The processes that a launcher of MPI, such as `mpirun`, has started together with this one. Without a launcher this process is alone, and no
    /// library is looked for.
    ///
    /// # Errors
    /// The library of MPI cannot be loaded or used.
    pub fn launched() -> Result<Self, MpiError> {
        let variable = |name| env::var(name).ok().and_then(|value| value.parse::<usize>().ok());
        let (open_mpi, others) = (variable("OMPI_COMM_WORLD_SIZE"), variable("PMI_SIZE"));
        let by_pmix = variable("PMIX_RANK").and_then(|_| variable("SLURM_NTASKS"));
        let Some(launched) = open_mpi.or(others).or(by_pmix).filter(|count| *count > 1) else {
            return Ok(Self::default());
        };
        let names: &[&str] = match others {
            Some(_) if open_mpi.is_none() => &["libmpi.so.12", "libmpich.so.12", "libmpi.so", "libmpi.dylib"],
            _ => &["libmpi.so.40", "libmpi.so", "libmpi.so.12", "libmpich.so.12", "libmpi.dylib"],
        };
        let path = env::var(PATH).ok();
        let names = path.as_deref().map_or(names.to_vec(), |path| vec![path]);
        // Plug-ins of Open MPI look for its symbols among the global ones.
        // Safety: the library is MPI, whose constructors may run in any program.
        let open = |name: &&str| unsafe { Library::open(Some(*name), RTLD_NOW | RTLD_GLOBAL) }.ok();
        let library = names.iter().find_map(open);
        let library = library.ok_or_else(|| MpiError::NoLibrary { names: names.join(", ") })?;
        // Open MPI's handles are addresses of its objects, MPICH's are numbers of its ABI.
        // Safety: only the address is taken.
        let address =
            |name: &'static str| unsafe { library.get::<*mut c_void>(name) }.map(|at| at.as_raw_ptr() as usize);
        match (address("ompi_mpi_comm_world"), address("ompi_mpi_byte")) {
            (Ok(world), Ok(byte)) => Mpi::start(library, launched, [world, byte], 1),
            _ => Mpi::<c_int>::start(library, launched, [0x4400_0000, 0x4c00_010d], usize::MAX),
        }
    }
}

impl<H: Copy + Send + Sync + 'static> Mpi<H> {
    /// Starts MPI.
    fn start(library: Library, launched: usize, [world, byte]: [H; 2], in_place: usize) -> Result<Processes, MpiError> {
        let init: Init = *symbol(&library, "MPI_Init_thread")?;
        let (rank_of, count_of): (Number<H>, Number<H>) =
            (*symbol(&library, "MPI_Comm_rank")?, *symbol(&library, "MPI_Comm_size")?);
        let (mut provided, mut rank, mut count) = (0, 0, 0);
        // Safety: the signatures are those of the standard, and all pointers are valid during the calls.
        unsafe {
            checked("MPI_Init_thread", init(null_mut(), null_mut(), SERIALIZED, &raw mut provided))?;
            checked("MPI_Comm_rank", rank_of(world, &raw mut rank))?;
            checked("MPI_Comm_size", count_of(world, &raw mut count))?;
        }
        let this = Self {
            all_gather: *symbol(&library, "MPI_Allgatherv")?,
            broadcast: *symbol(&library, "MPI_Bcast")?,
            gather: *symbol(&library, "MPI_Gatherv")?,
            finalize: *symbol(&library, "MPI_Finalize")?,
            abort: *symbol(&library, "MPI_Abort")?,
            world,
            byte,
            in_place,
            rank: rank as usize,
            count: count as usize,
            _library: library,
        };
        if provided < SERIALIZED {
            return Err(MpiError::OneThread);
        }
        if this.count != launched {
            return Err(MpiError::OtherLauncher { launched, count: this.count });
        }
        Ok(Processes::new(this))
    }
}

/// A function of the library.
fn symbol<F>(library: &Library, name: &'static str) -> Result<Symbol<F>, MpiError> {
    // Safety: F is the signature of the standard.
    unsafe { library.get(name) }.map_err(|source| MpiError::NoSymbol { name, source })
}

fn checked(name: &'static str, code: c_int) -> Result<(), MpiError> {
    if code == 0 { Ok(()) } else { Err(MpiError::Call { name, code }) }
}

impl<H: Copy> Debug for Mpi<H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mpi").field("rank", &self.rank).field("count", &self.count).finish_non_exhaustive()
    }
}

impl<H: Copy + Send + Sync> Exchange for Mpi<H> {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    /// An error inside MPI ends all processes: that is the standard's default.
    fn exchange(&self, lengths: &[usize], all: &mut [u8]) {
        let (byte, world) = (self.byte, self.world);
        if all.len() <= MOST {
            let counts: Vec<c_int> = lengths.iter().map(|length| *length as c_int).collect();
            let starts: Vec<c_int> = (0..counts.len()).map(|rank| counts[..rank].iter().sum()).collect();
            let (to, from) = (all.as_mut_ptr().cast(), self.in_place as *const c_void);
            // Safety: the parts lie in `all`, as the arguments of every process say.
            unsafe { (self.all_gather)(from, 0, byte, to, counts.as_ptr(), starts.as_ptr(), byte, world) };
            return;
        }
        let mut left = all;
        for (rank, &length) in lengths.iter().enumerate() {
            let part = left.split_off_mut(..length).unwrap_or_default();
            for piece in part.chunks_mut(MOST) {
                // Safety: the piece is valid memory, and has the same length in every process.
                unsafe {
                    (self.broadcast)(piece.as_mut_ptr().cast(), piece.len() as c_int, byte, rank as c_int, world)
                };
            }
        }
    }

    fn collect(&self, lengths: &[usize], own: &[u8], all: &mut [u8]) {
        let (byte, world, most) = (self.byte, self.world, AT_ONCE.div_ceil(self.count));
        let longest = lengths.iter().copied().max().unwrap_or(0);
        for first in (0..longest).step_by(most) {
            let piece = |length: usize| first.min(length)..(first + most).min(length);
            let counts: Vec<c_int> = lengths.iter().map(|length| piece(*length).len() as c_int).collect();
            let starts: Vec<c_int> = (0..counts.len()).map(|rank| counts[..rank].iter().sum()).collect();
            let mut pieces =
                if self.rank == 0 { vec![0_u8; counts.iter().sum::<c_int>() as usize] } else { Vec::new() };
            let (from, to) = (&own[piece(own.len())], pieces.as_mut_ptr().cast());
            let (address, count) = (from.as_ptr().cast(), from.len() as c_int);
            // Safety: the piece is valid memory, and the pieces of all processes lie in the buffer of process 0.
            unsafe { (self.gather)(address, count, byte, to, counts.as_ptr(), starts.as_ptr(), byte, 0, world) };
            let (mut pieces, mut left) = (&pieces[..], &mut *all);
            for &length in lengths.iter().filter(|_| self.rank == 0) {
                let (piece, part) = (piece(length), left.split_off_mut(..length).unwrap_or_default());
                part[piece.clone()].copy_from_slice(pieces.split_off(..piece.len()).unwrap_or_default());
            }
        }
    }
}

impl<H: Copy> Drop for Mpi<H> {
    fn drop(&mut self) {
        // Others would wait for ever for a process that panics.
        // Safety: MPI was started, and no other call follows.
        unsafe { if panicking() { (self.abort)(self.world, PANICKED) } else { (self.finalize)() } };
    }
}
