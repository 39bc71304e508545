//! Requests and answers as bytes: numbers in little-endian order, vectors and texts after their length, structures field by field.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::time::Duration;

use crate::convention::{Components, Convention, Measure, Tensor};
use crate::law::{Response, Step};
use crate::library::{Description, Kind, Signature, StressState};
use crate::matrix::Matrix;

/// A value that a message can hold.
pub(super) trait Sent: Sized {
    fn write(&self, to: &mut Vec<u8>);

    /// Takes the value from the front of a message; `None` where the message ends too early or makes no sense.
    fn read(from: &mut &[u8]) -> Option<Self>;
}

/// Structures, each with its fields in the order of the message.
macro_rules! sent {
    ($($kind:ident { $($field:ident),* })*) => {
        $(impl Sent for $kind {
            fn write(&self, to: &mut Vec<u8>) {
                $(self.$field.write(to);)*
            }

            fn read(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: Sent::read(from)?),* })
            }
        })*
    };
}

sent! {
    Description { library, kind, properties, state, stress_state }
    Signature { name, convention, properties, state, state_at_rest }
    Convention { measure, stress, strain }
    Components { pairs, shear }
    Step { time, length, number, gradient_before, gradient, strain, strain_increment, rotation, stress, state }
    Response { stress, tangent, state }
    Matrix { rows, columns, entries }
}

/// Values that pass through another type.
macro_rules! sent_as {
    ($($kind:ty as $other:ty: |$value:ident| $there:expr, |$back:ident| $here:expr;)*) => {
        $(impl Sent for $kind {
            fn write(&self, to: &mut Vec<u8>) {
                let $value = self;
                let sent: $other = $there;
                sent.write(to);
            }

            fn read(from: &mut &[u8]) -> Option<Self> {
                let $back = <$other>::read(from)?;
                $here
            }
        })*
    };
}

sent_as! {
    usize as u64: |value| *value as u64, |count| count.try_into().ok();
    f64 as u64: |value| value.to_bits(), |bits| Some(f64::from_bits(bits));
    Duration as f64: |value| value.as_secs_f64(), |seconds| Duration::try_from_secs_f64(seconds).ok();
    String as Vec<u8>: |text| text.clone().into_bytes(), |bytes| Some(String::from_utf8_lossy(&bytes).into_owned());
    PathBuf as Vec<u8>: |path| path.as_os_str().as_bytes().to_vec(), |bytes| Some(OsStr::from_bytes(&bytes).into());
    Tensor as Vec<f64>: |tensor| tensor.as_flattened().to_vec(), |numbers| {
        let numbers: [f64; 9] = numbers.try_into().ok()?;
        Some(crate::tensor::from_entries(|i, j| numbers[3 * i + j]))
    };
    Measure as u8: |value| Self::ALL.iter().position(|known| known == value).unwrap_or(usize::MAX) as u8,
        |index| Self::ALL.get(usize::from(index)).copied();
    StressState as u8: |value| *value as u8, |index| Self::ALL.get(usize::from(index)).copied();
}

impl Sent for u8 {
    fn write(&self, to: &mut Vec<u8>) {
        to.push(*self);
    }

    fn read(from: &mut &[u8]) -> Option<Self> {
        from.split_off_first().copied()
    }
}

impl Sent for u64 {
    fn write(&self, to: &mut Vec<u8>) {
        to.extend(self.to_le_bytes());
    }

    fn read(from: &mut &[u8]) -> Option<Self> {
        let (bytes, rest) = from.split_first_chunk()?;
        *from = rest;
        Some(Self::from_le_bytes(*bytes))
    }
}

impl<A: Sent, B: Sent> Sent for (A, B) {
    fn write(&self, to: &mut Vec<u8>) {
        self.0.write(to);
        self.1.write(to);
    }

    fn read(from: &mut &[u8]) -> Option<Self> {
        Some((A::read(from)?, B::read(from)?))
    }
}

impl<T: Sent> Sent for Vec<T> {
    fn write(&self, to: &mut Vec<u8>) {
        self.len().write(to);
        self.iter().for_each(|value| value.write(to));
    }

    fn read(from: &mut &[u8]) -> Option<Self> {
        // Each value takes a byte at least, so that no length asks for more memory than the message has.
        let count = usize::read(from).filter(|count| *count <= from.len())?;
        (0..count).map(|_| T::read(from)).collect()
    }
}

impl Sent for Kind {
    fn write(&self, to: &mut Vec<u8>) {
        match self {
            Self::Umat { material, tangent, temperature } => {
                (0_u8, material.clone()).write(to);
                (*tangent, *temperature).write(to);
            }
            Self::Mfront { name, external } => ((1_u8, name.clone()), external.clone()).write(to),
            Self::C { name } => (2_u8, name.clone()).write(to),
        }
    }

    fn read(from: &mut &[u8]) -> Option<Self> {
        Some(match <(u8, String)>::read(from)? {
            (0, material) => Self::Umat { material, tangent: Sent::read(from)?, temperature: Sent::read(from)? },
            (1, name) => Self::Mfront { name, external: Sent::read(from)? },
            (2, name) => Self::C { name },
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::umat;

    /// The written values are read back; a message that is cut anywhere gives `None` instead of a panic.
    #[test]
    fn round_trip() {
        let description = Description {
            library: "lib mine.so".into(),
            kind: Kind::Mfront { name: "N".into(), external: vec![("T".into(), 3.0)] },
            properties: vec![1.0, -2.5],
            state: umat::state(2),
            stress_state: StressState::PlaneStress,
        };
        let step = Step { number: 13, stress: vec![1.0; 6], ..Step::at_rest() };
        let mut bytes = Vec::new();
        (description.clone(), step.clone()).write(&mut bytes);
        assert_eq!(Sent::read(&mut &bytes[..]), Some((description, step)));
        for length in 0..bytes.len() {
            assert_eq!(<(Description, Step)>::read(&mut &bytes[..length]), None);
        }
        assert_eq!(Response::read(&mut &[255; 40][..]), None);
    }
}
