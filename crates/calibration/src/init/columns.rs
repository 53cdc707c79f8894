//! Recognising the columns of a table by their titles.

use body_schema_engine::kinematics::JointKind;
use body_schema_table::{Component, Layout, Quantity, Rotation, Title, split};

/// The measurements beside the joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// The sensors.
    pub sensors: Vec<Sensor>,
    /// The columns of place and socket.
    pub sockets: Option<(String, String)>,
    /// The columns that belong to neither.
    pub others: Vec<String>,
}

/// One sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The target's name.
    pub name: String,
    /// The name without its number: what targets with numbers have in common, as the corners of a tag.
    pub group: String,
    /// The side of a square tag, metres, whose four corners are read.
    pub side_m: Option<f64>,
    /// Its channel.
    pub channel: &'static str,
    /// The camera of its picture, if it is a picture.
    pub camera: Option<String>,
    /// The titles of its columns.
    pub columns: Vec<String>,
    /// The lines of its σ, as TOML.
    pub sigmas: &'static str,
}

impl Sensor {
    /// The layout of its readings in a table.
    pub fn layout(&self) -> Layout {
        match self.channel {
            "pose" => Layout::Pose,
            "pixels" => Layout::Pixels(self.columns.len() / 2),
            "distance" => Layout::Distance,
            _ => Layout::Position,
        }
    }
}

/// The first title with this component that otherwise reads like `of`.
fn find(titles: &[String], of: &Title<'_>, component: Component) -> Option<String> {
    let is_it = |it: &Title<'_>| it.component == component && it.is_of(of.before) && it.number == of.number;
    titles.iter().find(|title| Title::parse(title).is_some_and(|it| is_it(&it))).cloned()
}

/// The column of a joint: the one with its name alone, otherwise one with a unit of its kind behind the name.
pub fn of_joint<'t>(titles: &'t [String], joint: &str, kind: JointKind) -> Option<&'t String> {
    let quantity = Quantity::of(kind);
    let exact = titles.iter().find(|title| *title == joint);
    exact.or_else(|| titles.iter().find(|title| split(title).0 == joint && quantity.is_in(title)))
}

/// Recognises the columns that belong to no joint. `joints` are the titles of those that do; `known` has names of cameras and targets, which
/// tell the one from the other in a title.
pub fn measured(titles: &[String], joints: &[String], known: &[&str]) -> Measured {
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
    while let Some(sensor) =
        first_picture(&others, known).or_else(|| first_distance(&others)).or_else(|| first_place(&others))
    {
        others.retain(|title| !sensor.columns.contains(title));
        measured.sensors.push(sensor);
    }
    measured.others = others;
    measured
}

impl Measured {
    /// The groups of four points in a picture, numbered from 1 to 4, or from 0 to 3: what the corners of a tag would be. Each with its camera.
    pub fn fours(&self) -> Vec<(String, String)> {
        let mut fours: Vec<(String, String)> = Vec::new();
        for sensor in &self.sensors {
            let Some(camera) = &sensor.camera else { continue };
            let four = (sensor.group.clone(), camera.clone());
            if !fours.contains(&four) && self.corners(&four).is_some() {
                fours.push(four);
            }
        }
        fours
    }

    /// The places among the sensors of the four points of a group, in order.
    fn corners(&self, (group, camera): &(String, String)) -> Option<[usize; 4]> {
        let is_of = |sensor: &Sensor| {
            sensor.group == *group && sensor.camera.as_ref() == Some(camera) && sensor.columns.len() == 2
        };
        let place = |number: usize| {
            let name = format!("{group}{number}");
            self.sensors.iter().position(|sensor| is_of(sensor) && sensor.name == name)
        };
        let all = self.sensors.iter().filter(|sensor| is_of(sensor)).count();
        let numbered = |first: usize| {
            let places: Option<Vec<usize>> = (first..first + 4).map(place).collect();
            <[usize; 4]>::try_from(places?).ok()
        };
        numbered(1).or_else(|| numbered(0)).filter(|_| all == 4)
    }

    /// Makes one target of each [four](Self::fours): a square tag of a side, metres.
    pub fn join(&mut self, side_m: f64) {
        for four in self.fours() {
            let Some(places) = self.corners(&four) else { continue };
            let columns = places.iter().flat_map(|place| self.sensors[*place].columns.clone()).collect();
            let first = self.sensors[places[0]].clone();
            let tag = Sensor { name: four.0, side_m: Some(side_m), columns, ..first };
            self.sensors[places[0]] = tag;
            let mut others = places[1..].to_vec();
            others.sort_unstable();
            others.iter().rev().for_each(|place| drop(self.sensors.remove(*place)));
        }
    }
}

/// The first columns u and v with the same prefix: a point in a picture. The prefix is the camera and the target, as in `cam_tag_u`;
/// where several parts of it could be these, those that are known, or else the last part is the target. Points with numbers, as in `cam_tag_u1`,
/// are targets of their own.
fn first_picture(titles: &[String], known: &[&str]) -> Option<Sensor> {
    titles.iter().find_map(|title| {
        let it = Title::parse(title).filter(|it| it.component == Component::U)?;
        let columns = vec![title.clone(), find(titles, &it, Component::V)?];
        let is_known = |name: &str| usize::from(known.contains(&name));
        let parts = it.before.rmatch_indices('_').map(|(at, _)| (&it.before[..at], &it.before[at + 1..]));
        // Of equally good ones the first, at the last underscore.
        let best = parts.rev().max_by_key(|(camera, target)| is_known(camera) + is_known(target));
        let (camera, target) = best.unwrap_or(("camera", it.before));
        let target = if target.is_empty() { "marker" } else { target };
        Some(Sensor {
            name: format!("{target}{}", it.number),
            group: target.to_owned(),
            side_m: None,
            channel: "pixels",
            camera: Some(camera.to_owned()),
            columns,
            sigmas: "sigma_px = 0.5\n",
        })
    })
}

/// The first column of a distance.
fn first_distance(titles: &[String]) -> Option<Sensor> {
    titles.iter().find_map(|title| {
        let it = Title::parse(title).filter(|it| it.component == Component::Distance && it.number.is_empty())?;
        let name = if it.before.is_empty() { "marker" } else { it.before };
        Some(Sensor {
            name: name.to_owned(),
            group: name.to_owned(),
            side_m: None,
            channel: "distance",
            camera: None,
            columns: vec![title.clone()],
            sigmas: "sigma_m = 0.0005\n",
        })
    })
}

/// The first columns x, y and z with the same prefix, with those of a rotation that share it.
fn first_place(titles: &[String]) -> Option<Sensor> {
    titles.iter().find_map(|title| {
        let it = Title::parse(title).filter(|it| it.component == Component::X)?;
        let named = |components: &[Component]| -> Option<Vec<String>> {
            components.iter().map(|component| find(titles, &it, *component)).collect()
        };
        let mut columns = named(&Component::PLACE)?;
        let rotation = Rotation::ALL.iter().find_map(|rotation| named(rotation.components()));
        let group = if it.before.is_empty() { "marker" } else { it.before };
        let (channel, sigmas) = match rotation {
            None => ("position", "sigma_m = 0.0005\n"),
            Some(rotation) => {
                columns.extend(rotation);
                ("pose", "sigma_m = 0.0005\nsigma_deg = 0.1\n")
            }
        };
        let (name, group) = (format!("{group}{}", it.number), group.to_owned());
        Some(Sensor { name, group, side_m: None, channel, camera: None, columns, sigmas })
    })
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
        let found = measured(&titles, &[elbow], &[]);
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
        assert_eq!(measured(&all, &joints, &[]).sensors[0].columns, ["x_mm", "y_mm", "z_mm"]);
    }

    #[test]
    fn pictures_and_distances_are_told_by_their_titles() {
        let found =
            measured(&titles("cam_tag_u1,cam_tag_v1,cam_tag_u2_px,cam_tag_v2_px,u,v,hand_distance_mm,q"), &[], &[]);
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
        assert_eq!(measured(&titles("menu,nonsense_distances,u3"), &[], &[]).sensors, []);
    }

    #[test]
    fn a_known_name_tells_the_camera_from_the_target() {
        let all = titles("head_eye_left_tag_u,head_eye_left_tag_v");
        let parts = |known: &[&str]| {
            let sensor = measured(&all, &[], known).sensors.remove(0);
            (sensor.camera.unwrap_or_default(), sensor.name)
        };
        let owned = |camera: &str, target: &str| (camera.to_owned(), target.to_owned());
        assert_eq!(parts(&[]), owned("head_eye_left", "tag"));
        assert_eq!(parts(&["head_eye"]), owned("head_eye", "left_tag"));
        assert_eq!(parts(&["left_tag", "head"]), owned("head_eye", "left_tag"), "the later of two that are as good");
        assert_eq!(parts(&["left_tag", "head_eye", "tag"]), owned("head_eye", "left_tag"));
    }

    #[test]
    fn corners_become_a_tag_where_its_side_is_said() {
        let titles = titles(
            "cam_tag_u2,cam_tag_v2,cam_tag_u1,cam_tag_v1,cam_tag_u3,cam_tag_v3,cam_tag_u4,cam_tag_v4,cam_dot_u1,cam_dot_v1,x,y,z",
        );
        let mut found = measured(&titles, &[], &[]);
        assert_eq!(found.fours(), [("tag".to_owned(), "cam".to_owned())]);
        found.join(0.04);
        let names: Vec<_> =
            found.sensors.iter().map(|sensor| (sensor.name.as_str(), sensor.columns.len(), sensor.side_m)).collect();
        assert_eq!(names, [("tag", 8, Some(0.04)), ("dot1", 2, None), ("marker", 3, None)]);
        assert_eq!(found.sensors[0].columns[..4], ["cam_tag_u1", "cam_tag_v1", "cam_tag_u2", "cam_tag_v2"]);
        assert_eq!(found.fours(), []);
    }

    #[test]
    fn sockets_take_two_columns() {
        let found = measured(&titles("place,socket,a"), &["a".to_owned()], &[]);
        assert_eq!(found.sockets, Some(("place".to_owned(), "socket".to_owned())));
        assert!(found.sensors.is_empty() && found.others.is_empty());
        assert_eq!(measured(&titles("xylophone,y,z"), &[], &[]).sensors, []);
    }
}
