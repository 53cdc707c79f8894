//! The columns that make up a reading.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{
    Column, Component, Quantity, TableError, Title, Titles,
    names::{last_words, listed},
};

/// The layout of a sensor's reading in a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// x, y, z.
    Position,
    /// x, y, z and a rotation: a rotation vector, roll, pitch and yaw, or a quaternion.
    Pose,
    /// u, v of this many points.
    Pixels(usize),
    /// A length.
    Distance,
    /// A coordinate along one direction.
    Depth,
}

impl Layout {
    /// The titles under which a reading called `before` is written, in metres, radians and pixels, a rotation as its vector.
    pub fn titles(self, before: &str) -> Vec<String> {
        self.titles_with(before, Rotation::Vector)
    }

    /// The titles under which a reading called `before` is written, in metres, radians and pixels, with rotations in
    /// the given form.
    pub fn titles_with(self, before: &str, rotation: Rotation) -> Vec<String> {
        let title = |component: Component, number: &str| Title { before, component, number, unit: "" }.to_string();
        let place = Component::PLACE.map(|component| title(component, ""));
        match self {
            Self::Position => place.to_vec(),
            Self::Pose => {
                let turned = rotation.components().iter().map(|component| title(*component, ""));
                place.into_iter().chain(turned).collect()
            }
            Self::Pixels(1) => PICTURE.map(|component| title(component, "")).to_vec(),
            Self::Pixels(points) => {
                (1..=points).flat_map(|point| PICTURE.map(|component| title(component, &point.to_string()))).collect()
            }
            Self::Distance => vec![title(Component::Distance, "")],
            Self::Depth => vec![title(Component::Depth, "")],
        }
    }
}

/// The coordinates of a point in a picture.
const PICTURE: [Component; 2] = [Component::U, Component::V];

/// The form in which a rotation is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotation {
    /// As its vector: axis times angle.
    Vector,
    /// By angles about the fixed axes x, y and z, one after the other.
    RollPitchYaw,
    /// As a quaternion.
    Quaternion,
}

/// The most by which the length of a quaternion may differ from 1.
const UNIT_TOLERANCE: f64 = 0.01;
/// The most of an angle of a rotation, radians: two turns, for angles that are counted on. Degrees that are read as radians are more.
const MOST_TURNED: f64 = 4.0 * std::f64::consts::PI;

impl Rotation {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Vector, Self::RollPitchYaw, Self::Quaternion];

    /// The components of this form, in order.
    pub fn components(self) -> &'static [Component] {
        use Component::*;
        match self {
            Self::Vector => &[Rx, Ry, Rz],
            Self::RollPitchYaw => &[Roll, Pitch, Yaw],
            Self::Quaternion => &[Qx, Qy, Qz, Qw],
        }
    }

    /// The rotation vector from numbers in the order of [`components`](Self::components); `None` if their count is wrong or
    /// the quaternion is not of unit length.
    pub fn read(self, numbers: &[f64]) -> Option<Vector3<f64>> {
        match (self, numbers) {
            (Self::Vector, &[x, y, z]) => Some(Vector3::new(x, y, z)),
            (Self::RollPitchYaw, &[roll, pitch, yaw]) => {
                Some(UnitQuaternion::from_euler_angles(roll, pitch, yaw).scaled_axis())
            }
            (Self::Quaternion, &[x, y, z, w]) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let is_unit = (quaternion.norm() - 1.0).abs() <= UNIT_TOLERANCE;
                is_unit.then(|| UnitQuaternion::new_normalize(quaternion).scaled_axis())
            }
            _ => None,
        }
    }

    /// The numbers of this form for a rotation vector, in the order of [`components`](Self::components).
    pub fn write(self, vector: Vector3<f64>) -> Vec<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(vector);
        match self {
            Self::Vector => vector.as_slice().to_vec(),
            Self::RollPitchYaw => <[f64; 3]>::from(rotation.euler_angles()).to_vec(),
            Self::Quaternion => rotation.coords.as_slice().to_vec(),
        }
    }
}

/// The columns of one sensor's readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The columns in the order of the layout: x, y, z, and for a quaternion x, y, z, w.
    pub columns: Vec<Column>,
    rotation: Option<Rotation>,
    /// The least number of points of a reading, where some may be absent.
    least_points: Option<usize>,
}

impl Titles {
    /// The columns of a reading whose titles begin with `prefix` and `_`; with an empty prefix they begin with the
    /// component.
    ///
    /// # Errors
    ///
    /// [`TableError`] if a column is missing, is there twice, or has an unknown unit.
    pub fn reading(&self, layout: Layout, prefix: &str) -> Result<Reading, TableError> {
        let all = |components: &[Component], number: &str| -> Result<Vec<Column>, TableError> {
            components.iter().map(|component| self.component(prefix, *component, number)).collect()
        };
        let is_there = |component: Component, number: &str| self.has(prefix, component, number);
        let mut rotation = None;
        let columns = match layout {
            Layout::Position => all(&Component::PLACE, "")?,
            Layout::Distance => all(&[Component::Distance], "")?,
            Layout::Depth => all(&[Component::Depth], "")?,
            Layout::Pixels(1) if is_there(Component::U, "") => all(&PICTURE, "")?,
            Layout::Pixels(points) => {
                let of_points = (1..=points).map(|point| all(&PICTURE, &point.to_string()));
                of_points.collect::<Result<Vec<_>, _>>()?.concat()
            }
            Layout::Pose => {
                let begun = |kind: &Rotation| is_there(kind.components()[0], "");
                let kind = Rotation::ALL.into_iter().find(begun).unwrap_or(Rotation::Vector);
                rotation = Some(kind);
                [all(&Component::PLACE, "")?, all(kind.components(), "")?].concat()
            }
        };
        Ok(Reading { columns, rotation, least_points: None })
    }

    /// The columns of a reading whose titles begin with `prefix`; if none do, those whose titles begin with the
    /// component.
    ///
    /// # Errors
    ///
    /// [`TableError`] if a column is missing, is there twice, or has an unknown unit.
    pub fn reading_of(&self, layout: Layout, prefix: &str) -> Result<Reading, TableError> {
        let named = self.reading(layout, prefix);
        let Err(error) = named else { return named };
        let first = match layout {
            Layout::Position | Layout::Pose => Component::X,
            Layout::Pixels(_) => Component::U,
            Layout::Distance => Component::Distance,
            Layout::Depth => Component::Depth,
        };
        let begins = |prefix: &str| {
            let is_it = |it: Title<'_>| it.component == first && it.is_of(prefix);
            self.all().iter().any(|title| Title::parse(title).is_some_and(is_it))
        };
        let is_bare = begins("") && !begins(prefix);
        self.reading(layout, "").map_err(|bare| if is_bare { bare } else { error })
    }

    /// Whether there is a position under titles that begin with `prefix`, in any unit.
    pub fn has_position(&self, prefix: &str) -> bool {
        Component::PLACE.iter().all(|component| self.has(prefix, *component, ""))
    }

    /// Whether there is a rotation too under titles that begin with `prefix`.
    pub fn has_pose(&self, prefix: &str) -> bool {
        let has = |kind: &Rotation| kind.components().iter().all(|component| self.has(prefix, *component, ""));
        self.has_position(prefix) && Rotation::ALL.iter().any(has)
    }

    fn has(&self, prefix: &str, component: Component, number: &str) -> bool {
        let is_it = |it: Title<'_>| it.component == component && it.number == number && it.is_of(prefix);
        self.all().iter().any(|title| Title::parse(title).is_some_and(is_it))
    }

    /// The columns of a reading by their titles. Names of components among them say which number is which, in any order: `qw`
    /// is the scalar of a quaternion wherever it stands, and of points in pictures each has its u and its v. Other names keep
    /// their position in the list, which is that of the layout: of a pose six end with a rotation vector, unless they are
    /// titled as roll, pitch and yaw, and seven with a quaternion x, y, z, w.
    ///
    /// # Errors
    ///
    /// [`TableError`] if a title is missing, their number does not fit the layout, they contradict each other, or one has an
    /// unknown unit.
    pub fn reading_titled(&self, layout: Layout, titles: &[String]) -> Result<Reading, TableError> {
        let (counts, said) = match layout {
            Layout::Position => (3..=3, "3".to_owned()),
            Layout::Distance | Layout::Depth => (1..=1, "1".to_owned()),
            Layout::Pixels(points) => (2 * points..=2 * points, (2 * points).to_string()),
            Layout::Pose => (6..=7, "6 or 7".to_owned()),
        };
        if !counts.contains(&titles.len()) {
            let what = format!("{} columns are named for a reading: {}", titles.len(), titles.join(", "));
            return Err(TableError::new(what, format!("name {said}")));
        }
        let (slots, rotation) = match layout {
            Layout::Distance | Layout::Depth => (vec![0], None),
            Layout::Pixels(_) => (in_pictures(titles)?, None),
            Layout::Position => (in_space(titles)?.0, None),
            Layout::Pose => {
                let (slots, rotation) = in_space(titles)?;
                (slots, Some(rotation))
            }
        };
        let quantity = |slot: usize| match (layout, rotation) {
            (Layout::Pixels(_), _) => Quantity::Pixels,
            (_, Some(rotation)) if slot >= 3 => rotation.components()[slot - 3].quantity(),
            _ => Quantity::Length,
        };
        let column = |slot: usize| {
            let at = slots.iter().position(|of| *of == slot).unwrap_or(slot);
            self.titled_in_any_case(&titles[at], quantity(slot))
        };
        let columns = (0..titles.len()).map(column).collect::<Result<_, _>>()?;
        Ok(Reading { columns, rotation, least_points: None })
    }
}

/// The error for a list of titles whose names contradict each other.
fn contradiction(titles: &[String], what: impl std::fmt::Display, hint: &str) -> TableError {
    let what = format!("the columns {} contradict each other: {what}", titles.join(", "));
    TableError::new(what, hint)
}

/// A sentence on what a list must name.
fn expected(titles: &[String]) -> String {
    let place = "x, y and z";
    let turned = match titles.len() {
        3 => return format!("name {place}, each once"),
        7 => "qx, qy, qz and qw",
        _ => "either rx, ry and rz or roll, pitch and yaw",
    };
    format!("name {place}, and {turned}, each once; a quaternion takes seven columns, other rotations six")
}

/// The place of each title in the layout of a position or a pose, and the form of the rotation, if there is one.
fn in_space(titles: &[String]) -> Result<(Vec<usize>, Rotation), TableError> {
    // What is complete as it stands needs no guess: a target may be called `q` or `rot`.
    let plain: Vec<Option<Component>> = titles.iter().map(|title| Some(Title::parse(title)?.component)).collect();
    let is_complete = |kind: &Rotation| {
        let mut wanted = Component::PLACE.iter().chain(kind.components()).take(titles.len());
        let count = if titles.len() == 3 { 3 } else { 3 + kind.components().len() };
        count == titles.len() && wanted.all(|component| plain.contains(&Some(*component)))
    };
    let words = last_words(titles);
    let mut found = match Rotation::ALL.iter().any(is_complete) {
        true => plain,
        false => titles.iter().map(|title| listed(title, &words)).collect(),
    };
    let is_in_picture = |of: &Component| PICTURE.contains(of) || matches!(of, Component::Distance | Component::Depth);
    found.iter_mut().for_each(|of| *of = of.filter(|of| !is_in_picture(of)));
    // x1, x2 and x3 are coordinates by number.
    for group in [0..3, 3..titles.len()].into_iter().filter(|group| group.len() > 1) {
        if found[group.start].is_some() && is_numbered(&titles[group.clone()], &found[group.clone()]) {
            found[group].fill(None);
        }
    }
    let is_of = |kind: &&Rotation| found.iter().flatten().any(|of| kind.components().contains(of));
    let kinds: Vec<Rotation> = Rotation::ALL.iter().filter(is_of).copied().collect();
    let usual = if titles.len() == 7 { Rotation::Quaternion } else { Rotation::Vector };
    let rotation = kinds.first().copied().unwrap_or(usual);
    let refuse = |what: String| Err(contradiction(titles, what, &expected(titles)));
    if kinds.len() > 1 {
        return refuse("they write a rotation in more than one way".to_owned());
    }
    let wanted = [&Component::PLACE, rotation.components()].concat();
    let is_position = titles.len() == 3;
    if is_position && !kinds.is_empty() {
        return refuse("a position has no rotation".to_owned());
    }
    if !is_position && wanted.len() != titles.len() {
        let count = titles.len() - 3;
        return refuse(format!("{count} columns are no rotation of {}", rotation.components().len()));
    }
    let mut slots: Vec<usize> = Vec::new();
    for (index, of) in found.iter().enumerate() {
        let slot = of.and_then(|of| wanted.iter().position(|component| *component == of)).unwrap_or(index);
        if let Some(other) = slots.iter().position(|taken| *taken == slot) {
            let missing: Vec<&str> = wanted[..titles.len()]
                .iter()
                .filter(|component| !found.contains(&Some(**component)))
                .map(|component| component.name())
                .collect();
            return refuse(format!(
                "`{}` and `{}` are both taken for {}, and none is {}",
                titles[other],
                titles[index],
                wanted[slot].name(),
                missing.join(", ")
            ));
        }
        slots.push(slot);
    }
    Ok((slots, rotation))
}

/// The place of each title among the points in a picture: points in the order in which they are first named, u before
/// v.
fn in_pictures(titles: &[String]) -> Result<Vec<usize>, TableError> {
    let coordinate = |title: &String| {
        Title::parse(title).and_then(|it| match it.component {
            Component::U | Component::X => Some(Component::U),
            Component::V | Component::Y => Some(Component::V),
            _ => None,
        })
    };
    let mut found: Vec<Option<Component>> = titles.iter().map(coordinate).collect();
    if is_numbered(titles, &found) && titles.len() == 2 {
        found.fill(None);
    }
    let in_order = || (0..titles.len()).collect();
    let refuse = |what: String| {
        let hint = "name u and v of every point, as in u1, v1, u2, v2";
        Err(contradiction(titles, what, hint))
    };
    if found.iter().any(Option::is_none) {
        for (index, title) in titles.iter().enumerate() {
            let here = PICTURE[index % 2];
            if found[index].is_some_and(|of| of != here) {
                return refuse(format!("`{title}` stands where {} of a point should", here.name()));
            }
        }
        return Ok(in_order());
    }
    let mut points: Vec<(String, &str)> = Vec::new();
    let mut slots = Vec::new();
    for (title, of) in titles.iter().zip(&found) {
        let Some(parsed) = Title::parse(title) else { continue };
        let key = (parsed.before.to_ascii_lowercase(), parsed.number);
        let point = points.iter().position(|known| *known == key).unwrap_or_else(|| {
            points.push(key);
            points.len() - 1
        });
        let slot = 2 * point + usize::from(*of == Some(Component::V));
        if slot >= titles.len() || slots.contains(&slot) {
            return refuse(format!("`{title}` has no partner, or is there twice"));
        }
        slots.push(slot);
    }
    Ok(slots)
}

/// Whether titles are one letter with different numbers.
fn is_numbered(titles: &[String], found: &[Option<Component>]) -> bool {
    let mut numbers: Vec<&str> = titles.iter().filter_map(|title| Some(Title::parse(title)?.number)).collect();
    numbers.retain(|number| !number.is_empty());
    numbers.sort_unstable();
    numbers.dedup();
    titles.len() > 1 && numbers.len() == titles.len() && found.iter().all(|of| *of == found[0])
}

impl Reading {
    /// These columns of a target's points in a picture, of which some may be absent: both cells of a point are then empty. With
    /// fewer than `least_points`, at least 1, there is no reading.
    #[must_use]
    pub fn partly_seen(self, least_points: usize) -> Self {
        Self { least_points: Some(least_points.max(1)), ..self }
    }

    /// The least number of points of a reading, where some may be absent.
    pub(super) fn least_points(&self) -> Option<usize> {
        self.least_points
    }

    /// The first column, and its number, whose number is no angle of a rotation.
    pub(super) fn beyond_turns(&self, numbers: &[f64]) -> Option<(&Column, f64)> {
        let angles =
            self.rotation.filter(|rotation| *rotation != Rotation::Quaternion).map(|_| 3..self.columns.len())?;
        let mut angles = self.columns[angles.clone()].iter().zip(numbers.get(angles)?.iter().copied());
        angles.find(|(_, angle)| angle.abs() > MOST_TURNED)
    }

    /// A sensor's own numbers (see [`Observation`](body_schema_engine::sensing::Observation)) from those of its columns; `None` for a
    /// quaternion that is not of unit length.
    pub(super) fn of(&self, mut numbers: Vec<f64>) -> Option<Vec<f64>> {
        if let (Some(rotation), Some(turned)) = (self.rotation, numbers.get(3..)) {
            let vector = rotation.read(turned)?;
            numbers.truncate(3);
            numbers.extend_from_slice(vector.as_slice());
        }
        Some(numbers)
    }

    /// The cells in which a sensor's own numbers are written: the index of each column, and its number; none for absent points.
    pub fn cells(&self, reading: &[f64]) -> Vec<(usize, f64)> {
        let mut numbers = reading.to_vec();
        if let (Some(rotation), Some(&[x, y, z])) = (self.rotation, reading.get(3..)) {
            numbers.truncate(3);
            numbers.extend(rotation.write(Vector3::new(x, y, z)));
        }
        let present = self.columns.iter().zip(numbers).filter(|(_, number)| !number.is_nan());
        present.map(|(column, number)| (column.index, number / column.factor)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{super::split, *};

    /// Of a target that is partly seen both cells of a point may be empty; half a point is refused, and too few points are none.
    #[test]
    fn points_that_are_not_seen_are_empty() {
        use crate::{Columns, Table};
        let read = |least: Option<usize>, cells: &str| {
            let text = format!("cam_tag_u1,cam_tag_v1,cam_tag_u2,cam_tag_v2,cam_tag_u3,cam_tag_v3\n{cells}\n");
            let table = Table::open(text.as_bytes()).expect("a table");
            let reading = table.titles().reading(Layout::Pixels(3), "cam_tag").expect("columns");
            let readings = vec![least.into_iter().fold(reading, Reading::partly_seen)];
            let mut rows = table.rows(Columns { readings, ..Columns::default() });
            let row = rows.next().expect("a row");
            row.map(|row| row.observation.readings[0].clone()).map_err(|error| error.to_string())
        };
        let found = read(Some(1), "1,2,,,nan,NA").expect("a point").expect("a reading");
        assert!(found[..2] == [1.0, 2.0] && found.len() == 6 && found[2..].iter().all(|x| x.is_nan()));
        assert_eq!(read(Some(2), "1,2,,,,"), Ok(None));
        assert_eq!(read(Some(1), ",,,,,"), Ok(None));
        assert_eq!(read(Some(3), "1,2,3,4,5,6"), Ok(Some(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])));
        let half = read(Some(1), "1,2,3,,5,6").expect_err("half a point");
        assert!(half.contains("cam_tag_v2") && half.contains("leave both cells of this point empty"), "{half}");
        assert!(read(None, "1,2,,,5,6").expect_err("seen whole").contains("leave all cells of this reading empty"));
        let columns = Titles::listed(["u1", "v1", "u2", "v2"].map(str::to_owned).to_vec()).expect("titles");
        let columns = columns.reading(Layout::Pixels(2), "").expect("columns").partly_seen(1);
        assert_eq!(columns.cells(&[f64::NAN, f64::NAN, 3.0, 4.0]), [(2, 3.0), (3, 4.0)]);
    }

    /// A list of titles, and where a reading goes and comes from.
    #[track_caller]
    fn comes_back(layout: Layout, titles: &[String], reading: &[f64]) -> Vec<f64> {
        let all = Titles::listed(titles.to_vec()).unwrap_or_else(|error| panic!("{error}"));
        let columns = all.reading_titled(layout, titles).unwrap_or_else(|error| panic!("{error}"));
        let mut cells = vec![f64::NAN; titles.len()];
        columns.cells(reading).into_iter().for_each(|(index, cell)| cells[index] = cell);
        let numbers = columns.columns.iter().map(|column| cells[column.index] * column.factor).collect();
        let found = columns.of(numbers).expect("a reading");
        assert!(found.iter().zip(reading).all(|(a, b)| (a - b).abs() < 1e-12), "{titles:?}: {found:?}");
        cells
    }

    /// Any list in another order.
    fn shuffled(titles: &[String], turn: usize) -> Vec<String> {
        let step = if titles.len().is_multiple_of(3) { 5 } else { 3 };
        (0..titles.len()).map(|index| titles[(index * step + turn) % titles.len()].clone()).collect()
    }

    #[test]
    fn every_channel_rotation_and_unit_comes_back() {
        let pose = [0.3, -0.2, 1.1, 0.4, -0.7, 0.9];
        let vector = Vector3::new(0.4, -0.7, 0.9);
        let units = ["", "_m", "_cm", "_mm", "_um", "_in", "_Inches", " (mm)", "_rad", "_deg", " [deg]", "_px"];
        for before in ["", "hand", "cam_tag"] {
            for unit in units {
                let with_unit = |titles: Vec<String>| -> Vec<String> {
                    let fits = |title: &String| {
                        let of = Title::parse(title).expect("a component").component;
                        of.quantity().factor(split(&format!("{title}{unit}")).1).is_some()
                    };
                    titles.into_iter().map(|it| if fits(&it) { it + unit } else { it }).collect()
                };
                for rotation in Rotation::ALL {
                    let titles = with_unit(Layout::Pose.titles_with(before, rotation));
                    let plain = comes_back(Layout::Pose, &titles, &pose);
                    for turn in 0..titles.len() {
                        let other = shuffled(&titles, turn);
                        let cells = comes_back(Layout::Pose, &other, &pose);
                        for (title, cell) in other.iter().zip(cells) {
                            let at = titles.iter().position(|it| it == title).expect("the same titles");
                            assert_eq!(cell, plain[at], "{other:?}");
                        }
                    }
                    // As a table has it, found by what it begins with.
                    let all = Titles::listed(titles.clone()).expect("titles");
                    assert_eq!(all.reading(Layout::Pose, before), all.reading_titled(Layout::Pose, &titles));
                    assert!(all.has_pose(before) && all.prefixes() == [before]);
                }
                for (layout, reading) in [
                    (Layout::Position, &pose[..3]),
                    (Layout::Pixels(1), &pose[..2]),
                    (Layout::Pixels(3), &pose[..]),
                    (Layout::Distance, &pose[..1]),
                ] {
                    let titles = with_unit(layout.titles(before));
                    comes_back(layout, &titles, reading);
                    let all = Titles::listed(titles.clone()).expect("titles");
                    assert_eq!(all.reading(layout, before), all.reading_titled(layout, &titles), "{titles:?}");
                    let capitals: Vec<String> = titles.iter().map(|title| title.to_uppercase()).collect();
                    assert_eq!(all.reading_titled(layout, &capitals), all.reading_titled(layout, &titles));
                }
            }
        }
        for rotation in Rotation::ALL {
            assert!((rotation.read(&rotation.write(vector)).expect("a rotation") - vector).norm() < 1e-12);
        }
    }

    #[test]
    fn lists_that_contradict_themselves_are_refused() {
        let read = |layout: Layout, list: &str| {
            let mut titles: Vec<String> = list.split(',').map(str::to_owned).collect();
            let listed = titles.clone();
            titles.sort_unstable();
            titles.dedup();
            Titles::listed(titles).expect("titles").reading_titled(layout, &listed)
        };
        for (layout, list, what) in [
            (Layout::Pose, "x,y,z,qx,qx,qy,qz", "both taken for qx, and none is qw"),
            (Layout::Pose, "x,y,z,qx,qy,qz", "3 columns are no rotation of 4"),
            (Layout::Pose, "x,y,z,roll,pitch,yaw,a", "4 columns are no rotation of 3"),
            (Layout::Pose, "x,y,z,rx,pitch,yaw", "in more than one way"),
            (Layout::Pose, "x,y,y1,rx,ry,rz", "both taken for y, and none is z"),
            (Layout::Pose, "tx,ty,tz,x,y,z,w", "both taken for x"),
            (Layout::Pose, "qw,qx,qy,qz,a,b,c", "both taken for"),
            (Layout::Position, "x,y,yaw", "a position has no rotation"),
            (Layout::Position, "a,x,y", "both taken for x, and none is z"),
            (Layout::Pixels(1), "v,v1", "has no partner"),
            (Layout::Pixels(1), "v,a", "`v` stands where u of a point should"),
            (Layout::Pixels(2), "u1,u2,v1,v3", "has no partner"),
        ] {
            let error = read(layout, list).expect_err(list);
            assert!(error.what.contains(what), "{list}: {error}");
        }
        let indices = |layout: Layout, list: &str| -> Vec<String> {
            let titles: Vec<String> = list.split(',').map(str::to_owned).collect();
            let all = Titles::listed(titles.clone()).expect("titles");
            let reading = all.reading_titled(layout, &titles).unwrap_or_else(|error| panic!("{list}: {error}"));
            reading.columns.iter().map(|column| all.all()[column.index].clone()).collect()
        };
        for (layout, list, wanted) in [
            (Layout::Pixels(2), "u1,u2,v1,v2", "u1,v1,u2,v2"),
            (Layout::Position, "q_z,q_x,q_y", "q_x,q_y,q_z"),
            (Layout::Pose, "rot_x,rot_y,rot_z,rot_rx,rot_rz,rot_ry", "rot_x,rot_y,rot_z,rot_rx,rot_ry,rot_rz"),
            (Layout::Pixels(2), "b_v,b_u,a_u,a_v", "b_u,b_v,a_u,a_v"),
            (Layout::Pixels(1), "cam_y,cam_x", "cam_x,cam_y"),
            (Layout::Pixels(1), "u3,v3", "u3,v3"),
            (Layout::Position, "x1,x2,x3", "x1,x2,x3"),
            (Layout::Position, "north,east,down", "north,east,down"),
            (Layout::Position, "north,Y,z", "north,Y,z"),
            (Layout::Pose, "a,b,c,qw,qx,qy,qz", "a,b,c,qx,qy,qz,qw"),
            (Layout::Pose, "yaw,x,roll,y,pitch,z", "x,y,z,roll,pitch,yaw"),
        ] {
            assert_eq!(indices(layout, list).join(","), wanted, "{list}");
        }
    }
}
