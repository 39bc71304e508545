//! Requests and answers as bytes: numbers in little-endian order, vectors and texts after their length.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::time::Duration;

use crate::convention::{Components, Convention, Measure, Tensor};
use crate::law::{Response, Step};
use crate::library::{Description, Kind, Signature, StressState};

/// A message under construction.
#[derive(Default)]
pub(super) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    pub(super) fn byte(&mut self, byte: u8) {
        self.bytes.push(byte);
    }

    fn count(&mut self, count: usize) {
        self.bytes.extend((count as u64).to_le_bytes());
    }

    fn number(&mut self, number: f64) {
        self.bytes.extend(number.to_le_bytes());
    }

    pub(super) fn seconds(&mut self, duration: Duration) {
        self.number(duration.as_secs_f64());
    }

    fn numbers(&mut self, numbers: &[f64]) {
        self.count(numbers.len());
        for &number in numbers {
            self.number(number);
        }
    }

    fn text(&mut self, text: &[u8]) {
        self.count(text.len());
        self.bytes.extend(text);
    }

    fn texts(&mut self, texts: &[String]) {
        self.count(texts.len());
        for text in texts {
            self.text(text.as_bytes());
        }
    }

    /// The answer that is a sentence.
    pub(super) fn sentence(&mut self, sentence: &str) {
        self.byte(0);
        self.text(sentence.as_bytes());
    }

    fn named(&mut self, values: &[(String, f64)]) {
        self.count(values.len());
        for (name, value) in values {
            self.text(name.as_bytes());
            self.number(*value);
        }
    }

    pub(super) fn description(&mut self, description: &Description) {
        self.text(description.library.as_os_str().as_bytes());
        match &description.kind {
            Kind::Umat { material, tangent, temperature } => {
                self.byte(0);
                self.text(material.as_bytes());
                self.measure(*tangent);
                self.number(*temperature);
            }
            Kind::Mfront { name, external } => {
                self.byte(1);
                self.text(name.as_bytes());
                self.named(external);
            }
            Kind::C { name } => {
                self.byte(2);
                self.text(name.as_bytes());
            }
        }
        self.numbers(&description.properties);
        self.named(&description.state);
        self.byte(description.stress_state as u8);
    }

    fn measure(&mut self, measure: Measure) {
        let index = Measure::ALL.iter().position(|known| *known == measure);
        self.byte(index.map_or(u8::MAX, |index| index as u8));
    }

    fn components(&mut self, components: &Components) {
        self.count(components.pairs.len());
        for &(row, column) in &components.pairs {
            self.byte(row as u8);
            self.byte(column as u8);
        }
        self.number(components.shear);
    }

    pub(super) fn signature(&mut self, signature: &Signature) {
        self.text(signature.name.as_bytes());
        self.measure(signature.convention.measure);
        self.components(&signature.convention.stress);
        self.components(&signature.convention.strain);
        self.texts(&signature.properties);
        self.texts(&signature.state);
        self.numbers(&signature.state_at_rest);
    }

    pub(super) fn step(&mut self, step: &Step) {
        self.number(step.time);
        self.number(step.length);
        self.count(step.number);
        let tensors = [&step.gradient_before, &step.gradient, &step.strain, &step.strain_increment, &step.rotation];
        for number in tensors.into_iter().flatten().flatten() {
            self.number(*number);
        }
        self.numbers(&step.stress);
        self.numbers(&step.state);
    }

    pub(super) fn response(&mut self, response: &Response) {
        self.numbers(&response.stress);
        self.numbers(&response.tangent.entries);
        self.numbers(&response.state);
    }
}

/// A message that is read. All functions give `None` where it ends too early or makes no sense.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        let (byte, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*byte)
    }

    fn eight(&mut self) -> Option<[u8; 8]> {
        let (bytes, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*bytes)
    }

    /// A count of things that take at least a byte each.
    fn count(&mut self) -> Option<usize> {
        let count = usize::try_from(u64::from_le_bytes(self.eight()?)).ok()?;
        (count <= self.bytes.len()).then_some(count)
    }

    fn number(&mut self) -> Option<f64> {
        self.eight().map(f64::from_le_bytes)
    }

    pub(super) fn seconds(&mut self) -> Option<Duration> {
        Duration::try_from_secs_f64(self.number()?).ok()
    }

    /// Reads numbers into a vector, whose memory is kept.
    fn read(&mut self, numbers: &mut Vec<f64>) -> Option<()> {
        let count = self.count()?;
        numbers.clear();
        for _ in 0..count {
            numbers.push(self.number()?);
        }
        Some(())
    }

    /// Reads as many numbers as `numbers` has.
    fn read_all(&mut self, numbers: &mut [f64]) -> Option<()> {
        if self.count()? != numbers.len() {
            return None;
        }
        for number in numbers {
            *number = self.number()?;
        }
        Some(())
    }

    fn numbers(&mut self) -> Option<Vec<f64>> {
        let mut numbers = Vec::new();
        self.read(&mut numbers)?;
        Some(numbers)
    }

    fn text_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.count()?;
        let (text, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(text)
    }

    pub(super) fn text(&mut self) -> Option<String> {
        self.text_bytes().map(|text| String::from_utf8_lossy(text).into_owned())
    }

    fn texts(&mut self) -> Option<Vec<String>> {
        (0..self.count()?).map(|_| self.text()).collect()
    }

    fn named(&mut self) -> Option<Vec<(String, f64)>> {
        (0..self.count()?).map(|_| Some((self.text()?, self.number()?))).collect()
    }

    pub(super) fn description(&mut self) -> Option<Description> {
        let library = OsStr::from_bytes(self.text_bytes()?).into();
        let kind = match self.byte()? {
            0 => Kind::Umat { material: self.text()?, tangent: self.measure()?, temperature: self.number()? },
            1 => Kind::Mfront { name: self.text()?, external: self.named()? },
            2 => Kind::C { name: self.text()? },
            _ => return None,
        };
        let properties = self.numbers()?;
        let state = self.named()?;
        let stress_state = *StressState::ALL.get(usize::from(self.byte()?))?;
        Some(Description { library, kind, properties, state, stress_state })
    }

    fn measure(&mut self) -> Option<Measure> {
        Measure::ALL.get(usize::from(self.byte()?)).copied()
    }

    fn components(&mut self) -> Option<Components> {
        let count = self.count()?;
        let mut index = || self.byte().map(usize::from).filter(|index| *index < 3);
        let pairs = (0..count).map(|_| Some((index()?, index()?))).collect::<Option<_>>()?;
        Some(Components { pairs, shear: self.number()? })
    }

    pub(super) fn signature(&mut self) -> Option<Signature> {
        Some(Signature {
            name: self.text()?,
            convention: Convention { measure: self.measure()?, stress: self.components()?, strain: self.components()? },
            properties: self.texts()?,
            state: self.texts()?,
            state_at_rest: self.numbers()?,
        })
    }

    fn tensor(&mut self) -> Option<Tensor> {
        let mut tensor = Tensor::default();
        for number in tensor.as_flattened_mut() {
            *number = self.number()?;
        }
        Some(tensor)
    }

    pub(super) fn step(&mut self, step: &mut Step) -> Option<()> {
        step.time = self.number()?;
        step.length = self.number()?;
        step.number = usize::try_from(u64::from_le_bytes(self.eight()?)).ok()?;
        step.gradient_before = self.tensor()?;
        step.gradient = self.tensor()?;
        step.strain = self.tensor()?;
        step.strain_increment = self.tensor()?;
        step.rotation = self.tensor()?;
        self.read(&mut step.stress)?;
        self.read(&mut step.state)
    }

    /// Reads into a response that has the law's sizes.
    pub(super) fn response(&mut self, response: &mut Response) -> Option<()> {
        self.read_all(&mut response.stress)?;
        self.read_all(&mut response.tangent.entries)?;
        self.read_all(&mut response.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Step;
    use crate::library::{empty_response, umat};

    /// A reader gives back the written values; a message that is cut anywhere gives `None` instead of a panic.
    #[test]
    fn round_trip() {
        let description = Description {
            library: "lib mine.so".into(),
            kind: Kind::Mfront { name: "N".into(), external: vec![("T".into(), 3.0)] },
            properties: vec![1.0, -2.5],
            state: umat::state(2),
            stress_state: StressState::PlaneStress,
        };
        let mut writer = Writer::default();
        writer.description(&description);
        assert_eq!(Reader::new(writer.bytes()).description(), Some(description));
        for length in 0..writer.bytes().len() {
            assert_eq!(Reader::new(&writer.bytes()[..length]).description(), None);
        }
        let mut step = Step::at_rest();
        step.number = 13;
        step.stress = vec![1.0; 6];
        writer.clear();
        writer.step(&step);
        let mut read = Step::at_rest();
        assert_eq!(Reader::new(writer.bytes()).step(&mut read), Some(()));
        assert_eq!(read, step);
        let mut response = empty_response();
        assert_eq!(Reader::new(&[255; 40]).response(&mut response), None);
    }
}
