//! The recorder of an experiment.

use body_schema_palette::{learner_color, learner_slots};
use std::{collections::HashSet, sync::atomic::AtomicU64, time::Duration};

use web_time::Instant;

use super::{
    Appearance, EllipsoidSize, LiveLog, MOST_FRAMES, RecordingError, TRUTH_COLOR, Target, Theme,
    arm::Drawing,
    arm::log_meshes,
    blueprint::Arranger,
    body::Figure,
    broken::broken,
    charts::BEST_DESIGN,
    colours::tint,
    eye::carried,
    file::RrdFile,
    learner::LearnerEntities,
    links::Links,
    message, metrics, model,
    note::{key, note},
    obstacles::Obstacles,
    rerun::{ApplicationId, Chunk, Color, EntityPath, LogMsg, RecordingInfo, SeriesLines, StoreId, ViewCoordinates},
    room::Room,
    rows::Rows,
    scenery::{Scenery, TRUE_ARM},
    stage::{GROUNDS, Stage},
    values::cells,
};
use body_schema_engine::model::State;
use body_schema_wire::{BestDesign, Description, LearnerDescription, ModelReport, StepReport};

/// The most steps that are gathered before they are written: a message costs more than the rows in it. They are written
/// earlier when flushed, …
const BATCH_STEPS: usize = 256;

/// … when so many rectangles of partitions have gathered, some tens of megabytes, …
const BATCH_RECTANGLES: usize = 200_000;

/// … or when this time has passed, so that a process that is killed loses little.
const BATCH_TIME: Duration = Duration::from_secs(2);

/// The bytes of an entity with large rows, such as pictures, at which they are written at once: the memory is used
/// again while the processor's cache still holds it, and a server has many recorders.
const LARGE_BYTES: usize = 1 << 18;

/// Length of the arrows at θ = 0, as a part of the reach of the arm.
const ARROW: f64 = 0.22;
/// How much farther out than believed a hand of unknown place may be, as a part of the reach.
const FARTHER: f64 = 0.6;

/// Records an experiment, as the module's documentation lists it.
///
/// Steps are gathered and written 256 at a time, at least every other second, or when [`flush`](Self::flush) is called. A live
/// view that wants to be up to date calls [`flush_shown`](Self::flush_shown). [`finish`](Self::finish) writes what is left and
/// the file's footer (its index); dropping the recorder does so too, but cannot report errors.
///
/// If the process is killed, the file holds everything up to the last batch. Viewers open it; `rerun rrd verify` complains of
/// the missing footer, which `rerun rrd optimize` adds.
///
/// # The partition
///
/// `/{learner}/direct/leaves` holds all rectangles of a step as components of plain numbers: `dimension` n, then for each
/// rectangle `centres` (n f64 in the unit cube), `levels` (n u8, side i is 3^−levelᵢ long), `values` (f64, NaN if the
/// criterion was not finite), `generations` (u32), `potentially_optimal` (bool); `chosen` is the index of the rectangle whose
/// centre is the chosen configuration.
///
/// The slice in `direct/boxes` is the plane through the chosen configuration along two joints, in units of their limits: x =
/// centre of the one, y = 1 − centre of the other, because Rerun draws y downwards and upper limits belong on top. The two are
/// the joints that the first partition divides most, and stay the same over the recording.
pub struct Recorder {
    description: Description,
    store: StoreId,
    rows: Rows,
    /// The entities that the arrangement of views does not show at first.
    hidden: HashSet<EntityPath>,
    file: Option<RrdFile>,
    /// The error because of which the file lacks steps that the log has.
    file_failure: Option<String>,
    live: Option<LiveLog>,
    learners: Vec<LearnerEntities>,
    appearance: Appearance,
    /// How many times as large differences from the description are drawn, if they are.
    enlarged: Option<f64>,
    /// The shapes of the robot's links, if it has any.
    links: Option<Links>,
    /// The places of all learners; known from the first report on.
    stage: Option<Stage>,
    /// The true arm, where it is known.
    truth: Option<State>,
    /// The joint that broke at the last change of it.
    broken: Option<usize>,
    /// The last step, if the live log does not yet say that it is complete.
    incomplete: Option<u64>,
    waiting_steps: usize,
    waiting_rectangles: usize,
    flushed: Instant,
    finished: bool,
}

impl Recorder {
    /// Opens the target and records the static entities.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Create`] if the file cannot be created, [`RecordingError::Encode`] if the static entities
    /// cannot be encoded.
    pub fn new(description: &Description, target: Target) -> Result<Self, RecordingError> {
        let Target { file, grows, live, recording_id, ellipsoids, appearance, enlarged } = target;
        let enlarged = enlarged.filter(|_| description.truth.is_none());
        let create = if grows { RrdFile::create_growing } else { RrdFile::create };
        let names: Vec<&str> = description.learners.iter().map(|learner| learner.name.as_str()).collect();
        // Viewers keep one arrangement per application: those of different learners must not meet.
        let application = format!("body-schema-{}-{}", description.scenario, names.join("-"));
        let recording = recording_id.unwrap_or_else(|| format!("{}-seed-{}", description.scenario, description.seed));
        let learners: Vec<LearnerEntities> = (names.iter().zip(learner_slots(names.iter().copied())).enumerate())
            .map(|(index, (name, slot))| {
                LearnerEntities::new((index, learner_color(slot), name), description, (ellipsoids, enlarged))
            })
            .collect();
        let store = StoreId::recording(ApplicationId::new_or_unknown(application), recording);
        let mut recorder = Self {
            description: description.clone(),
            rows: Rows::of(&store),
            store,
            file: file.as_deref().map(create).transpose()?,
            file_failure: None,
            live,
            hidden: learners.iter().flat_map(LearnerEntities::hidden).collect(),
            learners,
            enlarged,
            links: Links::of(&appearance),
            appearance,
            stage: None,
            truth: description.truth.as_ref().and_then(ModelReport::state),
            broken: None,
            incomplete: None,
            waiting_steps: 0,
            waiting_rectangles: 0,
            flushed: Instant::now(),
            finished: false,
        };
        match recorder.begin(ellipsoids) {
            Ok(()) => Ok(recorder),
            Err(error) => {
                recorder.discard();
                Err(error)
            }
        }
    }

    /// The id of the recording.
    pub fn recording_id(&self) -> &str {
        self.store.recording_id().as_str()
    }

    /// The id of the application, by which viewers keep arrangements of views.
    pub fn application_id(&self) -> &str {
        self.store.application_id().as_str()
    }

    /// Records a step. Steps come in order; the first one is step 0.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if the step cannot be encoded; [`RecordingError::Write`] if the file cannot be
    /// written and there is no live log.
    pub fn log(&mut self, report: &StepReport) -> Result<(), RecordingError> {
        self.log_moving(report, 0)
    }

    /// Records a step, and for live viewers `frames` postures on the way to it (at most [`MOST_FRAMES`]).
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if the step cannot be encoded; [`RecordingError::Write`] if the file cannot be
    /// written and there is no live log.
    pub fn log_moving(&mut self, report: &StepReport, frames: u64) -> Result<(), RecordingError> {
        let stage = match self.stage.take() {
            Some(stage) => stage,
            None => self.arrange(report)?,
        };
        let arrow_m = ARROW * stage.figure.reach_m;
        if let Some(truth) = &report.truth {
            let after = truth.state();
            let changed = self.truth.as_ref().zip(after.as_ref());
            self.broken = changed.and_then(|(before, after)| broken(before, after)).or(self.broken);
            self.truth = after;
            self.log_truth(Some(report.step), truth, arrow_m);
        }
        let Self { description, learners, rows, live, truth, links, broken, .. } = self;
        let frames = if live.is_some() { frames.min(MOST_FRAMES) } else { 0 };
        let base = description.truth.as_ref().and_then(ModelReport::base_frame).unwrap_or_default();
        let drawing = Drawing { links: links.as_ref(), reach_m: stage.figure.reach_m };
        let true_frames = truth.as_ref().map(|truth| drawing.frames(truth, &base)).unwrap_or_default();
        let scenery = Scenery {
            description,
            stage: &stage,
            truth: truth.as_ref(),
            true_frames: &true_frames,
            links: links.as_ref(),
            broken: *broken,
            arrow_m,
            frames,
            branches: report.learners.iter().any(|learner| !learner.estimate.parents.is_empty()),
        };
        for (entities, learner) in learners.iter_mut().zip(&report.learners) {
            entities.log(rows, report.step, learner, &scenery);
            let partition = learner.movement.as_ref().and_then(|movement| movement.partition.as_ref());
            self.waiting_rectangles += partition.map_or(0, |partition| partition.leaves.len());
        }
        self.stage = Some(stage);
        self.incomplete = Some(report.step);
        self.waiting_steps += 1;
        let is_full = self.waiting_steps >= BATCH_STEPS || self.waiting_rectangles >= BATCH_RECTANGLES;
        if is_full || self.flushed.elapsed() >= BATCH_TIME { self.flush() } else { self.write_large() }
    }

    /// Writes the rows of entities with many waiting bytes.
    fn write_large(&mut self) -> Result<(), RecordingError> {
        if !self.rows.has_large(LARGE_BYTES) {
            return Ok(());
        }
        let Self { rows, store, live, file, .. } = self;
        let kept = file.is_some();
        let live = live.as_ref().map_or(Ok(()), |live| {
            live.append(&messages(store, &rows.news(|sheet| sheet.bytes() >= LARGE_BYTES, kept)?)?)
        });
        let file = file
            .as_mut()
            .map_or(Ok(()), |file| file.append(&messages(store, &rows.steps(|sheet| sheet.bytes() >= LARGE_BYTES)?)?));
        // To both targets, whatever happens to the other.
        self.settle(file).and(live)
    }

    /// Draws a robot along these bones (a line of points for each branch, that of the marker first and the marker last in it, metres)
    /// beside the learner's, for live viewers: a posture that is tried out after `step`. `None` clears it, and so does the learner's
    /// next step.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if the drawing cannot be encoded for the live log.
    pub fn log_ghost(
        &mut self,
        step: u64,
        learner: usize,
        bones_m: Option<&[Vec<[f64; 3]>]>,
    ) -> Result<(), RecordingError> {
        if let (Some(entities), Some(stage), Some(_)) = (self.learners.get_mut(learner), &self.stage, &self.live) {
            entities.log_ghost(&mut self.rows, step, bones_m, stage.figure.reach_m);
        }
        self.flush_shown()
    }

    /// Records the best designs of several lengths, each at the step at which as many movements are made. It may be
    /// called at any time before the end.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if the curve cannot be encoded; [`RecordingError::Write`] if the file cannot be
    /// written and there is no live log.
    pub fn log_best_designs(&mut self, designs: &[BestDesign]) -> Result<(), RecordingError> {
        if designs.is_empty() {
            return Ok(());
        }
        let series = EntityPath::from(BEST_DESIGN);
        let line =
            SeriesLines::new().with_colors([Color::from(TRUTH_COLOR)]).with_names(["best design"]).with_widths([1.5]);
        self.rows.always(&series, &[&line]);
        for design in designs {
            self.rows.number(design.step, &series, design.best_design_trace);
        }
        self.flush()
    }

    /// Writes the waiting steps to the log, and hands them to the operating system.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if a step cannot be encoded; [`RecordingError::Write`] if the file cannot be written
    /// and there is no live log.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        (self.waiting_steps, self.waiting_rectangles, self.flushed) = (0, 0, Instant::now());
        let live = self.publish(&HashSet::new());
        let file = match &mut self.file {
            Some(file) => {
                let steps = self.rows.steps(|_| true)?;
                file.append(&messages(&self.store, &steps)?)
            }
            None => Ok(()),
        };
        // To both targets, whatever happens to the other.
        self.settle(file).and(live)
    }

    /// Writes the rows that live views show at first; the rest, and the file, wait for the next [`flush`](Self::flush), at most
    /// 256 steps or two seconds of them. Every message costs about a kilobyte, and most entities are series that no view shows:
    /// a live view that is up to date at every step needs half the messages this way, and the file has few large ones.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Encode`] if a step cannot be encoded for the live log.
    pub fn flush_shown(&mut self) -> Result<(), RecordingError> {
        let hidden = std::mem::take(&mut self.hidden);
        let published = self.publish(&hidden);
        self.hidden = hidden;
        published
    }

    /// Writes to the log what it does not have yet, except for hidden entities.
    fn publish(&mut self, hidden: &HashSet<EntityPath>) -> Result<(), RecordingError> {
        let Self { rows, incomplete, store, file, live, .. } = self;
        let Some(live) = live else { return Ok(()) };
        let news = rows.news(|sheet| !hidden.contains(sheet.entity()), file.is_some()).and_then(|mut news| {
            news.extend(incomplete.take().map(|step| rows.complete(step)).transpose()?);
            live.append(&messages(store, &news)?)
        });
        live.catch_up();
        news
    }

    /// The error because of which the file lacks steps that the log has. [`seal`](Self::seal) writes the file anew.
    pub fn file_failure(&self) -> Option<&str> {
        self.file_failure.as_deref()
    }

    /// Handles the result of writing the file. Beside a live log a failure is remembered rather than returned, because
    /// the log has everything.
    fn settle(&mut self, written: Result<(), RecordingError>) -> Result<(), RecordingError> {
        match written {
            Err(error) if self.live.is_some() => {
                self.file_failure.get_or_insert_with(|| error.to_string());
                Ok(())
            }
            written => written,
        }
    }

    /// Writes what is left, ends the file with its footer, and closes the log.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if what is left cannot be encoded, or the file can be written neither as it grew nor anew.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.end()
    }

    /// Discards the recording: no file is left of it, and the log is closed.
    pub fn discard(mut self) {
        self.rows = Rows::of(&self.store);
        (self.finished, self.incomplete) = (true, None);
        if let Some(file) = self.file.take() {
            file.discard();
        }
    }

    /// Writes what is left and ends the file with its footer: nothing is recorded after it. A file that could not be written
    /// as it grew is written anew from the log. After an error it may be tried again, and steps may be recorded.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if what is left cannot be encoded, or the file can be written neither as it grew nor anew.
    pub fn seal(&mut self) -> Result<(), RecordingError> {
        if self.finished {
            return Ok(());
        }
        self.flush()?;
        if let Some(file) = &mut self.file
            && let Err(error) = file.finish()
        {
            let written = match &self.live {
                Some(live) => file.replace(&live.complete()?),
                None => Err(error),
            };
            written.inspect_err(|error| {
                self.file_failure.get_or_insert_with(|| error.to_string());
            })?;
        }
        (self.finished, self.file_failure) = (true, None);
        Ok(())
    }

    fn end(&mut self) -> Result<(), RecordingError> {
        let sealed = self.seal();
        self.finished = true;
        if let Some(live) = &self.live {
            live.close();
        }
        sealed
    }

    /// Sends messages to both targets, whatever happens to the other.
    fn send(&mut self, messages: &[LogMsg]) -> Result<(), RecordingError> {
        let live = self.live.as_ref().map_or(Ok(()), |live| live.append(messages));
        let file = self.file.as_mut().map_or(Ok(()), |file| file.append(messages));
        self.settle(file).and(live)
    }

    fn begin(&mut self, ellipsoids: EllipsoidSize) -> Result<(), RecordingError> {
        self.send(&[message::store_info(&self.store)])?;
        let Self { description, rows, enlarged, .. } = self;
        let name = format!("{}, seed {}", description.scenario, description.seed);
        rows.always(&EntityPath::properties(), &[&RecordingInfo::new().with_name(name)]);
        rows.always(&EntityPath::root(), &[&ViewCoordinates::RIGHT_HAND_Z_UP()]);
        rows.always(&EntityPath::from("note"), &[&note(description, ellipsoids, *enlarged)]);
        for (learner, LearnerDescription { name, .. }) in self.learners.iter().zip(&description.learners) {
            let colour = learner.colour;
            for (series, metric) in learner.metrics.iter().zip(metrics::NAMES) {
                // Beside the trace itself, and paler.
                let (name, colour, width) = match metric {
                    "bound_trace" => (format!("{name}: what its data allow"), tint(colour, 0.45), 1.2),
                    _ => (name.clone(), colour, 2.0),
                };
                let line =
                    SeriesLines::new().with_colors([Color::from(colour)]).with_names([name]).with_widths([width]);
                rows.always(series, &[&line]);
            }
        }
        Ok(())
    }

    /// Logs the true arm at θ = 0 from a step on; at all times without a step.
    fn log_truth(&mut self, step: Option<u64>, truth: &ModelReport, arrow_m: f64) {
        let axes_look = model::axes_look(&self.description.joints, TRUTH_COLOR);
        let links = [model::links(&truth.bones_m()), cells([&model::links_look(TRUTH_COLOR) as _])].concat();
        let axes = [model::axes(truth, arrow_m), cells([&axes_look as _])].concat();
        for learner in &self.learners {
            for (path, what) in [("zero/truth/links", &links), ("zero/truth/axes", &axes)] {
                let (entity, what) = (learner.entity(path), what.clone());
                match step {
                    Some(step) => self.rows.plain(step, &entity, what),
                    None => self.rows.always_plain(&entity, what),
                }
            }
        }
    }

    /// Logs what depends on the size of the arm: places, bodies, the truth's arrows and the cameras.
    fn arrange(&mut self, first: &StepReport) -> Result<Stage, RecordingError> {
        let first_estimate = first.learners.first().map(|learner| &learner.estimate);
        let believed = || first_estimate.and_then(ModelReport::state);
        let arm = self.truth.clone().or_else(believed);
        let stands = first_estimate.and_then(ModelReport::base_frame).unwrap_or_default();
        let has_base = self.links.as_ref().is_some_and(Links::has_base);
        let below = self.appearance.described.as_ref().map(|_| (&stands, has_base));
        let figure = arm.as_ref().map(|arm| Figure::of(&self.description, arm, below)).unwrap_or_default();
        let room = arm.map_or_else(|| Room::around(&figure), |arm| Room::of(&arm, &figure, &self.description));
        // Where nobody knows where the hand is on its link, it is drawn where it is believed to be, and found farther out.
        let spread = first_estimate.filter(|_| self.truth.is_none()).and_then(|estimate| estimate.marker_covariance_m2);
        let spread_m = spread.map_or(0.0, |covariance| (0..3).map(|k| covariance[k][k]).sum::<f64>().sqrt());
        let room = room.with_hand(spread_m.min(FARTHER * figure.reach_m));
        let obstacles = Obstacles::of(&self.appearance, &figure, &stands);
        let apart_m = obstacles.apart_m(&stands, &Stage::way());
        let stage = Stage::new(figure, room, self.learners.len()).with_spacing(apart_m);
        let base = Some(stands).filter(|_| self.description.base_learned);
        let cameras = first_estimate.map(|estimate| carried(&self.description, estimate)).unwrap_or_default();
        for learner in &mut self.learners {
            learner.begin(&mut self.rows, &stage, &self.description, (base, &cameras));
            learner.log_obstacles(&mut self.rows, &obstacles, &stands);
            if let Some(links) = &self.links {
                log_meshes(&mut self.rows, &learner.entity("arm/estimate"), links, learner.arm_look());
                if self.truth.is_some() {
                    log_meshes(&mut self.rows, &learner.entity("arm/truth"), links, TRUE_ARM);
                }
            }
        }
        for (path, colour) in GROUNDS.into_iter().zip([Theme::Light, Theme::Dark].map(Theme::lines)) {
            self.rows.always(&EntityPath::from(path), &[&stage.ground(colour)]);
        }
        self.rows.always(&EntityPath::from("key"), &[&key(&self.description, self.enlarged, stage.key())]);
        if let Some(truth) = self.description.truth.clone() {
            // What is static cannot change later.
            let step = self.description.change_at.map(|_| first.step);
            self.log_truth(step, &truth, ARROW * stage.figure.reach_m);
        }
        let arranger = Arranger {
            description: self.description.clone(),
            roots: self.learners.iter().map(|learner| learner.root.clone()).collect(),
            stage: stage.clone(),
            cameras,
            recording: self.store.clone(),
            arranged: AtomicU64::new(0),
        };
        let whole = arranger.whole()?;
        // To both targets, whatever happens to the other.
        let live = self.live.as_ref().map_or(Ok(()), |live| live.append_arrangement(&whole, arranger));
        let file = self.file.as_mut().map_or(Ok(()), |file| file.append(&whole));
        self.settle(file).and(live)?;
        Ok(stage)
    }
}

fn messages(store: &StoreId, chunks: &[Chunk]) -> Result<Vec<LogMsg>, RecordingError> {
    chunks.iter().map(|chunk| message::data(store, chunk)).collect()
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Err(error) = self.end() {
            tracing::error!("{error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use body_schema_scenario::builtin;
    use bytes::Bytes;

    use super::*;
    use crate::{decoded, live::encode};

    /// All messages of a stream but for the series of times, which no two runs share.
    fn timeless(stream: Vec<u8>) -> Vec<Bytes> {
        let messages = decoded::messages(Cursor::new(stream)).map(|message| message.expect("a message"));
        let said = messages.filter_map(|message| match message {
            LogMsg::ArrowMsg(store, message) => {
                let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
                let is_time = chunk.entity_path().to_string().ends_with("selection_ms");
                (!is_time).then_some(LogMsg::ArrowMsg(store, message))
            }
            other => Some(other),
        });
        said.map(|message| encode(&message).expect("encoded")).collect()
    }

    /// A run recorded for those who follow it: what is written live, and the file that is put together of it. Someone follows it only
    /// if `followed`, and it is flushed after every so many steps.
    fn recorded(name: &str, steps: u64, every: u64, followed: bool) -> [Vec<Bytes>; 2] {
        let mut experiment = builtin(name).expect("a scenario").experiment(4711, None).expect("an experiment");
        let live = LiveLog::new();
        let follower = followed.then(|| live.subscribe());
        let target = Target::live(live.clone()).with_recording_id("the same");
        let mut recorder = Recorder::new(&Description::of(&experiment), target).expect("begun");
        recorder.log(&StepReport::of(&experiment)).expect("recorded");
        for step in 1..=steps {
            experiment.step().expect("a step");
            // However slow the machine is, it is written when the test says so.
            recorder.flushed = Instant::now();
            recorder.log_moving(&StepReport::of(&experiment), 3).expect("recorded");
            if step % every == 0 {
                recorder.flush_shown().expect("flushed");
            }
        }
        recorder.seal().expect("sealed");
        drop(follower);
        [live.parts_from(0).concat(), live.complete().expect("put together")].map(timeless)
    }

    #[test]
    fn a_run_has_the_same_recording_whenever_and_however_it_is_written() {
        for (name, steps) in [("arm-6dof", 12), ("head-fov", 5), ("arm-6dof-camera", 4)] {
            let [live, file] = recorded(name, steps, 1, true);
            assert!(recorded(name, steps, 1, true) == [live, file.clone()], "{name}");
            assert!(recorded(name, steps, 4, false)[1] == file, "{name}, flushed at other times");
        }
    }
}
