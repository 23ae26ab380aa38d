//! A value given by the name of a preset, or in full.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use offbd_core::vocabulary::Invalid;

/// The name of a preset, or a complete value.
#[derive(Clone, Debug)]
pub enum PresetOr<T> {
    Named(String),
    Value(T),
}

impl<T> PresetOr<T> {
    /// Returns the preset of this name among `presets`, or the conversion of the value by
    /// `full`.
    ///
    /// # Errors
    /// [`Invalid`] at `element` for an unknown name, or the error of `full`.
    pub(super) fn resolve<V: Copy>(
        &self,
        element: &str,
        presets: &[(&'static str, V)],
        full: impl Fn(&T) -> Result<V, Invalid>,
    ) -> Result<V, Invalid> {
        let name = match self {
            Self::Value(view) => return full(view),
            Self::Named(name) => name,
        };
        presets.iter().find(|(known, _)| known == name).map(|(_, value)| *value).ok_or_else(|| {
            let known: Vec<&str> = presets.iter().map(|(known, _)| *known).collect();
            Invalid::new(element, format!("`{name}` is not one of {}", known.join(", ")))
        })
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for PresetOr<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PresetOrVisitor(PhantomData))
    }
}

/// Accepts a string or an object. An untagged enum would lose the path of an error inside
/// the object.
struct PresetOrVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for PresetOrVisitor<T> {
    type Value = PresetOr<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a preset, or an object")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
        Ok(PresetOr::Named(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(PresetOr::Value)
    }
}
