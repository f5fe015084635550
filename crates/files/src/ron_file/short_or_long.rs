//! Values of a RON file that have a short and a long form.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, IntoDeserializer, MapAccess, Unexpected, Visitor};

/// Reads a value whose short form is a text or a whole number, and whose long form
/// is a struct.
///
/// `forms` describes both forms in errors. serde's untagged enums are no substitute,
/// because they lose the names of variants and the reason of an error.
///
/// # Errors
///
/// Returns an error if the value has neither form, or a mistake in its long form.
pub fn short_or_long<'de, D, S, L, T>(deserializer: D, forms: &'static str) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    S: Deserialize<'de>,
    L: Deserialize<'de>,
    T: From<S> + From<L>,
{
    deserializer.deserialize_any(ShortOrLong::<S, L, T> {
        forms,
        types: PhantomData,
    })
}

struct ShortOrLong<S, L, T> {
    forms: &'static str,
    types: PhantomData<(S, L, T)>,
}

impl<'de, S, L, T> Visitor<'de> for ShortOrLong<S, L, T>
where
    S: Deserialize<'de>,
    L: Deserialize<'de>,
    T: From<S> + From<L>,
{
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.forms)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        let short: Result<S, E> = S::deserialize(text.into_deserializer());
        // The error of `S` would describe the short form alone.
        let wrong = |_| E::invalid_type(Unexpected::Str(text), &self);
        short.map(T::from).map_err(wrong)
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<T, E> {
        let short: Result<S, E> = S::deserialize(number.into_deserializer());
        let wrong = |_| E::invalid_type(Unexpected::Unsigned(number), &self);
        short.map(T::from).map_err(wrong)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        L::deserialize(MapAccessDeserializer::new(map)).map(T::from)
    }
}
