//! Lists of a fixed length.

use std::{fmt, marker::PhantomData};

use serde::{
    Deserialize, Deserializer,
    de::{Error, SeqAccess, Visitor},
};

/// A list of exactly `N` values. Serde's own array would silently drop further values of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exactly<T, const N: usize>(pub [T; N]);

/// A type of element of such a list.
pub trait Element {
    /// The plural of the element's name.
    const PLURAL: &'static str;
}

impl Element for f64 {
    const PLURAL: &'static str = "numbers";
}

impl Element for String {
    const PLURAL: &'static str = "names";
}

impl<'de, T: Element + Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(List(PhantomData))
    }
}

struct List<T, const N: usize>(PhantomData<T>);

impl<'de, T: Element + Deserialize<'de>, const N: usize> Visitor<'de> for List<T, N> {
    type Value = Exactly<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match N {
            2 => f.write_str("two, the lower and the upper"),
            3 => f.write_str("three, x, y, z"),
            _ => write!(f, "{N} {}", T::PLURAL),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::with_capacity(N);
        while let Some(value) = sequence.next_element()? {
            values.push(value);
        }
        let count = values.len();
        let expected: &dyn serde::de::Expected = &self;
        let wrong = |_| Error::custom(format!("has {count} {}, expected {expected}", T::PLURAL));
        values.try_into().map(Exactly).map_err(wrong)
    }
}
