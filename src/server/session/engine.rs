//! A session's engine: one thread that owns the experiment and its recording, and takes one command at a time.
//!
//! Steps take milliseconds of computing each, so they have no place on the runtime's workers. What the thread makes
//! goes to [`Shared`], in the order recording, then reports: whoever sees a report finds its recording already there.

use std::{
    collections::VecDeque,
    panic::{AssertUnwindSafe, catch_unwind},
    path::PathBuf,
    sync::{Arc, atomic::Ordering, mpsc},
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, oneshot};
use uuid::Uuid;

use super::{Kept, Shared};
use crate::server::problem::{Kind, Problem};
use body_schema_experiment::{AppraisalReport, Choice, Description, Experiment, RunResult};
use body_schema_recording::{EllipsoidSize, Recorder, RecordingError, Target};
use body_schema_scenario::builtin;

/// How often the results of a long command are published.
const PUBLISH_EVERY: Duration = Duration::from_millis(200);
/// How long nothing must have been asked before the hidden entities are written: while steps are made one by one, every
/// message counts.
pub(super) const COMPLETE_AFTER: Duration = Duration::from_millis(500);

/// The parts of which a session is made.
pub(super) struct Setup {
    /// The session's id, and also the recording's, so that viewers distinguish two sessions of one seed.
    pub(super) id: Uuid,
    pub(super) scenario: String,
    pub(super) seed: u64,
    pub(super) learners: Option<Vec<String>>,
    pub(super) ellipsoids: EllipsoidSize,
    /// The recording's file, if one is kept.
    pub(super) file: Option<PathBuf>,
    /// The most steps that it makes.
    pub(super) most_steps: u64,
    pub(super) shared: Arc<Shared>,
    /// A permit held until the thread ends, so that ending sessions still count.
    pub(super) permit: OwnedSemaphorePermit,
}

/// A request to the engine. A dropped `reply` means that the engine is gone; a dropped receiver means that nobody waits
/// for the answer any longer.
pub(super) enum Command {
    Step {
        count: u64,
        expected: Option<u64>,
        /// The number of postures drawn on the way to each step.
        frames: u64,
        reply: Reply<Vec<Kept>>,
    },
    Result {
        reply: Reply<RunResult>,
    },
    /// Asks how a learner's last movement was chosen.
    Choice {
        learner: String,
        reply: Reply<Choice>,
    },
    /// Asks what another movement would have taught a learner.
    Appraise {
        learner: String,
        configuration: Vec<f64>,
        reply: Reply<AppraisalReport>,
    },
    /// Sets the next movement of a learner for which a person chooses, and asks what it is expected to teach.
    SetConfiguration {
        learner: String,
        configuration: Vec<f64>,
        reply: Reply<AppraisalReport>,
    },
    /// Asks for the movement that was set for the next step.
    Configuration {
        learner: String,
        reply: Reply<Option<Vec<f64>>>,
    },
    /// Brings the recording up to date for a new follower.
    Show,
    /// Completes the recording so far.
    Flush {
        reply: Reply<()>,
    },
    /// Completes the recording's file and ends the engine, or returns why it cannot, and goes on.
    End {
        reply: Reply<()>,
    },
    /// Makes the engine check whether it should end.
    Wake,
    #[cfg(test)]
    Panic,
}

pub(super) type Reply<T> = oneshot::Sender<Result<T, Problem>>;

/// The body of the thread. `opened` receives the description once the session exists.
pub(super) fn run(setup: Setup, commands: mpsc::Receiver<Command>, opened: Reply<Description>) {
    let Setup { id, scenario, seed, learners, ellipsoids, file, most_steps, shared, permit } = setup;
    let open = || -> Result<(Experiment, Recorder, Kept), Problem> {
        let experiment = builtin(&scenario)?.experiment(seed, learners.as_deref())?;
        let target = Target::live(shared.live.clone()).with_recording_id(id.to_string()).with_ellipsoids(ellipsoids);
        let target = file.iter().fold(target, |target, file| target.and_file(file));
        let unbegun = |error| Problem::new(Kind::Internal, format!("the recording cannot be begun: {error}"));
        let mut recorder = Recorder::new(experiment.description(), target).map_err(unbegun)?;
        let recorded = recorder.log(experiment.latest()).and_then(|()| recorder.flush()).map_err(unbegun);
        match recorded.and_then(|()| Kept::of(experiment.latest(), experiment.description())) {
            Ok(start) => Ok((experiment, recorder, start)),
            Err(problem) => {
                recorder.discard();
                Err(problem)
            }
        }
    };
    match catch_unwind(AssertUnwindSafe(open)).unwrap_or_else(|panic| Err(panicked(&*panic))) {
        Ok((experiment, mut recorder, start)) => {
            shared.publish(vec![start], experiment.remaining());
            if opened.send(Ok(experiment.description().clone())).is_ok() {
                let waiting = VecDeque::new();
                let mut engine = Engine { experiment, most_steps, shared: &shared, commands: &commands, waiting };
                let outcome = catch_unwind(AssertUnwindSafe(|| engine.serve(&mut recorder)));
                if let Err(panic) = outcome {
                    shared.fail(panicked(&*panic).detail.into());
                }
            }
            // A file that cannot be completed is told of when the server ends.
            if let Ok(finished) = catch_unwind(AssertUnwindSafe(|| recorder.finish())) {
                shared.note_recording(finished.err().map(|error| error.to_string()));
            }
        }
        Err(problem) => drop(opened.send(Err(problem))),
    }
    shared.live.close();
    // Before anybody hears of the end: whoever deletes a session may open another at once.
    drop(permit);
    shared.ended.cancel();
}

struct Engine<'a> {
    experiment: Experiment,
    most_steps: u64,
    shared: &'a Shared,
    commands: &'a mpsc::Receiver<Command>,
    /// Commands that came while steps were made, and wait for their turn.
    waiting: VecDeque<Command>,
}

impl Engine<'_> {
    /// Takes commands until told to stop or until nobody can send any more.
    fn serve(&mut self, recorder: &mut Recorder) {
        loop {
            let command = self.waiting.pop_front().map_or_else(|| self.commands.recv_timeout(COMPLETE_AFTER), Ok);
            let command = command.or_else(|_| {
                // Whoever asks for the recording is told if it cannot be written.
                drop(self.flush(recorder));
                self.commands.recv()
            });
            if self.shared.stop.is_cancelled() {
                return;
            }
            match command {
                Err(mpsc::RecvError) => return,
                Ok(Command::End { reply }) => {
                    let sealed = recorder.seal().map_err(|error| self.unsealed(&error));
                    let is_sealed = sealed.is_ok();
                    drop(reply.send(sealed));
                    if is_sealed {
                        return;
                    }
                }
                Ok(command) => self.obey(command, recorder),
            }
        }
    }

    fn obey(&mut self, command: Command, recorder: &mut Recorder) {
        // Nobody may wait for an answer any longer; what was done stands all the same.
        match command {
            Command::Step { count, expected, frames, mut reply } => {
                let outcome = self.steps((count, frames), expected, recorder, &mut reply);
                drop(reply.send(outcome));
            }
            Command::Result { reply } => drop(reply.send(Ok(self.experiment.result()))),
            Command::Choice { learner, reply } => {
                drop(reply.send(self.experiment.choice(&learner).map_err(Problem::from)));
            }
            Command::Appraise { learner, configuration, reply } => {
                drop(reply.send(self.experiment.appraise(&learner, &configuration).map_err(Problem::from)));
            }
            Command::SetConfiguration { learner, configuration, reply } => {
                drop(reply.send(self.set_configuration(&learner, &configuration, recorder)));
            }
            Command::Configuration { learner, reply } => {
                let configuration = self.experiment.configuration(&learner).map_err(Problem::from);
                drop(reply.send(configuration.map(|set| set.map(<[f64]>::to_vec))));
            }
            // Whoever asks for the recording is told if it cannot be written.
            Command::Show => drop(self.publish(&mut Batch::default(), recorder)),
            Command::Flush { reply } => drop(reply.send(self.flush(recorder))),
            Command::End { .. } | Command::Wake => {}
            #[cfg(test)]
            Command::Panic => panic!("as the test asked"),
        }
    }

    /// Sets a person's next movement, and shows the posture.
    fn set_configuration(
        &mut self,
        learner: &str,
        configuration: &[f64],
        recorder: &mut Recorder,
    ) -> Result<AppraisalReport, Problem> {
        // Every posture that is tried out takes memory.
        self.shared.budget.check()?;
        let appraisal = self.experiment.set_configuration(learner, configuration)?;
        let learners = &self.experiment.description().learners;
        if let Some(index) = learners.iter().position(|described| described.name == learner) {
            let (step, skeleton_m) = (self.experiment.latest().step, &appraisal.estimated_skeleton_m);
            recorder.log_ghost(step, index, Some(skeleton_m)).map_err(recording_failed)?;
            self.shared.publish(Vec::new(), self.experiment.remaining());
        }
        Ok(appraisal)
    }

    /// The problem that the session goes on although it should have ended.
    fn unsealed(&self, error: &RecordingError) -> Problem {
        self.shared.interrupted.store(false, Ordering::Relaxed);
        self.shared.note_recording(Some(error.to_string()));
        let detail = format!("{error}. The session is still there, with its whole recording: end it again then");
        Problem::new(Kind::Storage, detail).step(self.experiment.latest().step)
    }

    fn flush(&self, recorder: &mut Recorder) -> Result<(), Problem> {
        let flushed = recorder.flush().map_err(recording_failed);
        self.shared.note_recording(recorder.file_failure().map(str::to_owned));
        self.shared.publish(Vec::new(), self.experiment.remaining());
        flushed
    }

    fn steps(
        &mut self,
        (count, frames): (u64, u64),
        expected: Option<u64>,
        recorder: &mut Recorder,
        reply: &mut Reply<Vec<Kept>>,
    ) -> Result<Vec<Kept>, Problem> {
        let step = self.experiment.latest().step;
        if let Some(expected) = expected.filter(|expected| *expected != step) {
            let detail = format!("the session is at step {step}, not {expected}; nothing was stepped");
            return Err(Problem::new(Kind::StepMismatch, detail).field("expected_step").step(step));
        }
        if let Some(problem) = self.too_many(count, step).or_else(|| self.waits_for_a_person(count)) {
            return Err(problem.step(step));
        }
        let mut batch = Batch::default();
        let mut outcome = Ok(());
        while outcome.is_ok() && (batch.made.len() as u64) < count {
            // A request that its client has given up, or a session that is to end, stops between two steps.
            let is_to_end = self.shared.stop.is_cancelled() || self.shared.interrupted.load(Ordering::Relaxed);
            if is_to_end || reply.is_closed() {
                let detail = format!("the session is ending; {} of {count} steps were made", batch.made.len());
                outcome = Err(Problem::new(Kind::ShuttingDown, detail));
                break;
            }
            self.complete_for_those_who_ask(recorder);
            outcome = self.step(frames, &mut batch, recorder);
            if outcome.is_ok() && batch.last.elapsed() >= PUBLISH_EVERY {
                outcome = self.publish(&mut batch, recorder);
            }
        }
        let published = self.publish(&mut batch, recorder);
        outcome.and(published).map(|()| batch.made).map_err(|problem| problem.step(self.experiment.latest().step))
    }

    /// Completes the recording for requests that wait for it, without waiting for further steps.
    fn complete_for_those_who_ask(&mut self, recorder: &mut Recorder) {
        while let Ok(command) = self.commands.try_recv() {
            match command {
                Command::Flush { reply } => drop(reply.send(self.flush(recorder))),
                command => self.waiting.push_back(command),
            }
        }
    }

    fn step(&mut self, frames: u64, batch: &mut Batch, recorder: &mut Recorder) -> Result<(), Problem> {
        self.experiment.step().map_err(|error| Problem::new(Kind::EngineFailed, error.to_string()))?;
        self.shared.metrics.steps.inc();
        let report = self.experiment.latest();
        // The step stands even if it cannot be recorded.
        batch.made.push(Kept::of(report, self.experiment.description())?);
        recorder.log_moving(report, frames).map_err(recording_failed)
    }

    fn publish(&self, batch: &mut Batch, recorder: &mut Recorder) -> Result<(), Problem> {
        // Steps that nobody watches are written in large chunks, with the next 256 of them or as soon as there is time.
        let flushed = if self.shared.live.may_wait() { Ok(()) } else { recorder.flush_shown() };
        let flushed = flushed.map_err(recording_failed);
        self.shared.note_recording(recorder.file_failure().map(str::to_owned));
        self.shared.publish(batch.made[batch.published..].to_vec(), self.experiment.remaining());
        (batch.published, batch.last) = (batch.made.len(), Instant::now());
        flushed
    }

    /// The problem of a learner for which a person must choose first: checked before any step, so that a request makes
    /// all steps or none.
    fn waits_for_a_person(&self, count: u64) -> Option<Problem> {
        let mut chosen_for = self.experiment.chosen_for();
        if count > 1 {
            let (_, name) = chosen_for.next()?;
            let detail = format!("a person chooses each movement of `{name}`: make one step at a time, not {count}");
            return Some(Problem::new(Kind::InvalidValue, detail).field("count"));
        }
        let unset = |name: &&str| matches!(self.experiment.configuration(name), Ok(None));
        let name = chosen_for.map(|(_, name)| name).find(unset)?;
        let detail = format!(
            "`{name}` waits for a person to choose its movement; post {{\"configuration\": […]}}, one position per joint \
             in rad or m, to /v1/sessions/{{id}}/learners/{name}/configuration, then step"
        );
        Some(Problem::new(Kind::NoConfiguration, detail))
    }

    fn too_many(&self, count: u64, step: u64) -> Option<Problem> {
        let few =
            |left: u64, detail: String| Problem::new(Kind::TooFewStepsLeft, detail).field("count").remaining(left);
        if let Some(left) = self.experiment.remaining().map(|left| left as u64).filter(|left| count > *left) {
            return Some(few(left, format!("the recorded data have {left} steps left, {count} were asked for")));
        }
        let left = self.most_steps.saturating_sub(step);
        if count > left {
            let most = self.most_steps;
            let detail = format!("a session makes at most {most} steps: {left} are left, not {count}");
            return Some(few(left, detail));
        }
        self.shared.budget.check().err()
    }
}

/// The steps of one command.
struct Batch {
    made: Vec<Kept>,
    published: usize,
    last: Instant,
}

impl Default for Batch {
    fn default() -> Self {
        Self { made: Vec::new(), published: 0, last: Instant::now() }
    }
}

pub(super) fn recording_failed(error: impl std::fmt::Display) -> Problem {
    Problem::new(Kind::Internal, format!("the recording cannot be written: {error}"))
}

pub(super) fn panicked(panic: &(dyn std::any::Any + Send)) -> Problem {
    let said = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    Problem::new(Kind::EngineFailed, format!("the engine panicked: {}", said.unwrap_or("no message")))
}
