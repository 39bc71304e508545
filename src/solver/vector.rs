//! Operations on long vectors whose results do not depend on the number of threads.
//!
//! A reduction is cut into chunks of fixed length; the sums of the chunks are added in their order, whichever thread made
//! them. Every function takes vectors of one length (the shorter one counts if they differ). Squares are formed as they
//! are: entries should lie between 1e-150 and 1e150 in magnitude, or be zero.

use rayon::prelude::*;

/// Entries per partial sum.
const CHUNK: usize = 4096;

/// Below this length waking the threads costs more than the work.
const PARALLEL: usize = 8 * CHUNK;

/// Independent accumulators inside a chunk, so that the compiler may use vector instructions without changing the order.
const LANES: usize = 8;

/// `Σ xᵢ yᵢ`
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    if x.len() < PARALLEL {
        x.chunks(CHUNK).zip(y.chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).sum()
    } else {
        let partial: Vec<f64> = x.par_chunks(CHUNK).zip(y.par_chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).collect();
        partial.iter().sum()
    }
}

fn dot_chunk(x: &[f64], y: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    for (x, y) in x.chunks(LANES).zip(y.chunks(LANES)) {
        for ((sum, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    lanes.iter().sum()
}

/// `√(Σ xᵢ²)`; not finite if any entry is not.
pub fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// `y ← a x + y`
pub fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    update(x, y, |x, y| a * x + y);
}

/// `y ← x + b y`
pub fn xpby(x: &[f64], b: f64, y: &mut [f64]) {
    update(x, y, |x, y| x + b * y);
}

/// `y ← a x`
pub fn scaled(a: f64, x: &[f64], y: &mut [f64]) {
    update(x, y, |x, _| a * x);
}

fn update(x: &[f64], y: &mut [f64], f: impl Fn(f64, f64) -> f64 + Sync) {
    let chunk = |(x, y): (&[f64], &mut [f64])| {
        for (x, y) in x.iter().zip(y) {
            *y = f(*x, *y);
        }
    };
    if y.len() < PARALLEL {
        chunk((x, y));
    } else {
        x.par_chunks(CHUNK).zip(y.par_chunks_mut(CHUNK)).for_each(chunk);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::irregular;
    use super::*;

    #[test]
    fn reductions_do_not_depend_on_the_number_of_threads() {
        let x = irregular(300_001);
        let y: Vec<f64> = x.iter().map(|x| 1.0 / (x + 1.5)).collect();
        let sequential: f64 = x.chunks(CHUNK).zip(y.chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).sum();
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (parallel, added) = pool.install(|| {
                let mut z = y.clone();
                axpy(0.1, &x, &mut z);
                (dot(&x, &y), z)
            });
            assert_eq!(parallel.to_bits(), sequential.to_bits(), "{threads} threads");
            assert!(added.iter().zip(&x).zip(&y).all(|((z, x), y)| z.to_bits() == (0.1 * x + y).to_bits()));
        }
    }

    #[test]
    fn every_entry_counts_once() {
        // Sums of integers are exact in any order: Σ i = n(n+1)/2, at lengths around lanes, chunks and the switch.
        for n in [0, 1, 7, 8, 9, CHUNK - 1, CHUNK, CHUNK + 1, PARALLEL - 1, PARALLEL, PARALLEL + 5] {
            let x: Vec<f64> = (1..=n).map(|i| i as f64).collect();
            assert_eq!(dot(&x, &vec![1.0; n]), (n * (n + 1) / 2) as f64, "{n}");
            let mut y = x.clone();
            xpby(&x, 2.0, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == 3.0 * x), "{n}");
            scaled(-2.0, &x, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == -2.0 * x), "{n}");
        }
    }

    #[test]
    fn norm_scales_exactly_with_powers_of_two_and_keeps_nan() {
        let x = irregular(10_000);
        for exponent in [-121, -30, 1, 31, 120] {
            let factor = 2.0_f64.powi(exponent);
            let scaled: Vec<f64> = x.iter().map(|x| factor * x).collect();
            assert_eq!(norm(&scaled).to_bits(), (factor * norm(&x)).to_bits());
        }
        let mut x = x;
        x[7777] = f64::NAN;
        assert!(norm(&x).is_nan());
    }
}
