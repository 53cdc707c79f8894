//! What the columns of a table are, by their titles.

use crate::kinematics::JointKind;

/// Ends of titles that say a unit, longest first.
const UNITS: [&str; 5] = ["_deg", "_rad", "_mm", "_px", "_m"];
/// How a rotation is written behind a place, by its titles.
const ROTATIONS: [&[&str]; 4] =
    [&["rx", "ry", "rz"], &["roll", "pitch", "yaw"], &["qx", "qy", "qz", "qw"], &["phix", "phiy", "phiz"]];

/// What is measured beside the joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Targets of which something is.
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
    /// The camera in whose picture it is, if it is in one.
    pub camera: Option<String>,
    /// The titles of its columns.
    pub columns: Vec<String>,
    /// The lines of its σ.
    pub sigmas: &'static str,
}

/// A title without the unit at its end.
fn stem(title: &str) -> &str {
    UNITS.iter().find_map(|unit| title.strip_suffix(unit)).unwrap_or(title)
}

/// The column of a joint: that with its name alone, or else with a unit of its kind behind it.
pub fn of_joint<'t>(titles: &'t [String], joint: &str, kind: JointKind) -> Option<&'t String> {
    let units = match kind {
        JointKind::Revolute => ["", "_deg", "_rad"],
        JointKind::Prismatic => ["", "_mm", "_m"],
    };
    units.iter().find_map(|unit| titles.iter().find(|title| title.strip_prefix(joint) == Some(unit)))
}

/// What the columns that belong to no joint are. `joints` are the titles of those that do.
pub fn measured(titles: &[String], joints: &[String]) -> Measured {
    let is_joint = |title: &&String| joints.contains(title);
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
    while let Some(sensor) = first_picture(&others).or_else(|| first_distance(&others)).or_else(|| first_place(&others))
    {
        others.retain(|title| !sensor.columns.contains(title));
        measured.sensors.push(sensor);
    }
    measured.others = others;
    measured
}

/// The first columns that are called u and v alike: a point in a picture. What stands before them is the camera and the target, as in
/// `cam_tag_u`; of points with numbers, as in `cam_tag_u1`, each is a target of its own.
fn first_picture(titles: &[String]) -> Option<Sensor> {
    let find = |wanted: &str| titles.iter().find(|title| stem(title) == wanted).cloned();
    titles.iter().find_map(|title| {
        let (before, number) = around('u', stem(title))?;
        let columns = vec![find(&format!("{before}u{number}"))?, find(&format!("{before}v{number}"))?];
        let (camera, target) = match before.trim_end_matches('_').rsplit_once('_') {
            Some((camera, target)) => (camera, target),
            None => ("camera", before.trim_end_matches('_')),
        };
        let target = if target.is_empty() { "marker" } else { target };
        Some(Sensor {
            name: format!("{target}{number}"),
            channel: "pixels",
            camera: Some(camera.to_owned()),
            columns,
            sigmas: "sigma_px = 0.5\n",
        })
    })
}

/// The first column that is called a distance.
fn first_distance(titles: &[String]) -> Option<Sensor> {
    titles.iter().find_map(|title| {
        let before = stem(title).strip_suffix("distance")?;
        let target = before.strip_suffix('_').or_else(|| before.is_empty().then_some("marker"))?;
        Some(Sensor {
            name: target.to_owned(),
            channel: "distance",
            camera: None,
            columns: vec![title.clone()],
            sigmas: "sigma_m = 0.0005\n",
        })
    })
}

/// The first columns that are called x, y and z alike, with those of a rotation that begin alike.
fn first_place(titles: &[String]) -> Option<Sensor> {
    let find = |wanted: &str| titles.iter().find(|title| stem(title) == wanted).cloned();
    titles.iter().find_map(|title| {
        let (before, after) = around('x', stem(title))?;
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
        Some(Sensor { name, channel, camera: None, columns, sigmas })
    })
}

/// What stands before and after the letter of a coordinate: `x`, `x1`, `hand_x`, `cam_tag_u2`.
fn around(letter: char, stem: &str) -> Option<(&str, &str)> {
    let bare = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let before = bare.strip_suffix(letter)?;
    (before.is_empty() || before.ends_with('_')).then_some((before, &stem[bare.len()..]))
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
        let elbow = of_joint(&titles, "elbow", JointKind::Revolute).expect("a column").clone();
        let found = measured(&titles, &[elbow]);
        let told: Vec<_> = found.sensors.iter().map(|it| (it.name.as_str(), it.channel, it.columns.len())).collect();
        assert_eq!(told, [("marker1", "position", 3), ("marker2", "position", 3), ("hand", "pose", 6)]);
        assert_eq!((found.others, found.sockets), (vec!["time".to_owned()], None));
        assert_eq!(of_joint(&titles, "elbo", JointKind::Revolute), None);
        assert_eq!(of_joint(&titles, "elbow", JointKind::Prismatic), None, "it does not slide by degrees");
    }

    #[test]
    fn a_title_that_is_a_joints_name_is_its_column() {
        let all = titles("y_mm,x,y,x_mm,z_mm,lift_mm");
        let joints = ["x", "y", "lift"].map(|joint| of_joint(&all, joint, JointKind::Prismatic).expect(joint).clone());
        assert_eq!(joints, ["x", "y", "lift_mm"]);
        assert_eq!(measured(&all, &joints).sensors[0].columns, ["x_mm", "y_mm", "z_mm"]);
    }

    #[test]
    fn pictures_and_distances_are_told_by_their_titles() {
        let found = measured(&titles("cam_tag_u1,cam_tag_v1,cam_tag_u2_px,cam_tag_v2_px,u,v,hand_distance_mm,q"), &[]);
        let told = |it: &Sensor| (it.name.clone(), it.channel, it.camera.clone().unwrap_or_default(), it.columns.len());
        let expected = [
            ("tag1", "pixels", "cam", 2),
            ("tag2", "pixels", "cam", 2),
            ("marker", "pixels", "camera", 2),
            ("hand", "distance", "", 1),
        ];
        let expected =
            expected.map(|(name, channel, camera, count)| (name.to_owned(), channel, camera.to_owned(), count));
        assert_eq!(found.sensors.iter().map(told).collect::<Vec<_>>(), expected);
        assert_eq!(found.others, ["q"]);
        assert_eq!(measured(&titles("menu,nonsense_distances,u3"), &[]).sensors, []);
    }

    #[test]
    fn sockets_take_two_columns() {
        let found = measured(&titles("place,socket,a"), &["a".to_owned()]);
        assert_eq!(found.sockets, Some(("place".to_owned(), "socket".to_owned())));
        assert!(found.sensors.is_empty() && found.others.is_empty());
        assert_eq!(measured(&titles("xylophone,y,z"), &[]).sensors, []);
    }
}
