//! The palette of recordings, figures and page: colours by learner, and a map for values.

/// The learners that scenarios have in common, in the order of their slots.
const KNOWN: [&str; 7] = ["active", "random", "global", "gradient", "human", "unscented", "nominal"];

/// The colour of the truth: grey.
pub const TRUTH_COLOR: [u8; 3] = [0x80, 0x80, 0x80];

/// The colours by slot: those of the known learners, then those that all others share. After Okabe and Ito, for the
/// colour-blind, darkened or lightened until each has a contrast of 3:1 both on the light and on the dark ground.
const LEARNERS: [[u8; 3]; 12] = [
    [0x00, 0x72, 0xB2], // blue
    [0xD5, 0x5E, 0x00], // vermillion
    [0x00, 0x94, 0x6B], // bluish green
    [0xB5, 0x58, 0x8F], // reddish purple
    [0xA8, 0x79, 0x00], // ochre
    [0x7B, 0x68, 0xC8], // violet
    [0x8C, 0x6D, 0x46], // brown
    [0x2A, 0x8A, 0x94], // teal
    [0xC2, 0x45, 0x5E], // crimson
    [0x6B, 0x8A, 0x1E], // olive
    [0x5A, 0x7F, 0xC0], // steel blue
    [0xB0, 0x70, 0x3C], // copper
];

/// Stops of the viridis colour map, evenly spaced, dark to bright.
const VIRIDIS: [[u8; 3]; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3E, 0x49, 0x89],
    [0x31, 0x68, 0x8E],
    [0x26, 0x82, 0x8E],
    [0x1F, 0x9E, 0x89],
    [0x35, 0xB7, 0x79],
    [0x6E, 0xCE, 0x58],
    [0xB5, 0xDE, 0x2B],
    [0xFD, 0xE7, 0x25],
];

/// The slot of every learner of a comparison, which decides its colour, line and marker.
///
/// The slot depends on the name, not on the place in the list: a learner looks the same in every comparison. An unknown
/// name takes a slot by its hash, or the next free one. Slots are shared only among more than twelve learners.
pub fn learner_slots<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<usize> {
    let names: Vec<&str> = names.into_iter().collect();
    let known = |name: &str| KNOWN.iter().position(|known| *known == name);
    let mut taken: Vec<usize> = names.iter().filter_map(|name| known(name)).collect();
    let mut of_another = |name: &str| {
        let others = LEARNERS.len() - KNOWN.len();
        let first = hash(name) as usize % others;
        // All that are free, the others' before those of known learners that are not here.
        let in_turn = (0..others).map(|place| KNOWN.len() + (first + place) % others).chain(0..KNOWN.len());
        let slot = in_turn.clone().find(|slot| !taken.contains(slot)).unwrap_or(KNOWN.len() + first);
        taken.push(slot);
        slot
    };
    names.iter().map(|name| known(name).unwrap_or_else(|| of_another(name))).collect()
}

/// The hash FNV-1a: the same on every machine and in every version.
fn hash(name: &str) -> u32 {
    name.bytes().fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// The colour (sRGB) of a [slot](learner_slots); it repeats after twelve.
pub fn learner_color(slot: usize) -> [u8; 3] {
    LEARNERS[slot % LEARNERS.len()]
}

/// The viridis colour of `value` in 0..=1.
pub fn viridis(value: f64) -> [u8; 3] {
    let last = VIRIDIS.len() - 1;
    let place = value.clamp(0.0, 1.0) * last as f64;
    let lower = (place as usize).min(last - 1);
    mix(VIRIDIS[lower], VIRIDIS[lower + 1], place - lower as f64)
}

/// The colour between two, `amount` in 0..=1 of the way.
pub fn mix(from: [u8; 3], to: [u8; 3], amount: f64) -> [u8; 3] {
    std::array::from_fn(|i| (f64::from(from[i]) + amount * (f64::from(to[i]) - f64::from(from[i]))).round() as u8)
}

/// A colour as `#rrggbb`.
pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// The contrast of two colours by WCAG 2.1, from 1 to 21.
pub fn contrast(one: [u8; 3], other: [u8; 3]) -> f64 {
    let luminance = |colour: [u8; 3]| {
        let linear = colour.map(|channel| {
            let value = f64::from(channel) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    };
    let (a, b) = (luminance(one), luminance(other));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_runs_from_end_to_end() {
        assert_eq!(viridis(0.0), VIRIDIS[0]);
        assert_eq!(viridis(1.0), VIRIDIS[9]);
        assert_eq!(viridis(2.0), VIRIDIS[9]);
        assert_eq!(viridis(1.0 / 9.0), VIRIDIS[1]);
    }

    #[test]
    fn a_learner_has_one_colour_wherever_it_stands() {
        assert_eq!(learner_slots(["active", "random", "gradient"]), [0, 1, 3]);
        assert_eq!(learner_slots(["global", "random"]), [2, 1]);
        let alone = learner_slots(["active-direct"]);
        assert!(alone[0] >= KNOWN.len());
        assert_eq!(learner_slots(["random", "active-direct", "active"]), [1, alone[0], 0]);
    }

    #[test]
    fn no_two_of_a_comparison_share_a_colour() {
        let names = ["a", "b", "c", "d", "e", "f", "random"];
        let mut slots = learner_slots(names);
        assert_eq!(slots[6], 1);
        slots.sort_unstable();
        slots.dedup();
        assert_eq!(slots.len(), names.len());
        let many: Vec<String> = (0..20).map(|i| i.to_string()).collect();
        assert!(learner_slots(many.iter().map(String::as_str)).into_iter().all(|slot| slot < LEARNERS.len()));
    }

    #[test]
    fn every_colour_stands_out_from_light_and_dark_ground() {
        // Of graphical objects, at least 3:1.
        for ground in [[0xF8; 3], [0x1B; 3]] {
            for colour in LEARNERS {
                let contrast = contrast(ground, colour);
                assert!(contrast >= 3.0, "{colour:02X?} on {ground:02X?}: {contrast:.2}");
            }
        }
    }
}
