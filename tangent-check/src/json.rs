//! JSON: reports write it, paths of a user are read from it. A crate for it would take longer to compile than this one.

use std::collections::BTreeMap;
use std::fmt;

/// The members of an object, sorted by their names.
pub(crate) type Map = BTreeMap<String, Value>;

/// A JSON value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Null,
    Bool(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    Object(Map),
}

/// A type with a JSON value. Numbers that are not finite are null.
pub(crate) trait ToJson {
    fn to_json(&self) -> Value;
}

macro_rules! to_json {
    ($($kind:ty: |$value:ident| $json:expr;)*) => {
        $(impl ToJson for $kind { fn to_json(&self) -> Value { let $value = self; $json } })*
    };
}

to_json! {
    Value: |value| value.clone();
    Map: |value| Value::Object(value.clone());
    bool: |value| Value::Bool(*value);
    u8: |value| Value::Whole((*value).into());
    u32: |value| Value::Whole((*value).into());
    u64: |value| Value::Whole(*value);
    usize: |value| Value::Whole(*value as u64);
    f64: |value| if value.is_finite() { Value::Number(*value) } else { Value::Null };
    str: |value| Value::Text(value.to_owned());
    String: |value| Value::Text(value.clone());
}

impl<T: ToJson + ?Sized> ToJson for &T {
    fn to_json(&self) -> Value {
        (**self).to_json()
    }
}

impl<T: ToJson> ToJson for Option<T> {
    fn to_json(&self) -> Value {
        self.as_ref().map_or(Value::Null, ToJson::to_json)
    }
}

impl<T: ToJson> ToJson for [T] {
    fn to_json(&self) -> Value {
        Value::List(self.iter().map(ToJson::to_json).collect())
    }
}

impl<T: ToJson> ToJson for Vec<T> {
    fn to_json(&self) -> Value {
        self.as_slice().to_json()
    }
}

/// An object of names and expressions, or the value of an expression.
macro_rules! json {
    ({ $($name:literal: $value:expr),* $(,)? }) => {
        $crate::json::Value::object(vec![$(($name, $crate::json::ToJson::to_json(&$value))),*])
    };
    ($value:expr) => {
        $crate::json::ToJson::to_json(&$value)
    };
}

pub(crate) use json;

impl FromIterator<Value> for Value {
    fn from_iter<I: IntoIterator<Item = Value>>(values: I) -> Self {
        Self::List(values.into_iter().collect())
    }
}

impl Value {
    /// An object. Each length of an array would compile its own sort of a map.
    pub(crate) fn object(members: Vec<(&str, Value)>) -> Self {
        let mut map = Map::new();
        members.into_iter().for_each(|(name, value)| drop(map.insert(name.to_owned(), value)));
        Self::Object(map)
    }

    /// Adds a member to an object.
    pub(crate) fn insert(&mut self, name: &str, value: Value) {
        if let Self::Object(members) = self {
            members.insert(name.to_owned(), value);
        }
    }

    /// A member of an object.
    pub(crate) fn get(&self, name: &str) -> Option<&Value> {
        if let Self::Object(members) = self { members.get(name) } else { None }
    }

    pub(crate) fn as_number(&self) -> Option<f64> {
        match self {
            Self::Whole(value) => Some(*value as f64),
            Self::Number(value) => Some(*value),
            _ => None,
        }
    }

    pub(crate) fn as_list(&self) -> Option<&[Value]> {
        if let Self::List(values) = self { Some(values) } else { None }
    }

    /// Writes a list or an object between its brackets; `indent` is that of the line in pretty form.
    fn write(&self, f: &mut fmt::Formatter<'_>, indent: usize) -> fmt::Result {
        let [open, close, members]: [&str; 3] = match self {
            Self::Null => return f.write_str("null"),
            Self::Bool(value) => return write!(f, "{value}"),
            Self::Whole(value) => return write!(f, "{value}"),
            Self::Number(value) => return write!(f, "{value:?}"),
            Self::Text(text) => return quote(f, text),
            Self::List(values) => ["[", "]", if values.is_empty() { "" } else { "some" }],
            Self::Object(members) => ["{", "}", if members.is_empty() { "" } else { "some" }],
        };
        let line = |f: &mut fmt::Formatter<'_>, indent: usize| {
            if f.alternate() && !members.is_empty() { write!(f, "\n{:indent$}", "") } else { Ok(()) }
        };
        f.write_str(open)?;
        let mut first = true;
        let mut begin = |f: &mut fmt::Formatter<'_>| {
            f.write_str(if std::mem::take(&mut first) { "" } else { "," })?;
            line(f, indent + 2)
        };
        match self {
            Self::List(values) => values.iter().try_for_each(|value| {
                begin(f)?;
                value.write(f, indent + 2)
            })?,
            Self::Object(members) => members.iter().try_for_each(|(name, value)| {
                begin(f)?;
                quote(f, name)?;
                f.write_str(if f.alternate() { ": " } else { ":" })?;
                value.write(f, indent + 2)
            })?,
            _ => {}
        }
        line(f, indent)?;
        f.write_str(close)
    }
}

/// One line; with `{:#}` a line for each value.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, 0)
    }
}

fn quote(f: &mut fmt::Formatter<'_>, text: &str) -> fmt::Result {
    f.write_str("\"")?;
    for letter in text.chars() {
        match letter {
            '"' => f.write_str("\\\"")?,
            '\\' => f.write_str("\\\\")?,
            '\n' => f.write_str("\\n")?,
            '\r' => f.write_str("\\r")?,
            '\t' => f.write_str("\\t")?,
            letter if letter < ' ' => write!(f, "\\u{:04x}", letter as u32)?,
            letter => write!(f, "{letter}")?,
        }
    }
    f.write_str("\"")
}

/// Reads a value.
///
/// # Errors
/// A sentence: which byte, what is allowed there.
pub(crate) fn parse(text: &str) -> Result<Value, String> {
    let mut reader = Reader { text, at: 0, depth: 0 };
    let value = reader.value()?;
    if reader.next().is_some() { Err(reader.expected("the end of the text")) } else { Ok(value) }
}

/// So deeply may lists and objects be nested.
const DEEPEST: usize = 100;

struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl Reader<'_> {
    fn expected(&self, what: &str) -> String {
        let line = self.text[..self.at].lines().count().max(1);
        format!("line {line}, byte {}: {what} is expected.", self.at + 1)
    }

    /// The next byte behind blanks, which is not taken.
    fn next(&mut self) -> Option<u8> {
        let blanks =
            self.text[self.at..].len() - self.text[self.at..].trim_start_matches([' ', '\n', '\r', '\t']).len();
        self.at += blanks;
        self.text.as_bytes().get(self.at).copied()
    }

    fn take(&mut self, byte: u8) -> Result<(), String> {
        let found = self.next() == Some(byte);
        self.at += usize::from(found);
        if found { Ok(()) } else { Err(self.expected(&format!("`{}`", char::from(byte)))) }
    }

    fn value(&mut self) -> Result<Value, String> {
        match self.next() {
            Some(b'"') => self.text().map(Value::Text),
            Some(b'[') => {
                let mut values = Vec::new();
                self.members(b'[', b']', |reader| reader.value().map(|value| values.push(value)))?;
                Ok(Value::List(values))
            }
            Some(b'{') => {
                let mut members = Map::new();
                self.members(b'{', b'}', |reader| {
                    let name = reader.text()?;
                    reader.take(b':')?;
                    let value = reader.value()?;
                    members.insert(name, value);
                    Ok(())
                })?;
                Ok(Value::Object(members))
            }
            _ => {
                let rest = &self.text[self.at..];
                let word = &rest[..rest.find([',', ']', '}', ' ', '\n', '\r', '\t', ':']).unwrap_or(rest.len())];
                let value = match word {
                    "null" => Some(Value::Null),
                    "true" => Some(Value::Bool(true)),
                    "false" => Some(Value::Bool(false)),
                    // Rust's numbers are a little more than JSON's, such as 1. and +1; words such as inf are none.
                    _ if word.contains(|letter: char| letter.is_alphabetic() && !"eE".contains(letter)) => None,
                    _ => word.parse().ok().map(Value::Number),
                };
                let value = value.ok_or_else(|| self.expected("a value"))?;
                self.at += word.len();
                Ok(value)
            }
        }
    }

    /// Members with commas between them.
    fn members(
        &mut self,
        open: u8,
        close: u8,
        mut member: impl FnMut(&mut Self) -> Result<(), String>,
    ) -> Result<(), String> {
        self.take(open)?;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.expected("less depth"));
        }
        if self.next() != Some(close) {
            member(self)?;
            while self.next() == Some(b',') {
                self.at += 1;
                member(self)?;
            }
        }
        self.depth -= 1;
        self.take(close)
    }

    fn text(&mut self) -> Result<String, String> {
        self.take(b'"')?;
        let mut text = String::new();
        loop {
            let mut rest = self.text[self.at..].chars();
            let letter = rest.next().ok_or_else(|| self.expected("the end of a text"))?;
            self.at += letter.len_utf8();
            match letter {
                '"' => return Ok(text),
                '\\' => {
                    let code = rest.next().unwrap_or_default();
                    let (letter, length) = match code {
                        'n' => ('\n', 1),
                        't' => ('\t', 1),
                        'r' => ('\r', 1),
                        '"' | '\\' | '/' => (code, 1),
                        'u' => {
                            let digits = rest.as_str().get(..4).and_then(|digits| u32::from_str_radix(digits, 16).ok());
                            (digits.and_then(char::from_u32).ok_or_else(|| self.expected("four digits"))?, 5)
                        }
                        _ => return Err(self.expected("one of the letters n t r \" \\ / u")),
                    };
                    text.push(letter);
                    self.at += length;
                }
                letter => text.push(letter),
            }
        }
    }
}
