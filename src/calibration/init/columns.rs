//! What the columns of a table are, by their titles.

/// Ends of titles that say a unit, longest first.
const UNITS: [&str; 5] = ["_deg", "_rad", "_mm", "_px", "_m"];
/// How a rotation is written behind a place, by its titles.
const ROTATIONS: [&[&str]; 4] =
    [&["rx", "ry", "rz"], &["roll", "pitch", "yaw"], &["qx", "qy", "qz", "qw"], &["phix", "phiy", "phiz"]];

/// What is measured beside the joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Targets whose places or poses are.
    pub sensors: Vec<Sensor>,
    /// The columns of place and socket.
    pub sockets: Option<(String, String)>,
    /// Columns that are nothing of this.
    pub others: Vec<String>,
}

/// One sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// The target's name.
    pub name: String,
    /// Its channel.
    pub channel: &'static str,
    /// The titles of its columns.
    pub columns: Vec<String>,
    /// The lines of its σ.
    pub sigmas: &'static str,
}

/// A title without the unit at its end.
fn stem(title: &str) -> &str {
    UNITS.iter().find_map(|unit| title.strip_suffix(unit)).unwrap_or(title)
}

/// Whether there is a column for a joint.
pub fn has_joint(titles: &[String], joint: &str) -> bool {
    titles.iter().any(|title| title == joint || stem(title) == joint)
}

/// What the columns that belong to no joint are.
pub fn measured(titles: &[String], joints: &[String]) -> Measured {
    let is_joint = |title: &&String| joints.iter().any(|joint| *title == joint || stem(title) == joint);
    let mut others: Vec<String> =
        titles.iter().filter(|title| !is_joint(title) && !title.is_empty()).cloned().collect();
    let mut measured = Measured::default();
    if let Some(socket) = others.iter().find(|title| title.as_str() == "socket").cloned() {
        let place = others.iter().find(|title| title.as_str() == "place").cloned();
        if let Some(place) = place {
            others.retain(|title| *title != place && *title != socket);
            measured.sockets = Some((place, socket));
        }
    }
    while let Some(sensor) = first_place(&others) {
        others.retain(|title| !sensor.columns.contains(title));
        measured.sensors.push(sensor);
    }
    measured.others = others;
    measured
}

/// The first columns that are called x, y and z alike, with those of a rotation that begin alike.
fn first_place(titles: &[String]) -> Option<Sensor> {
    let find = |wanted: &str| titles.iter().find(|title| stem(title) == wanted).cloned();
    titles.iter().find_map(|title| {
        let (before, after) = around_x(stem(title))?;
        let named = |letter: &str| find(&format!("{before}{letter}{after}"));
        let mut columns = vec![named("x")?, named("y")?, named("z")?];
        let rotation = ROTATIONS.iter().find_map(|ends| {
            ends.iter().map(|end| named(end).or_else(|| named(&end.to_uppercase()))).collect::<Option<Vec<_>>>()
        });
        let name = match (before.trim_end_matches('_'), after) {
            ("", "") => "marker".to_owned(),
            ("", after) => format!("marker{after}"),
            (before, after) => format!("{before}{after}"),
        };
        let (channel, sigmas) = match rotation {
            None => ("position", "sigma_m = 0.0005\n"),
            Some(rotation) => {
                columns.extend(rotation);
                ("pose", "sigma_m = 0.0005\nsigma_deg = 0.1\n")
            }
        };
        Some(Sensor { name, channel, columns, sigmas })
    })
}

/// What stands before and after the x of a coordinate: `x`, `x1`, `hand_x`.
fn around_x(stem: &str) -> Option<(&str, &str)> {
    if let Some(before) = stem.strip_suffix("_x") {
        return Some((&stem[..before.len() + 1], ""));
    }
    let after = stem.strip_prefix('x')?;
    after.chars().all(|c| c.is_ascii_digit()).then_some(("", after))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn titles(line: &str) -> Vec<String> {
        line.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn joints_targets_and_the_rest_are_told_apart() {
        let titles = titles("x1,y1,z1,x2_mm,y2_mm,z2_mm,hand_x,hand_y,hand_z,hand_rx,hand_ry,hand_rz,time,elbow_deg");
        let found = measured(&titles, &["elbow".to_owned()]);
        let told: Vec<_> = found.sensors.iter().map(|it| (it.name.as_str(), it.channel, it.columns.len())).collect();
        assert_eq!(told, [("marker1", "position", 3), ("marker2", "position", 3), ("hand", "pose", 6)]);
        assert_eq!((found.others, found.sockets), (vec!["time".to_owned()], None));
        assert!(has_joint(&titles, "elbow") && !has_joint(&titles, "elbo"));
    }

    #[test]
    fn sockets_take_two_columns() {
        let found = measured(&titles("place,socket,a"), &["a".to_owned()]);
        assert_eq!(found.sockets, Some(("place".to_owned(), "socket".to_owned())));
        assert!(found.sensors.is_empty() && found.others.is_empty());
        assert_eq!(measured(&titles("xylophone,y,z"), &[]).sensors, []);
    }
}
