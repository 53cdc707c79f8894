//! The table of a measured world.

use std::{collections::BTreeSet, ops::Range};

use toml::Spanned;

use super::{Check, described::Ends, raw};
use crate::{Described, HeldOut, Measurements, Robot};
use body_schema_engine::{
    kinematics::JointKind,
    sensing::{Keys, Observation},
};
use body_schema_robot::{Follows, Segment, Urdf};
use body_schema_table::{Column, Columns, Layout, Quantity, Reading, Table, TableError, Titles};

/// The titles of the columns of sockets, unless stated otherwise.
const PLACE: &str = "place";
const SOCKET: &str = "socket";

/// The columns of text that tell which socket held a target.
pub(super) struct SocketColumns {
    /// The column of the place; none, where all sockets stand at one place.
    pub place: Option<String>,
    pub socket: String,
}

impl Check<'_> {
    /// The titles of the table of a scenario whose robot is a URDF; `None` has left a problem behind.
    pub(super) fn titles(&mut self, measurements: &raw::Measurements) -> Option<Titles> {
        let text = self.table_text(&measurements.file)?;
        let titles = Table::open(text.as_bytes()).map(|table| table.titles().clone());
        titles.map_err(|error| self.refuse_table(&measurements.file, error)).ok()
    }

    fn table_text(&mut self, file: &Spanned<String>) -> Option<String> {
        let text = self.opened(file.get_ref());
        text.map_err(|error| {
            let hint = "name a file beside the scenario that can be read, CSV as text in UTF-8";
            self.problem(file.span(), "measurements.file", format!("{} {error}", file.get_ref()), hint);
        })
        .ok()
    }

    fn refuse_table(&mut self, file: &Spanned<String>, TableError { what, hint }: TableError) {
        self.problem(file.span(), "measurements.file", format!("{} {what}", file.get_ref()), hint);
    }

    /// The rows of a table and the rule for holding out; the sockets that they name become the robot's.
    pub(super) fn recorded(&mut self, raw: &raw::Scenario, robot: &mut Robot) -> Option<(Measurements, HeldOut)> {
        let measurements = raw.measurements.as_ref()?;
        let (span, measurements) = (measurements.span(), measurements.get_ref());
        let columns = self.joint_columns(raw, robot);
        self.one_way_of_reading(raw, measurements, span)?;
        let text = self.table_text(&measurements.file)?;
        let mut columns = columns?;
        let sockets = Table::open(text.as_bytes()).ok().and_then(|table| socket_columns(raw, table.titles()));
        let taken = taken(raw);
        self.without_column(raw, &text, &mut columns, robot)?;
        let columns = columns;
        let by = raw.held_out.as_ref().and_then(|held_out| held_out.get_ref().by.as_ref());
        let wanted = |titles: &Titles| {
            let labels =
                sockets.iter().flat_map(|it| it.place.iter().chain([&it.socket])).chain(by.map(Spanned::get_ref));
            let labels: BTreeSet<&String> = labels.collect();
            let joints = columns.iter().filter_map(|column| column.find(titles, &taken));
            let joints = joints.collect::<Result<Vec<_>, TableError>>()?;
            // What is a joint's is not measured, unless its column is named.
            let of_joints: Vec<&String> = match robot.described {
                Some(_) => joints.iter().map(|column| &titles.all()[column.index]).collect(),
                None => Vec::new(),
            };
            let readings = readings(raw, robot, titles, &titles.besides(&of_joints))?;
            let mut measured = readings.iter().flat_map(|reading| &reading.columns);
            if let Some(both) = measured.find(|column| joints.iter().any(|joint| joint.index == column.index)) {
                let what = format!(
                    "line 1: `{}` is the column of a joint, and read as measured too",
                    titles.all()[both.index]
                );
                return Err(TableError::new(
                    what,
                    "name the columns of what was measured: `columns = […]` of the [[sensor]]",
                ));
            }
            Ok(Columns {
                joints,
                readings,
                labels: labels.into_iter().map(|title| titles.label(title)).collect::<Result<_, _>>()?,
            })
        };
        let read = |text: &str| Measurements::from_csv(text, wanted).map(|rows| moved(rows, &columns, robot));
        let mut rows = read(&text).map_err(|error| self.refuse_table(&measurements.file, error)).ok()?;
        let held_out = self.held_out(raw, &mut rows, &read)?;
        if let Some(columns) = sockets {
            self.recorded_sockets(raw, &columns, &mut rows, &held_out, robot)?;
        }
        know_baselines(&mut rows, robot);
        Some((rows, held_out))
    }

    /// The titles without those of the joints' columns, as far as the description tells which these are.
    pub(super) fn beside_joints(&mut self, raw: &raw::Scenario, titles: &Titles) -> Titles {
        let Some(urdf) = &raw.robot.urdf else { return titles.clone() };
        let text = self.opened(urdf.get_ref()).unwrap_or_default();
        // What is wrong with it is told where it is needed.
        let Some(chain) = Urdf::parse(&text).ok().and_then(|urdf| Ends::of(raw).chain(&coupled(urdf, raw))) else {
            return titles.clone();
        };
        let taken = taken(raw);
        let joints = chain.readings.into_iter().map(|reading| JointColumn::Named(reading.name, reading.kind));
        let found = joints.filter_map(|joint| joint.find(titles, &taken)?.ok());
        titles.besides(&found.map(|column| &titles.all()[column.index]).collect::<Vec<_>>())
    }

    /// The columns of the joints; `None` has left a problem behind.
    fn joint_columns(&mut self, raw: &raw::Scenario, robot: &Robot) -> Option<Vec<JointColumn>> {
        if let Some(Described { chain, .. }) = robot.described.as_deref() {
            let named = chain.readings.iter().map(|reading| JointColumn::Named(reading.name.clone(), reading.kind));
            return Some(named.collect());
        }
        let mut columns = Vec::new();
        for (index, joint) in raw.robot.joints.get_ref().iter().enumerate() {
            let kind = joint.get_ref().kind;
            match &joint.get_ref().column {
                Some(column) => columns.push(JointColumn::Titled(column.get_ref().clone(), kind)),
                None => {
                    let hint = "add `column = \"…\"`, the column of the data file with this joint's position";
                    self.problem(joint.span(), format!("robot.joint[{index}].column"), "missing", hint);
                }
            }
        }
        (columns.len() == raw.robot.joints.get_ref().len()).then_some(columns)
    }

    /// Checks that measurements are described in one way: by sensors or by `marker_columns_m`.
    fn one_way_of_reading(
        &mut self,
        raw: &raw::Scenario,
        measurements: &raw::Measurements,
        span: Range<usize>,
    ) -> Option<()> {
        match (&measurements.marker_columns_m, &raw.sensor, &raw.held) {
            (Some(columns), Some(_), _) | (Some(columns), _, Some(_)) => {
                let hint = "remove it, and write `columns = [\"x\", \"y\", \"z\"]` of the [[sensor]]";
                self.problem(columns.span(), "measurements.marker_columns_m", "sensors say what was measured", hint);
                None
            }
            (None, None, None) => {
                let hint = "add `marker_columns_m = [\"x\", \"y\", \"z\"]`, or a [[sensor]]";
                self.problem(span, "measurements.marker_columns_m", "missing", hint);
                None
            }
            _ => Some(()),
        }
    }
}

/// The way to find the column of a joint.
pub(super) enum JointColumn {
    /// By exactly this title, which ends with the unit; without one it is rad or m.
    Titled(String, JointKind),
    /// By the joint's name, with or without its unit.
    Named(String, JointKind),
    /// There is none, and none is needed.
    Absent,
}

impl JointColumn {
    /// The column, if there is one; among several that fit a joint's name, the one that no sensor has `taken`.
    fn find(&self, titles: &Titles, taken: &[&String]) -> Option<Result<Column, TableError>> {
        match self {
            Self::Titled(title, kind) => Some(titles.titled(title, Quantity::of(*kind))),
            Self::Named(name, kind) => {
                let found = titles.find(name, Quantity::of(*kind));
                Some(found.or_else(|error| titles.besides(taken).find(name, Quantity::of(*kind)).map_err(|_| error)))
            }
            Self::Absent => None,
        }
    }
}

/// The titles that sensors name.
fn taken(raw: &raw::Scenario) -> Vec<&String> {
    let sensors = raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0);
    sensors.flat_map(|keys| keys.get_ref().columns.iter().flatten()).collect()
}

/// The columns of every sensor: by the titles that it names, or among those `beside` the joints'.
fn readings(raw: &raw::Scenario, robot: &Robot, titles: &Titles, beside: &Titles) -> Result<Vec<Reading>, TableError> {
    let marker = raw.measurements.as_ref().and_then(|given| given.get_ref().marker_columns_m.as_ref());
    if let Some(columns) = marker {
        return Ok(vec![titles.reading_titled(Layout::Position, &columns.get_ref().0)?]);
    }
    let sensors = raw.sensor.iter().flat_map(|sensors| &sensors.get_ref().0);
    sensors.map(|keys| reading(keys.get_ref(), robot, titles, beside)).collect()
}

fn reading(keys: &Keys, robot: &Robot, titles: &Titles, beside: &Titles) -> Result<Reading, TableError> {
    let (layout, prefix) = told(keys, robot);
    let found = match &keys.columns {
        Some(columns) => titles.reading_titled(layout, columns),
        // With nothing before them where there is no doubt; all titles are told where there is none.
        None => beside.reading_of(layout, &prefix).or_else(|_| titles.reading_of(layout, &prefix)),
    };
    let least = least_points(keys, robot, layout);
    Ok(least.into_iter().fold(found?, |reading, least| reading.partly_seen(least)))
}

/// The least number of points of a reading, where its target is partly seen.
fn least_points(keys: &Keys, robot: &Robot, layout: Layout) -> Option<usize> {
    let targets = &robot.equipment.targets;
    let target = match &keys.target {
        Some(name) => targets.iter().find(|kind| kind.name == *name),
        None => targets.first(),
    };
    let partly_seen = target.filter(|_| matches!(layout, Layout::Pixels(_)))?.partly_seen.as_ref()?;
    Some(partly_seen.least_points)
}

/// The layout of a sensor's reading in a table, and the prefix of its titles.
pub(super) fn told(keys: &Keys, robot: &Robot) -> (Layout, String) {
    let equipment = &robot.equipment;
    let named = |name: &Option<String>| name.clone();
    let target = named(&keys.target).or_else(|| Some(equipment.targets.first()?.name.clone())).unwrap_or_default();
    let points = equipment.targets.iter().find(|kind| kind.name == target).map_or(1, |kind| kind.points.len());
    let layout = match keys.channel.as_deref() {
        Some("pose") => Layout::Pose,
        Some("distance") => Layout::Distance,
        Some("depth") => Layout::Depth,
        Some("pixels") => Layout::Pixels(points),
        _ => Layout::Position,
    };
    // What is measured from a part of the robot is called by that part as well.
    let observer = keys.observer(equipment).and_then(|observer| equipment.name(observer));
    let name = observer.map_or_else(|| target.clone(), |observer| format!("{observer}_{target}"));
    (layout, name)
}

fn socket_columns(raw: &raw::Scenario, titles: &Titles) -> Option<SocketColumns> {
    let held = raw.held.as_ref()?.get_ref();
    let given = |name: &Option<Spanned<String>>| name.as_ref().map(|name| name.get_ref().clone());
    let usual = || titles.label(PLACE).is_ok().then(|| PLACE.to_owned());
    let socket = given(&held.socket_column).unwrap_or_else(|| SOCKET.to_owned());
    Some(SocketColumns { place: given(&held.place_column).or_else(usual), socket })
}

/// The description with the joints that follow sums of others, as far as they can be read.
fn coupled(mut urdf: Urdf, raw: &raw::Scenario) -> Urdf {
    for (joint, sum) in &raw.robot.coupled {
        let _ = urdf.couple(joint.get_ref(), sum.get_ref());
    }
    urdf
}

/// Turns rows by readings into rows by the joints that they move. Readings without a column are 0.
fn moved(mut rows: Measurements, columns: &[JointColumn], robot: &Robot) -> Measurements {
    if let Some(Described { chain, .. }) = robot.described.as_deref() {
        let mut read = 0..;
        let place = |column: &JointColumn| if matches!(column, JointColumn::Absent) { None } else { read.next() };
        let places: Vec<Option<usize>> = columns.iter().map(place).collect();
        let of = |given: &[f64]| places.iter().map(|place| place.map_or(0.0, |place| given[place])).collect::<Vec<_>>();
        rows.configurations.iter_mut().for_each(|readings| *readings = chain.positions(&of(readings)));
        let titles = std::mem::take(&mut rows.columns);
        rows.columns =
            places.iter().map(|place| place.map_or_else(String::new, |place| titles[place].clone())).collect();
        let is_unread = |follows: &Follows| follows.readings().any(|reading| places[reading].is_none());
        let unread = chain.moving().filter(|segment| segment.follows.as_ref().is_some_and(is_unread));
        rows.unread = unread.map(|segment| segment.name.clone()).collect();
        // What is computed of several columns has the joint's name.
        let column = |segment: &Segment| match segment.follows.as_ref()?.terms[..] {
            [(reading, _)] => Some(rows.columns[reading].clone()),
            _ => Some(segment.name.clone()),
        };
        rows.columns = chain.moving().filter_map(column).collect();
    }
    rows
}
/// Adds where cameras are in the frames of others, as described, to what is known of measured rows, in the order of the measurement model: last.
fn know_baselines(rows: &mut Measurements, robot: &Robot) {
    let baselines = &robot.baselines;
    let before = rows.observations.first().map_or(0, |observation| observation.readings.len());
    for observation in &mut rows.observations {
        observation.readings.resize(before + baselines.len(), None);
    }
    if !baselines.is_empty() {
        let known = rows.beforehand.get_or_insert_with(|| Observation::missed(before));
        known.readings.extend(robot.known_baselines().map(Some));
    }
}
