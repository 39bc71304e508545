//! The utility routines of Abaqus that UMATs call. A library leaves them undefined, and the loader finds them in the program that loads it: the
//! program exports those that `utilities.list` names (see `build.rs`).
//!
//! Source: Abaqus User Subroutines Reference Guide, "Utility routines". Names are those of gfortran and ifort on Linux and macOS; arguments are
//! addresses; the lengths of texts follow behind all others by value.

// Foreign code calls these routines with addresses. Sound if it keeps to Abaqus' calling convention.
#![allow(unsafe_code)]

use std::cell::Cell;
use std::ffi::c_int;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use super::umat::of_counts;
use crate::convention::{Components, Tensor};
use crate::tensor::{IDENTITY, eigenvalues, norm, product3, sum, trace, transposed};

/// The addresses of all routines.
struct Routines([*const (); 20]);

// Sound: addresses of functions are the same in all threads.
unsafe impl Sync for Routines {}

static ROUTINES: Routines = Routines([
    rotsig_ as *const (),
    sinv_ as *const (),
    sprinc_ as *const (),
    sprind_ as *const (),
    xit_ as *const (),
    stdb_abqerr_ as *const (),
    getoutdir_ as *const (),
    getjobname_ as *const (),
    getvrm_ as *const (),
    getnumcpus_ as *const (),
    getrank_ as *const (),
    getnumthreads_ as *const (),
    getcommunicator_ as *const (),
    get_thread_id_ as *const (),
    mutexinit_ as *const (),
    mutexlock_ as *const (),
    mutexunlock_ as *const (),
    MutexInit as *const (),
    MutexLock as *const (),
    MutexUnlock as *const (),
]);

/// Keeps the routines in the program: the linker drops functions that nothing calls.
pub(super) fn keep() {
    std::hint::black_box(&ROUTINES.0);
}

/// The components of a vector with NDI direct and NSHR shear ones; LSTR is 1 for a stress and 2 for a strain, with engineering shears.
unsafe fn components(lstr: *const c_int, ndi: *const c_int, nshr: *const c_int) -> Components {
    let [lstr, ndi, nshr] = unsafe { [*lstr, *ndi, *nshr] };
    of_counts(ndi.try_into().unwrap_or(0), nshr.try_into().unwrap_or(0), if lstr == 2 { 2.0 } else { 1.0 })
}

unsafe fn tensor(vector: *const f64, components: &Components) -> Tensor {
    components.symmetric_tensor(unsafe { std::slice::from_raw_parts(vector, components.count()) })
}

/// Rotates a stress or strain: SPRIME = R S Rᵀ.
#[unsafe(no_mangle)]
unsafe extern "C" fn rotsig_(
    s: *const f64,
    r: *const [[f64; 3]; 3],
    sprime: *mut f64,
    lstr: *const c_int,
    ndi: *const c_int,
    nshr: *const c_int,
) {
    unsafe {
        let components = components(lstr, ndi, nshr);
        // Fortran's matrices are column by column.
        let rotation = transposed(&*r);
        let turned = components.vector(&product3(&rotation, &tensor(s, &components), &transposed(&rotation)));
        std::ptr::copy_nonoverlapping(turned.as_ptr(), sprime, turned.len());
    }
}

/// The invariants of a stress: tr σ/3 and √(3/2 s : s).
#[unsafe(no_mangle)]
unsafe extern "C" fn sinv_(s: *const f64, mean: *mut f64, mises: *mut f64, ndi: *const c_int, nshr: *const c_int) {
    unsafe {
        let stress = tensor(s, &components(&1, ndi, nshr));
        *mean = trace(&stress) / 3.0;
        *mises = 1.5_f64.sqrt() * norm(&sum(&stress, -*mean, &IDENTITY));
    }
}

/// The principal values from the smallest to the greatest, and their directions, one a row.
fn principal(tensor: &Tensor) -> ([f64; 3], Tensor) {
    let (values, axes) = eigenvalues(tensor);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    (order.map(|k| values[k]), order.map(|k| [axes[0][k], axes[1][k], axes[2][k]]))
}

/// Principal values.
#[unsafe(no_mangle)]
unsafe extern "C" fn sprinc_(
    s: *const f64,
    values: *mut [f64; 3],
    lstr: *const c_int,
    ndi: *const c_int,
    nshr: *const c_int,
) {
    unsafe { *values = principal(&tensor(s, &components(lstr, ndi, nshr))).0 };
}

/// Principal values and directions: AN(K, I) is component I of the direction of value K.
#[unsafe(no_mangle)]
unsafe extern "C" fn sprind_(
    s: *const f64,
    values: *mut [f64; 3],
    directions: *mut [[f64; 3]; 3],
    lstr: *const c_int,
    ndi: *const c_int,
    nshr: *const c_int,
) {
    unsafe {
        let (sorted, axes) = principal(&tensor(s, &components(lstr, ndi, nshr)));
        (*values, *directions) = (sorted, transposed(&axes));
    }
}

/// Ends the analysis.
#[unsafe(no_mangle)]
extern "C" fn xit_() -> ! {
    eprintln!("The law called XIT, which ends the analysis.");
    std::process::exit(1)
}

/// Prints a message; LOP = −3 ends the analysis. The values for its placeholders %I, %R and %S are not printed.
#[unsafe(no_mangle)]
unsafe extern "C" fn stdb_abqerr_(
    lop: *const c_int,
    text: *const u8,
    _integers: *const c_int,
    _reals: *const f64,
    _texts: *const u8,
    length: usize,
) {
    // A law that leaves out arguments gives a meaningless length.
    let text = unsafe { std::slice::from_raw_parts(text, length.min(500)) };
    eprintln!("{}", String::from_utf8_lossy(text).trim_end());
    if unsafe { *lop } == -3 {
        xit_();
    }
}

/// Fills a text of Fortran: the value, and blanks behind it.
unsafe fn fill(text: *mut u8, length: usize, value: &str, count: *mut c_int) {
    let value = &value.as_bytes()[..value.len().min(length)];
    unsafe {
        text.write_bytes(b' ', length);
        std::ptr::copy_nonoverlapping(value.as_ptr(), text, value.len());
        *count = value.len() as c_int;
    }
}

/// The folder of the analysis: where the program was started.
#[unsafe(no_mangle)]
unsafe extern "C" fn getoutdir_(text: *mut u8, count: *mut c_int, length: usize) {
    let folder = std::env::current_dir().unwrap_or_default();
    unsafe { fill(text, length, &folder.to_string_lossy(), count) };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn getjobname_(text: *mut u8, count: *mut c_int, length: usize) {
    unsafe { fill(text, length, "tangent-check", count) };
}

/// Values of a point, for UVARM and USDFLD: there are none, which JRCD = 1 says.
#[unsafe(no_mangle)]
unsafe extern "C" fn getvrm_(
    _variable: *const u8,
    _array: *mut f64,
    _jarray: *mut c_int,
    _flags: *mut u8,
    jrcd: *mut c_int,
) {
    unsafe { *jrcd = 1 };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn getnumcpus_(count: *mut c_int) {
    unsafe { *count = 1 };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn getrank_(rank: *mut c_int) {
    unsafe { *rank = 0 };
}

#[unsafe(no_mangle)]
extern "C" fn getnumthreads_() -> c_int {
    1
}

#[unsafe(no_mangle)]
extern "C" fn getcommunicator_() -> c_int {
    0
}

/// The number of this thread, from 0: a run of bfree calls a law from several.
#[unsafe(no_mangle)]
extern "C" fn get_thread_id_() -> c_int {
    static THREADS: AtomicI32 = AtomicI32::new(0);
    thread_local!(static NUMBER: Cell<c_int> = Cell::new(THREADS.fetch_add(1, Ordering::Relaxed)));
    NUMBER.get()
}

/// Abaqus has a hundred locks with the numbers 1 to 100.
static LOCKS: [AtomicBool; 101] = [const { AtomicBool::new(false) }; 101];

unsafe fn lock(id: *const c_int) -> &'static AtomicBool {
    &LOCKS[usize::try_from(unsafe { *id }).unwrap_or(0).min(100)]
}

#[unsafe(no_mangle)]
extern "C" fn mutexinit_(_id: *const c_int) {}

#[unsafe(no_mangle)]
unsafe extern "C" fn mutexlock_(id: *const c_int) {
    while unsafe { lock(id) }.swap(true, Ordering::Acquire) {
        std::thread::yield_now();
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn mutexunlock_(id: *const c_int) {
    unsafe { lock(id) }.store(false, Ordering::Release);
}

/// The same for C++, which gives the number itself.
#[unsafe(no_mangle)]
extern "C" fn MutexInit(_id: c_int) {}

#[unsafe(no_mangle)]
extern "C" fn MutexLock(id: c_int) {
    unsafe { mutexlock_(&id) };
}

#[unsafe(no_mangle)]
extern "C" fn MutexUnlock(id: c_int) {
    unsafe { mutexunlock_(&id) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::rotation_about;

    /// A routine that the list does not name is not found by a law.
    #[test]
    fn the_list_names_every_routine() {
        let listed: Vec<&str> =
            include_str!("utilities.list").lines().filter_map(|line| line.trim().strip_suffix(";")).collect();
        let after = include_str!("utilities.rs").split("#[unsafe(no_mangle)]\n").skip(1);
        let routines: Vec<&str> =
            after.filter_map(|text| text.split_once("fn ")?.1.split_once('(')).map(|(name, _)| name).collect();
        assert_eq!(listed.strip_suffix(&["}"]).unwrap_or(&listed), routines);
        assert_eq!(routines.len(), ROUTINES.0.len());
    }

    /// SINV, SPRINC, SPRIND and ROTSIG in three dimensions, plane strain and plane stress, for stresses and strains: the values and directions
    /// give the tensor back, the invariants are those of the principal values, and a rotation keeps them.
    #[test]
    fn computing_routines() {
        let given = [[3.0, 0.5, 0.7], [0.5, -1.0, 0.2], [0.7, 0.2, 2.0]];
        for (ndi, nshr) in [(3, 3), (3, 1), (2, 1)] {
            for lstr in [1, 2] {
                let axis = if nshr == 3 { [0.3, -0.2, 0.5] } else { [0.0, 0.0, 0.5] };
                let rotation = rotation_about(axis);
                let components = of_counts(ndi as usize, nshr as usize, f64::from(lstr));
                let vector = components.vector(&given);
                let expected = components.symmetric_tensor(&vector);
                let (mut values, mut directions, mut other) = ([0.0; 3], [[0.0; 3]; 3], [0.0; 3]);
                let (mut mean, mut mises, mut turned) = (0.0, 0.0, [0.0; 6]);
                unsafe {
                    sprind_(vector.as_ptr(), &mut values, &mut directions, &lstr, &ndi, &nshr);
                    let columns = transposed(&rotation);
                    rotsig_(vector.as_ptr(), &columns, turned.as_mut_ptr(), &lstr, &ndi, &nshr);
                    sprinc_(turned.as_ptr(), &mut other, &lstr, &ndi, &nshr);
                    let stress = of_counts(ndi as usize, nshr as usize, 1.0).vector(&expected);
                    sinv_(stress.as_ptr(), &mut mean, &mut mises, &ndi, &nshr);
                }
                // AN(K, I) lies at [I][K]: a column of AN in Fortran is a row here.
                let diagonal = [[values[0], 0.0, 0.0], [0.0, values[1], 0.0], [0.0, 0.0, values[2]]];
                let back = product3(&directions, &diagonal, &transposed(&directions));
                assert!(norm(&sum(&back, -1.0, &expected)) < 1e-14 * norm(&expected));
                assert!((0..3).all(|k| (values[k] - other[k]).abs() < 1e-14) && values.is_sorted());
                let turned = components.symmetric_tensor(&turned);
                let wanted = product3(&rotation, &expected, &transposed(&rotation));
                assert!(norm(&sum(&turned, -1.0, &wanted)) < 1e-14 * norm(&expected));
                let [a, b, c] = values;
                assert!((mean - (a + b + c) / 3.0).abs() < 1e-14);
                let square = ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2)) / 2.0;
                assert!((mises - square.sqrt()).abs() < 1e-14);
            }
        }
    }
}
