//! One run in files.
//!
//! | file | what it holds |
//! |---|---|
//! | `description.json` | what stays the same from step to step |
//! | `reports.ndjson.gz` | one report a line, from step 0 |
//! | `scene.rrd` | the recording as the page's viewer takes it: a header of 12 bytes, then messages |
//! | `blueprint-{light,dark}-ASPECT.rbl` | arrangements of its views, in the same form |
//! | `selections/LEARNER/STEP.json.gz` | how each movement was chosen, where a search was made |
//! | `recording.rrd`, `steps.csv`, `result.json` | to take away |

use std::{collections::BTreeSet, io::Write, path::Path};

use flate2::{Compression, write::GzEncoder};
use serde::{Deserialize, Serialize};

use super::{ExportError, Plan, error::Doing, write, write_json};
use body_schema_ask_tell::Session;
use body_schema_experiment::Experiment;
use body_schema_recording::{Appearance, LiveLog, Recorder, StepsCsv, Target, Theme};
use body_schema_wire::{Choice, Description, RunResult, StepReport};

/// The number of postures on the way from each step to the next, in which the page moves while it plays slowly.
const FRAMES: u64 = 6;
/// The aspect ratios (width in heights) for which views are arranged: a page takes the widest that is not wider than its
/// own, so that no arm is cut off.
const ASPECTS: [f64; 11] = [0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0, 2.4, 2.8];

/// The facts about a run that the page needs before it opens it.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Recorded {
    /// The id of its recording.
    recording: String,
    /// The aspect ratios for which its view is arranged, in order.
    aspects: Vec<f64>,
    /// The learners whose choices are explained.
    searched: BTreeSet<String>,
}

/// Runs a plan with a seed and writes its files.
pub(super) fn record(
    plan: &Plan<'_>,
    seed: u64,
    folder: &Path,
    tick: &(dyn Fn() + Sync),
) -> Result<Recorded, ExportError> {
    let scenario = plan.scenario;
    let mut experiment = match plan.told {
        Some(session) => session.experiment().clone(),
        None => scenario.experiment(seed, Some(&plan.learners))?,
    };
    let told = plan.told.map(Session::history).unwrap_or_default();
    let live = LiveLog::new();
    let description = Description::of(&experiment);
    let mut recorder =
        Recorder::new(&description, Target::live(live.clone()).with_appearance(Appearance::of(scenario)))?;
    let mut table = Vec::new();
    let mut csv = StepsCsv::new(&description, &mut table)?;
    let (mut reports, mut searched) = (Vec::new(), BTreeSet::new());
    for step in 0..=plan.steps {
        if step > 0 {
            if plan.told.is_none() {
                let failed = |source| ExportError::Run { scenario: scenario.name.clone(), seed, source };
                experiment.step().map_err(failed)?;
                searched.extend(write_selections(&experiment, &plan.learners, folder)?);
            }
            tick();
        }
        let report = told.get(step as usize).cloned().unwrap_or_else(|| StepReport::of(&experiment));
        recorder.log_moving(&report, FRAMES)?;
        csv.write(&report)?;
        serde_json::to_writer(&mut reports, &report)?;
        reports.push(b'\n');
    }
    csv.flush()?;
    drop(csv);
    let recording = recorder.recording_id().to_owned();
    recorder.finish()?;

    write_json(&folder.join("description.json"), &description)?;
    write_packed(&folder.join("reports.ndjson.gz"), &reports)?;
    let messages = live.put_together(&live.scene_parts_from(1))?;
    write(&folder.join("scene.rrd"), &[vec![live.header()], messages].concat().concat())?;
    for (theme, name) in [(Theme::Light, "light"), (Theme::Dark, "dark")] {
        for aspect in ASPECTS {
            // There is one from step 0 on.
            let arrangement = live.blueprint(theme, aspect)?.unwrap_or_default();
            write(&folder.join(format!("blueprint-{name}-{aspect}.rbl")), &arrangement)?;
        }
    }
    write(&folder.join("recording.rrd"), &live.complete()?)?;
    write(&folder.join("steps.csv"), &table)?;
    write_json(&folder.join("result.json"), &RunResult::of(&experiment))?;
    Ok(Recorded { recording, aspects: ASPECTS.into(), searched })
}

/// Writes how the last movements were chosen, and returns the learners for which that is known.
fn write_selections(experiment: &Experiment, learners: &[String], folder: &Path) -> Result<Vec<String>, ExportError> {
    let mut searched = Vec::new();
    for learner in learners {
        if let Ok(choice) = Choice::of(experiment, learner) {
            let name = learner.replace(':', "-");
            let file = format!("selections/{name}/{}.json.gz", choice.step);
            write_packed(&folder.join(file), &serde_json::to_vec(&choice)?)?;
            searched.push(learner.clone());
        }
    }
    Ok(searched)
}

/// Writes a compressed file; the page unpacks it, whatever headers the host sends.
fn write_packed(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish());
    write(path, &packed.doing("compress", path)?)
}
