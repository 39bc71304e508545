//! Arrays for a foreign function, with guard values between them.

use std::fmt::Write;

/// The guard values before, between and behind arrays.
const GUARD: usize = 32;

/// The guard value: a NaN that no computation makes. A law that reads it answers with NaN.
const MARK: u64 = 0x7ff8_bf4e_e1a3_5eed;

/// The arrays of a foreign function in the order of its arguments: the enum of their indices, and their arena with names and lengths.
macro_rules! arrays {
    (($($size:ident),*): $($(#[$about:meta])* $array:ident $name:literal $length:expr,)*) => {
        #[derive(Clone, Copy)]
        enum Array {
            $($(#[$about])* $array),*
        }

        fn arena($($size: usize),*) -> Arena {
            Arena::new(&[$(($name, $length)),*])
        }
    };
}

pub(super) use arrays;

/// Arrays in one piece of memory. A write outside an array, by less than the guard, is seen.
pub(super) struct Arena {
    numbers: Vec<f64>,
    arrays: Vec<Array>,
}

struct Array {
    name: &'static str,
    start: usize,
    length: usize,
}

impl Arena {
    /// Arrays of zeros with these names and lengths.
    pub(super) fn new(arrays: &[(&'static str, usize)]) -> Self {
        let mark = f64::from_bits(MARK);
        let mut arena = Self { numbers: vec![mark; GUARD], arrays: Vec::new() };
        for &(name, length) in arrays {
            arena.arrays.push(Array { name, start: arena.numbers.len(), length });
            arena.numbers.resize(arena.numbers.len() + length, 0.0);
            arena.numbers.resize(arena.numbers.len() + GUARD, mark);
        }
        arena
    }

    /// The array with this index.
    pub(super) fn get(&self, index: usize) -> &[f64] {
        let Array { start, length, .. } = self.arrays[index];
        &self.numbers[start..start + length]
    }

    /// The array with this index.
    pub(super) fn get_mut(&mut self, index: usize) -> &mut [f64] {
        let Array { start, length, .. } = self.arrays[index];
        &mut self.numbers[start..start + length]
    }

    /// Pointers to the arrays. They are valid until the arena is used again.
    pub(super) fn pointers<const COUNT: usize>(&mut self) -> [*mut f64; COUNT] {
        let base = self.numbers.as_mut_ptr();
        std::array::from_fn(|index| base.wrapping_add(self.arrays[index].start))
    }

    /// Looks at the guard values, and restores them.
    ///
    /// # Errors
    /// A sentence: which array the writes were next to.
    pub(super) fn check(&mut self) -> Result<(), String> {
        let mut sentence = String::new();
        for place in 0..=self.arrays.len() {
            let start = if place == 0 { 0 } else { self.arrays[place - 1].start + self.arrays[place - 1].length };
            let guard = &mut self.numbers[start..start + GUARD];
            if guard.iter().all(|number| number.to_bits() == MARK) {
                continue;
            }
            let written = |number: &f64| number.to_bits() != MARK;
            let past = place > 0 && guard[..GUARD / 2].iter().any(written);
            let before = place < self.arrays.len() && (place == 0 || guard[GUARD / 2..].iter().any(written));
            guard.fill(f64::from_bits(MARK));
            if past {
                let Array { name, length, .. } = self.arrays[place - 1];
                let _ = write!(sentence, "The library wrote past the end of {name}, which has {length} numbers. ");
            }
            if before {
                let name = self.arrays[place].name;
                let _ = write!(sentence, "The library wrote before the start of {name}. ");
            }
        }
        if sentence.is_empty() { Ok(()) } else { Err(sentence.trim_end().into()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A write into a guard is said once, with the array that it belongs to; a write into an array is not.
    #[test]
    fn guards() {
        let mut arena = Arena::new(&[("STRESS", 6), ("STATEV", 2)]);
        arena.get_mut(1).copy_from_slice(&[1.0, f64::NAN]);
        assert_eq!(arena.check(), Ok(()));
        let past = arena.arrays[1].start + 2;
        arena.numbers[past] = 3.0;
        assert_eq!(arena.check(), Err("The library wrote past the end of STATEV, which has 2 numbers.".into()));
        assert_eq!(arena.check(), Ok(()));
        arena.numbers[GUARD - 1] = 3.0;
        assert_eq!(arena.check(), Err("The library wrote before the start of STRESS.".into()));
        assert_eq!(arena.get(1)[0], 1.0);
    }
}
