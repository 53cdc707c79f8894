//! A recording as plain numbers.

use std::{collections::BTreeMap, io::Cursor};

use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;
use rerun::{
    Component,
    blueprint::components::QueryExpression,
    components::{
        Color, HalfSize2D, HalfSize3D, Length, LineStrip3D, Name, Position2D, Position3D, RotationQuat, Text,
        Translation3D, Vector3D,
    },
};

/// All messages of a stream.
pub fn messages(bytes: &[u8]) -> Vec<LogMsg> {
    DecoderApp::decode_eager(Cursor::new(bytes)).unwrap().map(Result::unwrap).collect()
}

/// The entities of a stream's chunks, as they come.
pub fn entities_in_order(bytes: &[u8]) -> Vec<String> {
    let data = messages(bytes).into_iter().filter_map(|message| match message {
        LogMsg::ArrowMsg(store, message) if store.is_recording() => Some(message),
        _ => None,
    });
    data.map(|message| Chunk::from_arrow_msg(&message).unwrap().entity_path().to_string()).collect()
}

/// The chunks of a recording by entity, and what its blueprint says.
pub struct Reading {
    pub recording_id: String,
    /// Display names of the blueprint's views.
    pub views: Vec<String>,
    /// What they show: lines of rules.
    pub contents: Vec<String>,
    /// Whether the blueprint is activated.
    pub activated: bool,
    /// The colour behind its views.
    pub background: Option<[u8; 4]>,
    chunks: BTreeMap<String, Vec<Chunk>>,
}

impl Reading {
    pub fn of(bytes: &[u8]) -> Self {
        let mut reading = Self {
            recording_id: String::new(),
            views: Vec::new(),
            contents: Vec::new(),
            activated: false,
            background: None,
            chunks: BTreeMap::new(),
        };
        for message in messages(bytes) {
            match message {
                LogMsg::SetStoreInfo(info) if info.info.store_id.is_recording() => {
                    reading.recording_id = info.info.store_id.recording_id().as_str().to_owned();
                }
                LogMsg::ArrowMsg(store, message) => {
                    let chunk = Chunk::from_arrow_msg(&message).unwrap();
                    if store.is_recording() {
                        reading.chunks.entry(chunk.entity_path().to_string()).or_default().push(chunk);
                    } else {
                        let colours = chunk.iter_component::<Color>("Background:color".into());
                        let colours = colours.flat_map(|colours| colours.as_slice().first().copied());
                        reading.background = colours.map(|colour| colour.0.to_array()).last().or(reading.background);
                        let rules = chunk.iter_component::<QueryExpression>("ViewContents:query".into());
                        let rules = rules
                            .flat_map(|rules| rules.as_slice().iter().map(|rule| rule.to_string()).collect::<Vec<_>>());
                        reading.contents.extend(rules);
                        let names = chunk.iter_component::<Name>("ViewBlueprint:display_name".into());
                        reading
                            .views
                            .extend(names.flat_map(|n| n.as_slice().iter().map(|n| n.to_string()).collect::<Vec<_>>()));
                    }
                }
                LogMsg::BlueprintActivationCommand(command) => reading.activated = command.make_active,
                LogMsg::SetStoreInfo(_) => {}
            }
        }
        reading
    }

    pub fn entities(&self) -> Vec<String> {
        self.chunks.keys().cloned().collect()
    }

    pub fn timelines(&self) -> Vec<String> {
        let mut names: Vec<String> = self
            .chunks
            .values()
            .flatten()
            .flat_map(|chunk| chunk.timelines().keys().map(|name| name.to_string()))
            .collect();
        names.sort();
        names.dedup();
        names
    }

    /// The steps at which an entity has a row.
    pub fn steps(&self, entity: &str) -> Vec<i64> {
        self.times(entity, "step")
    }

    /// The times at which an entity has a row, in order.
    pub fn times(&self, entity: &str, timeline: &'static str) -> Vec<i64> {
        let chunks = self.chunks.get(entity).into_iter().flatten();
        let times = chunks.flat_map(|chunk| chunk.iter_indices(&timeline.into()).map(|(time, _)| time.as_i64()));
        let mut times: Vec<i64> = times.collect();
        times.sort_unstable();
        times
    }

    /// What `read` finds in the row of a step; of the static row without a step.
    fn row<T>(
        &self,
        entity: &str,
        component: &'static str,
        step: Option<u64>,
        read: impl Fn(&Chunk, usize) -> T,
    ) -> Option<T> {
        let mut found: Vec<T> = Vec::new();
        for chunk in self.chunks.get(entity).into_iter().flatten() {
            let indices = chunk.iter_component_indices("step".into(), component.into());
            for (row, (time, _)) in indices.enumerate() {
                let wanted = step.map_or(chunk.is_static(), |step| !chunk.is_static() && time.as_i64() == step as i64);
                found.extend(wanted.then(|| read(chunk, row)));
            }
        }
        assert!(found.len() <= 1, "{entity} has one row per step");
        found.pop()
    }

    fn components<C: Component>(&self, entity: &str, component: &'static str, step: Option<u64>) -> Option<Vec<C>> {
        self.row(entity, component, step, |chunk, row| {
            chunk.iter_component::<C>(component.into()).nth(row).unwrap().as_slice().to_vec()
        })
    }

    pub fn numbers(&self, entity: &str, component: &'static str, step: Option<u64>) -> Option<Vec<f64>> {
        self.row(entity, component, step, |chunk, row| {
            chunk.iter_slices::<f64>(component.into()).nth(row).unwrap().to_vec()
        })
    }

    pub fn levels(&self, entity: &str, step: u64) -> Vec<u8> {
        let read = |chunk: &Chunk, row: usize| chunk.iter_slices::<u8>("levels".into()).nth(row).unwrap().to_vec();
        self.row(entity, "levels", Some(step), read).unwrap()
    }

    pub fn counts(&self, entity: &str, component: &'static str, step: u64) -> Vec<u32> {
        let read = |chunk: &Chunk, row: usize| chunk.iter_slices::<u32>(component.into()).nth(row).unwrap().to_vec();
        self.row(entity, component, Some(step), read).unwrap()
    }

    /// Where capsules begin and end. Lengths are those of the last row that has any.
    pub fn capsules(&self, entity: &str, step: u64) -> Vec<([f64; 3], [f64; 3])> {
        let lengths = (0..=step).rev().find_map(|step| {
            self.components::<Length>(entity, "Capsules3D:lengths", Some(step)).filter(|lengths| !lengths.is_empty())
        });
        let begins: Vec<Translation3D> = self.components(entity, "Capsules3D:translations", Some(step)).unwrap();
        let turns: Vec<RotationQuat> = self.components(entity, "Capsules3D:quaternions", Some(step)).unwrap();
        (begins.iter().zip(turns).zip(lengths.unwrap_or_default()))
            .map(|((begin, turn), length)| {
                let ([x, y, z, w], begin) = (turn.0.0.map(f64::from), begin.0.0.map(f64::from));
                let along = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
                (begin, std::array::from_fn(|i| begin[i] + f64::from(length.0.0) * along[i]))
            })
            .collect()
    }

    /// The coordinates of a line, point after point.
    pub fn strip(&self, entity: &str, step: Option<u64>) -> Vec<f64> {
        let strips: Vec<LineStrip3D> = self.components(entity, "LineStrips3D:strips", step).unwrap();
        assert_eq!(strips.len(), 1);
        strips[0].0.iter().flat_map(|point| point.0).map(f64::from).collect()
    }

    /// Lines, as points.
    pub fn strips(&self, entity: &str, step: Option<u64>) -> Vec<Vec<[f64; 3]>> {
        let strips: Vec<LineStrip3D> = self.components(entity, "LineStrips3D:strips", step).unwrap();
        strips.iter().map(|strip| strip.0.iter().map(|point| point.0.map(f64::from)).collect()).collect()
    }

    pub fn arrows(&self, entity: &str, step: Option<u64>) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let origins: Vec<Position3D> = self.components(entity, "Arrows3D:origins", step).unwrap();
        let vectors: Vec<Vector3D> = self.components(entity, "Arrows3D:vectors", step).unwrap();
        (origins.iter().map(|o| o.0.0.map(f64::from)).collect(), vectors.iter().map(|v| v.0.0.map(f64::from)).collect())
    }

    /// Centres, half-sizes and quaternions (x, y, z, w); none if nothing is logged.
    pub fn ellipsoids(&self, entity: &str, step: u64) -> Vec<([f64; 3], [f64; 3], [f64; 4])> {
        let step = Some(step);
        let Some(half_sizes) = self.components::<HalfSize3D>(entity, "Ellipsoids3D:half_sizes", step) else {
            return Vec::new();
        };
        let centres: Vec<Position3D> = self.components(entity, "Ellipsoids3D:centers", step).unwrap();
        let turns: Vec<RotationQuat> = self.components(entity, "Ellipsoids3D:quaternions", step).unwrap();
        (centres.iter().zip(&half_sizes).zip(&turns))
            .map(|((c, h), q)| (c.0.0.map(f64::from), h.0.0.map(f64::from), q.0.0.map(f64::from)))
            .collect()
    }

    /// Where a transform puts the origin, and its quaternion (x, y, z, w).
    pub fn pose(&self, entity: &str, step: u64) -> ([f64; 3], [f64; 4]) {
        let step = Some(step);
        let shift: Vec<Translation3D> = self.components(entity, "Transform3D:translation", step).unwrap();
        let turn: Vec<RotationQuat> = self.components(entity, "Transform3D:quaternion", step).unwrap();
        (shift[0].0.0.map(f64::from), turn[0].0.0.map(f64::from))
    }

    /// The labels of an entity in the row of a step, or the last row before it that has any.
    pub fn labels(&self, entity: &str, component: &'static str, step: u64) -> Vec<String> {
        let found = (0..=step).rev().find_map(|step| self.components::<Text>(entity, component, Some(step)));
        found.unwrap_or_default().iter().map(|text| text.as_str().to_owned()).collect()
    }

    pub fn points(&self, entity: &str, step: u64) -> Option<Vec<f64>> {
        let points: Vec<Position3D> = self.components(entity, "Points3D:positions", Some(step))?;
        Some(points.iter().flat_map(|point| point.0.0).map(f64::from).collect())
    }

    pub fn points_2d(&self, entity: &str, step: u64) -> Vec<[f64; 2]> {
        let points: Vec<Position2D> = self.components(entity, "Points2D:positions", Some(step)).unwrap();
        points.iter().map(|point| point.0.0.map(f64::from)).collect()
    }

    pub fn half_sizes_2d(&self, entity: &str, step: u64) -> Vec<[f64; 2]> {
        let sizes: Vec<HalfSize2D> = self.components(entity, "Boxes2D:half_sizes", Some(step)).unwrap();
        sizes.iter().map(|size| size.0.0.map(f64::from)).collect()
    }

    /// The first colour: the static one, or that of step 0.
    pub fn colour(&self, entity: &str, component: &'static str) -> [u8; 3] {
        let colours = self.components::<Color>(entity, component, None);
        let colours = colours.or_else(|| self.components(entity, component, Some(0))).unwrap();
        let [red, green, blue, _] = colours[0].0.to_array();
        [red, green, blue]
    }

    pub fn note(&self) -> String {
        let text: Vec<Text> = self.components("/note", "TextDocument:text", None).unwrap();
        text[0].as_str().to_owned()
    }
}
