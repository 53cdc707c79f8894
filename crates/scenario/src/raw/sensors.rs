//! One sensor, or several.

use std::fmt;

use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};
use toml::Spanned;

use body_schema_engine::sensing::Keys;

/// One `[sensor]`, or any number of `[[sensor]]`.
#[derive(Debug)]
pub struct Sensors(pub Vec<Spanned<Keys>>);

impl<'de> Deserialize<'de> for Sensors {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrMore)
    }
}

struct OneOrMore;

impl<'de> Visitor<'de> for OneOrMore {
    type Value = Sensors;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table [sensor], or several [[sensor]]")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let keys = Keys::deserialize(MapAccessDeserializer::new(map))?;
        // The place of the only table is that of the key.
        Ok(Sensors(vec![Spanned::new(0..0, keys)]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
        let mut sensors = Vec::new();
        while let Some(sensor) = sequence.next_element()? {
            sensors.push(sensor);
        }
        Ok(Sensors(sensors))
    }
}
