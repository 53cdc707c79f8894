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

use super::{Kept, NewSession, Shared};
use crate::server::problem::{Kind, Problem};
use body_schema_backend::{EvaluationRequest, Scenarios, Steps};
use body_schema_recording::{RecordingError, Target};
use body_schema_wire::{AppraisalReport, Choice, Description, RunResult};

/// How often the results of a long command are published.
const PUBLISH_EVERY: Duration = Duration::from_millis(200);
/// How long nothing must have been asked before the hidden entities are written: while steps are made one by one, every
/// message counts.
pub(super) const COMPLETE_AFTER: Duration = Duration::from_millis(500);

/// The parts of which a session is made.
pub(super) struct Setup {
    /// The session's id, and also the recording's, so that viewers distinguish two sessions of one seed.
    pub(super) id: Uuid,
    pub(super) new: NewSession,
    pub(super) scenarios: Arc<Scenarios>,
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
        asked: EvaluationRequest,
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
    let Setup { id, new, scenarios, file, most_steps, shared, permit } = setup;
    let open = || -> Result<(Steps, Kept), Problem> {
        let target = Target::live(shared.live.clone()).with_recording_id(id.to_string());
        let target = file.iter().fold(target, |target, file| target.and_file(file));
        let scenario = scenarios.find(&new.scenario)?;
        Ok(Steps::open(&scenario, &new, target, most_steps)?)
    };
    match catch_unwind(AssertUnwindSafe(open)).unwrap_or_else(|panic| Err(panicked(&*panic))) {
        Ok((mut steps, start)) => {
            shared.publish(vec![start], steps.remaining());
            if opened.send(Ok(steps.description().clone())).is_ok() {
                let waiting = VecDeque::new();
                let mut engine = Engine { steps: &mut steps, shared: &shared, commands: &commands, waiting };
                let outcome = catch_unwind(AssertUnwindSafe(|| engine.serve()));
                if let Err(panic) = outcome {
                    shared.fail(panicked(&*panic).into_detail());
                }
            }
            // A file that cannot be completed is told of when the server ends.
            if let Ok(finished) = catch_unwind(AssertUnwindSafe(|| steps.into_recorder().finish())) {
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
    steps: &'a mut Steps,
    shared: &'a Shared,
    commands: &'a mpsc::Receiver<Command>,
    /// Commands that came while steps were made, and wait for their turn.
    waiting: VecDeque<Command>,
}

impl Engine<'_> {
    /// Takes commands until told to stop or until nobody can send any more.
    fn serve(&mut self) {
        loop {
            let command = self.waiting.pop_front().map_or_else(|| self.commands.recv_timeout(COMPLETE_AFTER), Ok);
            let command = command.or_else(|_| {
                // Whoever asks for the recording is told if it cannot be written.
                drop(self.flush());
                self.commands.recv()
            });
            if self.shared.stop.is_cancelled() {
                return;
            }
            match command {
                Err(mpsc::RecvError) => return,
                Ok(Command::End { reply }) => {
                    let sealed = self.steps.recorder().seal().map_err(|error| self.unsealed(&error));
                    let is_sealed = sealed.is_ok();
                    drop(reply.send(sealed));
                    if is_sealed {
                        return;
                    }
                }
                Ok(command) => self.obey(command),
            }
        }
    }

    fn obey(&mut self, command: Command) {
        // Nobody may wait for an answer any longer; what was done stands all the same.
        match command {
            Command::Step { count, expected, frames, mut reply } => {
                let outcome = self.make((count, frames), expected, &mut reply);
                drop(reply.send(outcome));
            }
            Command::Result { reply } => drop(reply.send(Ok(self.steps.result()))),
            Command::Choice { learner, reply } => {
                drop(reply.send(self.steps.choice(&learner).map_err(Problem::from)));
            }
            Command::Appraise { learner, asked, reply } => drop(reply.send(self.appraise(&learner, &asked))),
            Command::SetConfiguration { learner, configuration, reply } => {
                drop(reply.send(self.set_configuration(&learner, &configuration)));
            }
            Command::Configuration { learner, reply } => {
                drop(reply.send(self.steps.configuration(&learner).map_err(Problem::from)));
            }
            // Whoever asks for the recording is told if it cannot be written.
            Command::Show => drop(self.publish(&mut Batch::default())),
            Command::Flush { reply } => drop(reply.send(self.flush())),
            Command::End { .. } | Command::Wake => {}
            #[cfg(test)]
            Command::Panic => panic!("as the test asked"),
        }
    }

    /// Tells what another movement would have taught, and shows the posture if that is asked for.
    fn appraise(&mut self, learner: &str, asked: &EvaluationRequest) -> Result<AppraisalReport, Problem> {
        if !asked.show {
            return Ok(self.steps.appraise(learner, asked)?);
        }
        self.tried_out(|steps| steps.appraise(learner, asked))
    }

    /// Sets a person's next movement, and shows the posture.
    fn set_configuration(&mut self, learner: &str, configuration: &[f64]) -> Result<AppraisalReport, Problem> {
        self.tried_out(|steps| steps.set_configuration(learner, configuration))
    }

    /// What a posture is expected to teach, which is shown.
    fn tried_out(
        &mut self,
        appraise: impl FnOnce(&mut Steps) -> Result<AppraisalReport, body_schema_backend::Problem>,
    ) -> Result<AppraisalReport, Problem> {
        // Every posture that is tried out takes memory.
        self.shared.budget.check()?;
        let appraisal = appraise(self.steps)?;
        self.shared.publish(Vec::new(), self.steps.remaining());
        Ok(appraisal)
    }

    /// The problem that the session goes on although it should have ended.
    fn unsealed(&self, error: &RecordingError) -> Problem {
        self.shared.interrupted.store(false, Ordering::Relaxed);
        self.shared.note_recording(Some(error.to_string()));
        let detail = format!("{error}. The session is still there, with its whole recording: end it again then");
        Problem::new(Kind::Storage, detail).step(self.steps.step())
    }

    fn flush(&mut self) -> Result<(), Problem> {
        let flushed = self.steps.recorder().flush().map_err(recording_failed);
        self.shared.note_recording(self.steps.recorder().file_failure().map(str::to_owned));
        self.shared.publish(Vec::new(), self.steps.remaining());
        flushed
    }

    fn make(
        &mut self,
        (count, frames): (u64, u64),
        expected: Option<u64>,
        reply: &mut Reply<Vec<Kept>>,
    ) -> Result<Vec<Kept>, Problem> {
        self.steps.may_make(count, expected)?;
        self.shared.budget.check().map_err(|problem| problem.step(self.steps.step()))?;
        let mut batch = Batch::default();
        let mut outcome = Ok(());
        while outcome.is_ok() && (batch.made.len() as u64) < count {
            // A request that its client has given up, or a session that is to end, stops between two steps.
            let is_deleted = self.shared.interrupted.load(Ordering::Relaxed);
            if is_deleted || self.shared.stop.is_cancelled() || reply.is_closed() {
                let kind = if is_deleted { Kind::Ending } else { Kind::ShuttingDown };
                let detail = format!("the session is ending; {} of {count} steps were made", batch.made.len());
                outcome = Err(Problem::new(kind, detail));
                break;
            }
            self.complete_for_those_who_ask();
            outcome = self.step(frames, &mut batch);
            if outcome.is_ok() && batch.last.elapsed() >= PUBLISH_EVERY {
                outcome = self.publish(&mut batch);
            }
        }
        let published = self.publish(&mut batch);
        outcome.and(published).map(|()| batch.made).map_err(|problem| problem.step(self.steps.step()))
    }

    /// Whoever wants the recording so far need not wait for the steps to come.
    fn complete_for_those_who_ask(&mut self) {
        while let Ok(command) = self.commands.try_recv() {
            match command {
                Command::Flush { reply } => drop(reply.send(self.flush())),
                command => self.waiting.push_back(command),
            }
        }
    }

    fn step(&mut self, frames: u64, batch: &mut Batch) -> Result<(), Problem> {
        let (kept, recorded) = self.steps.make(frames)?;
        self.shared.metrics.steps.inc();
        batch.made.push(kept);
        Ok(recorded?)
    }

    fn publish(&mut self, batch: &mut Batch) -> Result<(), Problem> {
        // Steps that nobody watches are written in large chunks, with the next 256 of them or as soon as there is time.
        let flushed = if self.shared.live.may_wait() { Ok(()) } else { self.steps.recorder().flush_shown() };
        let flushed = flushed.map_err(recording_failed);
        self.shared.note_recording(self.steps.recorder().file_failure().map(str::to_owned));
        self.shared.publish(batch.made[batch.published..].to_vec(), self.steps.remaining());
        (batch.published, batch.last) = (batch.made.len(), Instant::now());
        flushed
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
    body_schema_backend::recording_failed(error).into()
}

pub(super) fn panicked(panic: &(dyn std::any::Any + Send)) -> Problem {
    let said = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    Problem::new(Kind::EngineFailed, format!("the engine panicked: {}", said.unwrap_or("no message")))
}
