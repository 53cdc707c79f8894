//! A table as it lies there: which columns are measured places, which may drive joints.

use body_schema_engine::kinematics::JointKind;
use body_schema_table::{
    Columns, Component, Layout, Quantity, Rotation, Table, TableError, Title, Titles, is_absent, split,
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::{
    data::{Column, Data, Reading, Row, Target},
    median::median,
};

/// A table that has been read.
#[derive(Clone, Debug)]
pub struct ReadTable {
    /// The numbers.
    pub data: Data,
    /// The titles of every target's columns.
    pub measured: Vec<Vec<String>>,
    /// What was left out, and why, in sentences.
    pub remarks: Vec<String>,
}

/// Of a column of text fewer cells than this share are numbers.
const NUMBERS: f64 = 0.5;
/// A place so many times as far off as others are in the middle is no place.
const ABSURD: f64 = 20.0;
/// Places that lie so far from their middle, m, are of another unit.
const LARGE: f64 = 30.0;

/// Reads a table: every column that is titled as a component of a place or a rotation belongs to a target, all others may drive joints.
///
/// # Errors
///
/// [`TableError`] as `body_schema_table`, or if no place is measured.
pub fn read(text: &str) -> Result<ReadTable, TableError> {
    let table = Table::open(text.as_bytes())?;
    let titles = table.titles().clone();
    let (targets, measured) = targets(&titles);
    if targets.is_empty() {
        let error = titles.separated().unwrap_or_else(|| {
            TableError::new(
                format!("line 1: no three titles end with x, y and z; the titles are {}", titles.all().join(", ")),
                "title the columns of the measured place x, y, z, with rx, ry, rz or qx, qy, qz, qw where its rotation is measured",
            )
        });
        return Err(error);
    }
    let readings = measured.iter().zip(&targets).map(|(columns, target)| {
        titles.reading_titled(if target.is_pose { Layout::Pose } else { Layout::Position }, columns)
    });
    let readings = readings.collect::<Result<Vec<_>, _>>()?;
    let mut remarks = Vec::new();
    let mut columns: Vec<(usize, Column)> = Vec::new();
    for (index, title) in titles.all().iter().enumerate() {
        if title.is_empty() || measured.iter().flatten().any(|of| of == title) {
            continue;
        }
        match column(&titles, title) {
            Ok(column) => columns.push((index, column)),
            Err(unit) => remarks.push(format!(
                "column `{title}` is left out: `{unit}` is a unit of no joint; write degrees, radians, millimetres or metres"
            )),
        }
    }
    let labels = columns.iter().map(|(index, _)| *index).collect();
    let rows = table.rows(Columns { joints: Vec::new(), readings, labels }).collect::<Result<Vec<_>, _>>()?;
    let number = |cell: &str| cell.parse::<f64>().ok().filter(|number| number.is_finite());
    let mut kept: Vec<usize> = Vec::new();
    for (at, (_, column)) in columns.iter().enumerate() {
        let numbers = rows.iter().filter(|row| number(&row.labels[at]).is_some()).count();
        if rows.is_empty() || numbers as f64 >= NUMBERS * rows.len() as f64 {
            kept.push(at);
        } else {
            remarks.push(format!(
                "column `{}` is left out: {numbers} of its {} cells are numbers",
                column.title,
                rows.len()
            ));
        }
    }
    let mut found = Vec::new();
    for row in rows {
        if row.observation.is_miss() {
            continue;
        }
        let positions: Option<Vec<f64>> =
            kept.iter().map(|at| Some(number(&row.labels[*at])? * columns[*at].1.factor)).collect();
        let Some(positions) = positions else {
            let of = kept.iter().find(|at| number(&row.labels[**at]).is_none()).map_or(0, |at| *at);
            let cell = &row.labels[of];
            let what =
                if is_absent(cell) { "is empty".to_owned() } else { format!("holds `{cell}`, which is no number") };
            remarks.push(format!("line {} is left out: its cell of `{}` {what}", row.line, columns[of].1.title));
            continue;
        };
        let place = |(numbers, target): (&Option<Vec<f64>>, &Target)| {
            let numbers = numbers.as_ref()?;
            let [x, y, z] = [numbers[0], numbers[1], numbers[2]];
            if !target.is_pose {
                return Some(Reading::Point(Point3::new(x, y, z)));
            }
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(numbers[3], numbers[4], numbers[5]));
            Some(Reading::Pose(Isometry3::from_parts(Translation3::new(x, y, z), turn)))
        };
        let readings = row.observation.readings.iter().zip(&targets).map(place).collect();
        found.push(Row { line: row.line, positions, readings });
    }
    let columns = kept.iter().map(|at| columns[*at].1.clone()).collect();
    let mut data = Data { columns, targets, rows: found };
    drop_absurd(&mut data, &mut remarks);
    let merged = data.by_posture();
    if merged.rows.len() < data.rows.len() {
        remarks.push(format!(
            "{} rows are of {} postures: what was read more than once in one posture is taken together",
            data.rows.len(),
            merged.rows.len()
        ));
        data = merged;
    }
    Ok(ReadTable { data, measured, remarks })
}

/// The targets by their titles, numbered ones too: x1, y1, z1.
fn targets(titles: &Titles) -> (Vec<Target>, Vec<Vec<String>>) {
    let of = |before: &str, number: &str, component: Component| -> Option<String> {
        let is_it = |title: &&String| {
            Title::parse(title).is_some_and(|it| it.component == component && it.number == number && it.is_of(before))
        };
        titles.all().iter().find(is_it).cloned()
    };
    let all = |before: &str, number: &str, components: &[Component]| -> Option<Vec<String>> {
        components.iter().map(|component| of(before, number, *component)).collect()
    };
    let firsts = titles.all().iter().filter_map(|title| Title::parse(title)).filter(|it| it.component == Component::X);
    firsts
        .filter_map(|it| {
            let place = all(it.before, it.number, &Component::PLACE)?;
            let turned = Rotation::ALL.iter().find_map(|kind| all(it.before, it.number, kind.components()));
            let is_pose = turned.is_some();
            let titles = place.into_iter().chain(turned.unwrap_or_default()).collect();
            let gap = if it.before.is_empty() || it.number.is_empty() { "" } else { "_" };
            let name = format!("{}{gap}{}", it.before, it.number);
            Some((Target { name, is_pose }, titles))
        })
        .unzip()
}

/// A column that may drive a joint, by its title; the unit if it is none of a joint.
fn column(titles: &Titles, title: &str) -> Result<Column, String> {
    let (_, unit) = split(title);
    let of = |quantity: Quantity, kind: JointKind| {
        let found = quantity.is_in(title).then(|| titles.titled(title, quantity).ok()).flatten()?;
        Some(Column { title: title.to_owned(), kind: Some(kind), factor: found.factor })
    };
    // `plug_in` is no inch.
    let is_name = unit == "in" && !title.ends_with([')', ']']);
    if unit.is_empty() || is_name {
        return Ok(Column { title: title.to_owned(), kind: None, factor: 1.0 });
    }
    of(Quantity::Angle, JointKind::Revolute)
        .or_else(|| of(Quantity::Length, JointKind::Prismatic))
        .ok_or_else(|| unit.to_owned())
}

/// Takes out places that are far beyond all others, as -9999 is.
fn drop_absurd(data: &mut Data, remarks: &mut Vec<String>) {
    for target in 0..data.targets.len() {
        let points: Vec<Point3<f64>> = data.rows.iter().filter_map(|row| Some(row.readings[target]?.point())).collect();
        let axis = |axis: usize| median(points.iter().map(|point| point[axis]).collect());
        let middle = Point3::new(axis(0), axis(1), axis(2));
        let usual = median(points.iter().map(|point| (point - middle).norm()).collect());
        let name = if data.targets[target].name.is_empty() { "the target" } else { &data.targets[target].name };
        if usual > LARGE {
            remarks.push(format!(
                "the places of {name} are {usual:.0} m apart, which no robot reaches: if they are millimetres, end their titles with _mm"
            ));
        }
        for row in &mut data.rows {
            let far = |reading: &Reading| (reading.point() - middle).norm() > ABSURD * usual.max(1e-9);
            if points.len() > 4 && row.readings[target].as_ref().is_some_and(far) {
                row.readings[target] = None;
                remarks.push(format!(
                    "line {}: the place of {name} is left out: it is more than {ABSURD} times as far off as most",
                    row.line
                ));
            }
        }
    }
    data.rows.retain(|row| row.readings.iter().any(Option::is_some));
}
