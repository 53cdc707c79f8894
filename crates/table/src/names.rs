//! The names of columns: which component of a reading a column holds, and in which unit. All reading and writing of such
//! names happens here.
//!
//! A title consists of what is measured, the [`Component`], and the unit: `hand_x_mm`, `Hand X (mm)`, `cam_tag_u1`, `qw`.
//! Capitals do not matter.

use std::fmt;

use super::Quantity;

/// A number of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// The x coordinate.
    X,
    /// The y coordinate.
    Y,
    /// The z coordinate.
    Z,
    /// The x component of a rotation vector.
    Rx,
    /// The y component of a rotation vector.
    Ry,
    /// The z component of a rotation vector.
    Rz,
    /// The angle about the fixed x axis, applied first.
    Roll,
    /// The angle about the fixed y axis, applied second.
    Pitch,
    /// The angle about the fixed z axis, applied last.
    Yaw,
    /// The x component of a quaternion.
    Qx,
    /// The y component of a quaternion.
    Qy,
    /// The z component of a quaternion.
    Qz,
    /// The scalar component of a quaternion.
    Qw,
    /// The coordinate to the right in a picture.
    U,
    /// The coordinate downwards in a picture.
    V,
    /// A length between two points.
    Distance,
    /// A length along the direction in which a camera looks, or above a plane.
    Depth,
}

use Component::*;

impl Component {
    /// All of them.
    pub const ALL: [Self; 17] = [X, Y, Z, Rx, Ry, Rz, Roll, Pitch, Yaw, Qx, Qy, Qz, Qw, U, V, Distance, Depth];
    /// The coordinates of a position.
    pub const PLACE: [Self; 3] = [X, Y, Z];

    /// The component's names in titles: first the one that is written, then others that are read.
    fn spellings(self) -> &'static [&'static str] {
        match self {
            X => &["x"],
            Y => &["y"],
            Z => &["z"],
            Rx => &["rx", "phix"],
            Ry => &["ry", "phiy"],
            Rz => &["rz", "phiz"],
            Roll => &["roll"],
            Pitch => &["pitch"],
            Yaw => &["yaw"],
            Qx => &["qx"],
            Qy => &["qy"],
            Qz => &["qz"],
            Qw => &["qw"],
            U => &["u"],
            V => &["v"],
            Distance => &["distance"],
            Depth => &["depth"],
        }
    }

    /// The component's name in titles.
    pub fn name(self) -> &'static str {
        self.spellings()[0]
    }

    /// The quantity that it measures.
    pub fn quantity(self) -> Quantity {
        match self {
            X | Y | Z | Distance | Depth => Quantity::Length,
            Rx | Ry | Rz | Roll | Pitch | Yaw => Quantity::Angle,
            Qx | Qy | Qz | Qw => Quantity::Number,
            U | V => Quantity::Pixels,
        }
    }

    fn called(word: &str) -> Option<Self> {
        let is_called = |component: &Self| component.spellings().iter().any(|name| word.eq_ignore_ascii_case(name));
        Self::ALL.into_iter().find(is_called)
    }
}

/// Words that stand between letters of coordinates and say what these turn: quaternions, rotation vectors, or either.
const QUATERNIONS: [&str; 3] = ["q", "quat", "quaternion"];
const VECTORS: [&str; 3] = ["r", "rvec", "rotvec"];
const EITHER: [&str; 4] = ["rot", "rotation", "ori", "orientation"];

/// A title, taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Title<'a> {
    /// The part before the component: a target, or a camera and a target. Empty where there is none.
    pub before: &'a str,
    /// The component.
    pub component: Component,
    /// The digits behind the component: `1` of `u1`. Empty where there are none.
    pub number: &'a str,
    /// The word for the unit at its end; empty where there is none.
    pub unit: &'a str,
}

impl<'a> Title<'a> {
    /// The parts of a title; `None` if it ends with no component's name.
    pub fn parse(title: &'a str) -> Option<Self> {
        let (stem, unit) = split(title);
        let (before, last) = last_word(stem);
        let bare = last.trim_end_matches(|c: char| c.is_ascii_digit());
        Some(Self { before, component: Component::called(bare)?, number: &last[bare.len()..], unit })
    }

    /// Whether the title is about `name`.
    pub fn is_of(&self, name: &str) -> bool {
        self.before.eq_ignore_ascii_case(name.trim_end_matches(is_gap))
    }
}

impl fmt::Display for Title<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { before, component, number, unit } = self;
        let gap = |word: &str| if word.is_empty() { "" } else { "_" };
        write!(f, "{before}{}{}{number}{}{unit}", gap(before), component.name(), gap(unit))
    }
}

/// The component that a title in a list names, where the list says the rest: `x_tool`, `rot_x` and `tx` are understood
/// too. `all` are the lower-case last words of the list.
pub(super) fn listed(title: &str, all: &[String]) -> Option<Component> {
    let is_quaternion = all.len() == 7;
    let stem = split(title).0;
    let words: Vec<String> = stem
        .split(is_gap)
        .filter(|word| !word.is_empty())
        .map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()).to_ascii_lowercase())
        .collect();
    let (last, others) = words.split_last()?;
    let word = last_word(stem).1.to_ascii_lowercase();
    let beside = |list: &[&str], word: Option<&String>| word.is_some_and(|word| list.contains(&word.as_str()));
    // A letter, and the word beside it that may say what the letter is of.
    let turned = |letter: &str, word: Option<&String>| {
        let is_quaternion = beside(&QUATERNIONS, word) || beside(&EITHER, word) && is_quaternion;
        let is_turned = is_quaternion || beside(&VECTORS, word) || beside(&EITHER, word);
        let sort = if is_quaternion { "q" } else { "r" };
        Component::called(&if is_turned { format!("{sort}{letter}") } else { letter.to_owned() })
    };
    let is_alone = |letter: &str| matches!(letter, "x" | "y" | "z" | "w");
    if is_alone(last) {
        let found = turned(last, others.last());
        return found.or_else(|| (is_quaternion && last == "w").then_some(Qw));
    }
    let scalar_first = |names: [&str; 4]| {
        let at = names.iter().position(|name| word == *name)?;
        (is_quaternion && all.iter().any(|word| word == names[0])).then(|| [Qw, Qx, Qy, Qz][at])
    };
    let found = Component::called(last)
        .or_else(|| ["tx", "ty", "tz"].iter().position(|name| last == name).map(|axis| Component::PLACE[axis]))
        .or_else(|| ["px", "py", "pz"].iter().position(|name| last == name).map(|axis| Component::PLACE[axis]))
        .or_else(|| scalar_first(["q0", "q1", "q2", "q3"]))
        .or_else(|| scalar_first(["qr", "qi", "qj", "qk"]))
        .or_else(|| scalar_first(["w", "i", "j", "k"]));
    let of_first = |first: &String| if is_alone(first) { turned(first, Some(last)) } else { Component::called(first) };
    found.or_else(|| others.first().and_then(of_first))
}

/// The last words of titles, in lower case.
pub(super) fn last_words(titles: &[String]) -> Vec<String> {
    titles.iter().map(|title| last_word(split(title).0).1.to_ascii_lowercase()).collect()
}

fn is_gap(c: char) -> bool {
    matches!(c, '_' | ' ' | '.')
}

/// A stem without its last word, and that word.
fn last_word(stem: &str) -> (&str, &str) {
    match stem.rfind(is_gap) {
        Some(at) => (stem[..at].trim_end_matches(is_gap), &stem[at + 1..]),
        None => ("", stem),
    }
}

/// A unit, by the words at the end of a title that say it.
struct Unit {
    quantity: Quantity,
    /// The factor that turns numbers in this unit into metres, radians or pixels.
    factor: f64,
    words: &'static [&'static str],
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const UNITS: [Unit; 8] = [
    Unit { quantity: Quantity::Length, factor: 1.0, words: &["m", "metre", "metres", "meter", "meters"] },
    Unit {
        quantity: Quantity::Length,
        factor: 1e-2,
        words: &["cm", "centimetre", "centimetres", "centimeter", "centimeters"],
    },
    Unit {
        quantity: Quantity::Length,
        factor: 1e-3,
        words: &["mm", "millimetre", "millimetres", "millimeter", "millimeters"],
    },
    Unit {
        quantity: Quantity::Length,
        factor: 1e-6,
        words: &["um", "µm", "μm", "micron", "microns", "micrometre", "micrometres", "micrometer", "micrometers"],
    },
    Unit { quantity: Quantity::Length, factor: 0.0254, words: &["in", "inch", "inches"] },
    Unit { quantity: Quantity::Angle, factor: 1.0, words: &["rad", "radian", "radians"] },
    Unit { quantity: Quantity::Angle, factor: DEGREE, words: &["deg", "degs", "degree", "degrees", "°"] },
    Unit { quantity: Quantity::Pixels, factor: 1.0, words: &["px", "pixel", "pixels"] },
];
/// Words for units that are not supported.
const FOREIGN: [&str; 46] = [
    "ft",
    "foot",
    "feet",
    "yd",
    "yard",
    "yards",
    "mile",
    "miles",
    "mil",
    "mils",
    "thou",
    "km",
    "dm",
    "nm",
    "kilometre",
    "kilometres",
    "kilometer",
    "kilometers",
    "decimetre",
    "decimetres",
    "decimeter",
    "decimeters",
    "nanometre",
    "nanometres",
    "nanometer",
    "nanometers",
    "mrad",
    "urad",
    "mdeg",
    "millirad",
    "grad",
    "gon",
    "gons",
    "turns",
    "rev",
    "revs",
    "revolutions",
    "arcmin",
    "arcsec",
    "counts",
    "ticks",
    "pulses",
    "steps",
    "percent",
    "pct",
    "%",
];

/// A title without the unit at its end, and the word that says it: behind `_`, behind a space or in brackets. The word is
/// empty where there is none.
pub fn split(title: &str) -> (&str, &str) {
    let title = title.trim();
    let is_bracketed = title.ends_with([')', ']']);
    let opened = title.rfind(['(', '[']).filter(|_| is_bracketed);
    let (stem, word) = match (opened, title.rfind(['_', ' '])) {
        (Some(at), _) => (&title[..at], title[at + 1..title.len() - 1].trim()),
        (None, Some(at)) => (&title[..at], &title[at + 1..]),
        (None, None) => return (title, ""),
    };
    let stem = stem.trim_end_matches(['_', ' ']);
    let is_unit = opened.is_some() && !word.is_empty() || unit(word).is_some() || is_foreign(word);
    // A place may be called px, py and pz.
    let is_coordinate = word.eq_ignore_ascii_case("px") && opened.is_none() && {
        let last = last_word(stem).1;
        Component::called(last.trim_end_matches(|c: char| c.is_ascii_digit())).is_none()
    };
    if is_unit && !is_coordinate && !stem.is_empty() { (stem, word) } else { (title, "") }
}

fn unit(word: &str) -> Option<&'static Unit> {
    let word = word.to_lowercase();
    UNITS.iter().find(|unit| unit.words.contains(&word.as_str()))
}

fn is_foreign(word: &str) -> bool {
    FOREIGN.contains(&word.to_lowercase().as_str())
}

impl Quantity {
    /// The factor for the unit of this word; 1 for no word, `None` for a word that is no unit of this quantity.
    pub(super) fn factor(self, word: &str) -> Option<f64> {
        if word.is_empty() {
            return Some(1.0);
        }
        unit(word).filter(|unit| unit.quantity == self).map(|unit| unit.factor)
    }

    /// Whether a title ends with a unit of this quantity.
    pub fn is_in(self, title: &str) -> bool {
        self.factor(split(title).1).is_some()
    }

    /// The allowed endings of titles, in words.
    pub(super) fn ends(self) -> String {
        let units = UNITS.iter().filter(|unit| unit.quantity == self);
        let ends: Vec<String> = units.map(|unit| format!("_{}", unit.words[0])).collect();
        match (self, ends.is_empty()) {
            (_, true) => "write it without a unit".to_owned(),
            (Self::Length, _) => format!("write one of {}; without a unit it is metres", ends.join(", ")),
            (Self::Angle, _) => format!("write one of {}; without a unit it is radians", ends.join(", ")),
            _ => format!("write {} or nothing", ends.join(", ")),
        }
    }
}

/// The word at the end of names that means no unit: `plug_in` is no inch.
pub(super) const NAME: &str = "in";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        for component in Component::ALL {
            let units = UNITS.iter().filter(|unit| unit.quantity == component.quantity());
            let words = units.flat_map(|unit| unit.words.iter().map(|word| (*word, unit.factor))).chain([("", 1.0)]);
            for (unit, factor) in words {
                for before in ["", "hand", "cam_tag", "hand_2"] {
                    for number in ["", "1", "12"] {
                        let title = Title { before, component, number, unit };
                        let written = title.to_string();
                        assert_eq!(Title::parse(&written), Some(title), "{written}");
                        let upper = written.to_uppercase();
                        let read = Title::parse(&upper).expect("a title");
                        assert_eq!((read.component, read.number), (component, number), "{upper}");
                        assert!(read.is_of(before), "{upper}");
                        assert_eq!(component.quantity().factor(read.unit), Some(factor), "{upper}");
                    }
                }
            }
        }
    }

    #[test]
    fn units_stand_behind_a_gap_or_in_brackets() {
        for (title, stem, word) in [
            ("x_cm", "x", "cm"),
            ("x cm", "x", "cm"),
            ("hand_x (mm)", "hand_x", "mm"),
            ("X [in]", "X", "in"),
            ("x_(cubit)", "x", "cubit"),
            ("x_ft", "x", "ft"),
            ("x_tool", "x_tool", ""),
            ("hand_px", "hand_px", ""),
            ("u_px", "u", "px"),
            ("mm", "mm", ""),
            ("_mm", "_mm", ""),
            ("()", "()", ""),
        ] {
            assert_eq!(split(title), (stem, word), "{title}");
        }
        assert_eq!(
            Title::parse("Pose.Position.x").map(|title| (title.before, title.component)),
            Some(("Pose.Position", X))
        );
    }

    #[test]
    fn lists_are_understood_more_freely() {
        for (list, wanted) in [
            ("pos_x,pos_y,pos_z,rot_x,rot_y,rot_z", vec![X, Y, Z, Rx, Ry, Rz]),
            ("tx,ty,tz,orientation_w,orientation_x,orientation_y,orientation_z", vec![X, Y, Z, Qw, Qx, Qy, Qz]),
            ("x_tool,y_tool,z_tool,Roll_tool_deg,Pitch_tool_deg,Yaw_tool_deg", vec![X, Y, Z, Roll, Pitch, Yaw]),
            ("x_rot,y_rot,z_rot,x_pos,y_pos,z_pos", vec![Rx, Ry, Rz, X, Y, Z]),
            ("px,py,pz,q0,q1,q2,q3", vec![X, Y, Z, Qw, Qx, Qy, Qz]),
            ("x,y,z,w,i,j,k", vec![X, Y, Z, Qw, Qx, Qy, Qz]),
            ("x1,y1,z1,qw1,qx1,qy1,qz1", vec![X, Y, Z, Qw, Qx, Qy, Qz]),
        ] {
            let titles: Vec<String> = list.split(',').map(str::to_owned).collect();
            let all = last_words(&titles);
            let found: Vec<Option<Component>> = titles.iter().map(|title| listed(title, &all)).collect();
            assert_eq!(found, wanted.into_iter().map(Some).collect::<Vec<_>>(), "{list}");
        }
        let names: Vec<String> = "roller,a,q1,menu,i".split(',').map(str::to_owned).collect();
        assert!(names.iter().all(|title| listed(title, &last_words(&names)).is_none()));
    }
}
