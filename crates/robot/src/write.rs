//! Writing a description with other origins.

use std::ops::Range;

use nalgebra::Isometry3;

use super::{
    Chain, Urdf,
    element::{Insert, OriginText},
    rotation::rpy,
};

impl Urdf {
    /// This description with the origins of `chain`, a chain of it. Only the values of `xyz`, and of `rpy` or `quat_xyzw`,
    /// change in those joints' `<origin>` that differ; every other byte stays. Missing attributes and elements are added.
    /// Numbers are the shortest that read back exactly.
    pub fn written(&self, chain: &Chain) -> String {
        let mut edits: Vec<(Range<usize>, String)> = Vec::new();
        for segment in &chain.segments {
            let Some(Ok(body)) = self.joints.get(segment.element).map(|joint| &joint.body) else { continue };
            if segment.origin != body.origin {
                edit(&body.text, &body.origin, &segment.origin, &mut edits);
            }
        }
        // Attributes that are added to one element stay in their order.
        edits.sort_by_key(|(range, _)| range.start);
        let mut text = String::with_capacity(self.text.len() + 64 * edits.len());
        let mut done = 0;
        for (range, value) in edits {
            text.push_str(&self.text[done..range.start]);
            text.push_str(&value);
            done = range.end;
        }
        text.push_str(&self.text[done..]);
        text
    }
}

fn edit(place: &OriginText, old: &Isometry3<f64>, new: &Isometry3<f64>, edits: &mut Vec<(Range<usize>, String)>) {
    let xyz = numbers(new.translation.vector.as_slice());
    let rotation = match place.rpy {
        Some(near) => numbers(&rpy(&new.rotation, near)),
        None => numbers(new.rotation.coords.as_slice()),
    };
    let at = match &place.insert {
        Insert::Element { at, space } => {
            edits.push((*at..*at, format!("<origin xyz=\"{xyz}\" rpy=\"{rotation}\"/>{space}")));
            return;
        }
        Insert::Attribute(at) => *at,
    };
    // A quaternion is never missing: where none is written there is `rpy`, or room for it.
    for (name, value, range, is_new) in [
        ("xyz", xyz, &place.xyz, new.translation != old.translation),
        ("rpy", rotation, &place.rotation, new.rotation != old.rotation),
    ] {
        match range {
            _ if !is_new => {}
            Some(range) => edits.push((range.clone(), value)),
            None => edits.push((at..at, format!(" {name}=\"{value}\""))),
        }
    }
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ")
}

/// The shortest text that reads back exactly.
pub(super) fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1e-4..1e15 => value.to_string(),
        _ => format!("{value:e}"),
    }
}
