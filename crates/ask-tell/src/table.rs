//! The observations as a table that `calibrate` reads, and the file that goes with it.

use toml::{Table, Value};

use super::{ChannelShape, Session, Shape, channel::SOCKET};
use body_schema_experiment::Executed;
use body_schema_table::{Layout, Reading, Titles, Writer};

/// The name of the table.
pub(super) const FILE: &str = "observations.csv";

/// The way from a channel's numbers to the cells of a row.
struct Cells {
    titles: Vec<String>,
    /// The columns of the reading; none for sockets, which have columns of their own.
    reading: Option<Reading>,
}

impl Cells {
    /// The cells of the columns that a calibration names, or of the default titles.
    fn new(ChannelShape { name, shape }: &ChannelShape, named: Option<Vec<String>>) -> Self {
        let (layout, usual) = match shape {
            Shape::Position => (Layout::Position, Layout::Position.titles(name)),
            Shape::Pose => (Layout::Pose, Layout::Pose.titles(name)),
            Shape::Pixels { points, .. } => (Layout::Pixels(*points), Layout::Pixels(*points).titles(name)),
            Shape::Distance => (Layout::Distance, vec![name.clone()]),
            Shape::Depth => (Layout::Depth, vec![name.clone()]),
            Shape::Sockets { .. } => return Self { titles: Vec::new(), reading: None },
        };
        let titles = named.unwrap_or(usual);
        // What cannot be read was refused when the session began.
        let reading = Titles::listed(titles.clone()).and_then(|all| all.reading_titled(layout, &titles)).ok();
        Self { titles, reading }
    }

    fn of(&self, reading: &[f64]) -> Vec<String> {
        let mut cells = vec![String::new(); self.titles.len()];
        for (index, cell) in self.reading.iter().flat_map(|columns| columns.cells(reading)) {
            cells[index] = cell.to_string();
        }
        cells
    }
}

impl Session {
    /// The number of the first observation of the body as it is now: what was seen before a change that was noticed is of another.
    fn since(&self) -> u64 {
        if self.ledger().changes_noticed() == 0 {
            return 1;
        }
        let told = self.observations().iter().filter(|told| !told.excluded && told.answer.body_seems_changed);
        told.map(|told| told.answer.observation).max().unwrap_or(1)
    }

    /// The counting observations with a reading, as CSV, from the latest change of the body on that was noticed: one line of titles, then one line per observation. Joints are in rad
    /// and m, readings in the columns that the calibration names, or else titled as `docs/calibrate.md` says. `calibrate`
    /// reads it by the file that [`calibration_toml`](Self::calibration_toml) gives.
    pub fn observations_csv(&self) -> String {
        let since = self.since();
        let numbered = (1..).zip(self.observations());
        let counted = numbered.filter(|(number, told)| *number >= since && !told.excluded);
        let read = counted.filter_map(|(_, told)| told.observation.read(self.scenario(), self.channels()).ok());
        let seen: Vec<Executed> = read.filter(|executed| !executed.observation.is_miss()).collect();
        self.csv_of(&seen)
    }

    /// The given observations as CSV, in the form of [`observations_csv`](Self::observations_csv).
    pub(super) fn csv_of(&self, observations: &[Executed]) -> String {
        let mut writer = Writer::new(Vec::new());
        let names = &self.scenario().robot.names;
        let cells = self.cells();
        let sockets = &self.scenario().robot.sockets;
        let has_places = sockets.iter().any(|socket| socket.place.is_some());
        let [place, socket] = self.socket_titles();
        let mut titles: Vec<String> = Vec::new();
        titles.extend(has_places.then_some(place));
        titles.extend((!sockets.is_empty()).then_some(socket));
        titles.extend(names.iter().cloned().chain(cells.iter().flat_map(|cells| cells.titles.clone())));
        // Writing to memory does not fail, and every row is as long as the titles.
        let _ = writer.write(&titles);
        for executed in observations {
            let held = executed.movement.socket.and_then(|socket| sockets.get(socket));
            let place = held.and_then(|socket| socket.place.clone()).unwrap_or_default();
            let mut row: Vec<String> = Vec::new();
            row.extend(has_places.then_some(place));
            row.extend((!sockets.is_empty()).then(|| held.map_or_else(String::new, |socket| socket.name.clone())));
            row.extend(executed.movement.configuration.iter().map(f64::to_string));
            for (cells, reading) in cells.iter().zip(&executed.observation.readings) {
                match reading {
                    Some(reading) => row.extend(cells.of(reading)),
                    None => row.extend(cells.titles.iter().map(|_| String::new())),
                }
            }
            let _ = writer.write(&row);
        }
        writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
    }

    /// The calibration file for [`observations_csv`](Self::observations_csv) under that name, beside `robot.urdf`. Keys that
    /// only serve the choice of movements are left out.
    pub fn calibration_toml(&self) -> String {
        let Ok(mut table) = self.setup().table() else { return String::new() };
        ["constraints", "view", "socket"].iter().for_each(|key| drop(table.remove(*key)));
        if let Some(Value::Table(robot)) = table.get_mut("robot") {
            robot.remove("shapes");
        }
        if !self.scenario().robot.sockets.is_empty() {
            table.entry("sockets").or_insert_with(|| Value::Table(Table::new()));
        }
        let name = |cells: &Cells| Value::Array(cells.titles.iter().map(|title| title.as_str().into()).collect());
        let named: Vec<Value> = self.cells().iter().map(name).collect();
        let sensors = match table.get_mut("sensor") {
            Some(Value::Table(sensor)) => vec![sensor],
            Some(Value::Array(sensors)) => sensors.iter_mut().filter_map(Value::as_table_mut).collect(),
            _ => Vec::new(),
        };
        for (sensor, titles) in sensors.into_iter().zip(named) {
            sensor.entry("columns").or_insert(titles);
        }
        table.insert("measurements".to_owned(), Value::Table([("file".to_owned(), FILE.into())].into_iter().collect()));
        toml::to_string(&table).unwrap_or_default()
    }

    /// The cells of each channel that always reads, in the order of the measurement model.
    fn cells(&self) -> Vec<Cells> {
        let calibration = &self.setup().calibration;
        let sensors = calibration.get("sensor");
        let columns = |index: usize| {
            let sensor = sensors.and_then(|it| if it.is_array() { it.get(index) } else { (index == 0).then_some(it) });
            let titles = sensor?.get("columns")?.as_array()?.iter();
            titles.map(|title| title.as_str().map(str::to_owned)).collect::<Option<Vec<String>>>()
        };
        let channels = self.channels().iter().filter(|channel| channel.name != SOCKET).enumerate();
        channels.map(|(index, channel)| Cells::new(channel, columns(index))).collect()
    }

    /// The titles of place and socket.
    pub(super) fn socket_titles(&self) -> [String; 2] {
        let given = |key: &str| self.setup().calibration.get("sockets")?.get(key)?.as_str().map(str::to_owned);
        [("place_column", "place"), ("socket_column", SOCKET)]
            .map(|(key, usual)| given(key).unwrap_or_else(|| usual.to_owned()))
    }
}
