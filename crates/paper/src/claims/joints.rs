//! Which joints are learned first, and which are hardest.

use super::{
    Claim, Test,
    evidence::{Evidence, Finding, percent, short},
};
use crate::{outcome::LearnedJoint, report::Agreement};
use body_schema_wire::{Curve, Quantiles};

pub const CLAIMS: &[Claim] = &[
    Claim {
        id: "fig-5-wrist",
        figure: "Fig. 5",
        what: "wrist joints, 12 joints",
        paper: "the wrist joints are the hardest",
        paper_value: None,
        unit: "times the other joints' error, active",
        test: Test::By("fig-5", wrist_is_hardest),
    },
    Claim {
        id: "fig-5-locations-first",
        figure: "Fig. 5",
        what: "order of learning, 12 joints",
        paper: "locations are learned before orientations",
        paper_value: None,
        unit: "movements between, active",
        test: Test::By("fig-5", locations_first),
    },
    Claim {
        id: "gradient-links",
        figure: "Fig. 4",
        what: "gradient: which joints it corrects, 6 joints",
        paper: "mainly the first and the last link",
        paper_value: None,
        unit: "% corrected, first and last joint less the others",
        test: Test::By("fig-4", gradient_corrects_the_ends),
    },
    Claim {
        id: "wrist-signal-to-noise",
        figure: "text",
        what: "the wrist's signal-to-noise ratio, 12 joints",
        paper: "near 1",
        paper_value: Some(1.0),
        unit: "ratio",
        test: Test::By("fig-5", wrist_signal),
    },
];

/// The error of each joint in one number: orientation and location, each in units of its threshold, added.
fn errors(evidence: &Evidence<'_>, point: &Curve) -> Option<Vec<(String, f64)>> {
    let thresholds = evidence.scenario.thresholds;
    let error = |joint: &LearnedJoint| {
        let metrics = point.joints.get(joint.index)?;
        let sum = metrics.axis_deg? / thresholds.orientation_deg + metrics.location_m? / thresholds.location_m;
        Some((joint.name.clone(), sum))
    };
    evidence.outcome.joints().iter().map(error).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn wrist_is_hardest(evidence: &Evidence<'_>) -> Option<Finding> {
    let compare = |learner: &str| -> Option<(f64, String)> {
        let mut joints = errors(evidence, evidence.end(learner)?)?;
        let is_wrist = |name: &str| name.contains("wrist");
        let part =
            |wrist: bool| mean(joints.iter().filter(|(name, _)| is_wrist(name) == wrist).map(|(_, error)| *error));
        let ratio = part(true)? / part(false)?;
        joints.sort_by(|a, b| b.1.total_cmp(&a.1));
        Some((ratio, joints.into_iter().take(3).map(|(name, _)| name).collect::<Vec<_>>().join(", ")))
    };
    let ((active, hardest), (random, random_hardest)) = (compare("active")?, compare("random")?);
    Some(Finding {
        ours: Some(active),
        text: format!(
            "wrist {} times the other joints' mean error for active, {} for random; hardest for active: {hardest}; for \
             random: {random_hardest}",
            short(active),
            short(random)
        ),
        agrees: Agreement::of_two(active >= 1.25, random >= 1.25),
        why: format!(
            "hardest: at least 1.25 times the others' median error after {} movements, orientation and location each in \
             units of its threshold, added; it must hold for active and for random",
            evidence.steps
        ),
    })
}

fn locations_first(evidence: &Evidence<'_>) -> Option<Finding> {
    const LEFT: f64 = 0.25;
    let when = |learner: &str, error: fn(&Curve) -> Option<Quantiles>| -> Option<u64> {
        let start = error(evidence.learner(learner)?.curve.first()?)?.median;
        evidence.falls_below(learner, error, LEFT * start)
    };
    let both = |learner: &str| -> Option<(Option<u64>, Option<u64>)> {
        evidence.learner(learner)?;
        Some((when(learner, |point| point.location_m), when(learner, |point| point.orientation_deg)))
    };
    let earlier = |(location, orientation): (Option<u64>, Option<u64>)| match (location, orientation) {
        (Some(location), Some(orientation)) => location < orientation,
        (location, _) => location.is_some(),
    };
    let (active, random) = (both("active")?, both("random")?);
    let words = |(location, orientation): (Option<u64>, Option<u64>)| {
        let word = |at: Option<u64>| at.map_or_else(|| "never".to_owned(), |at| at.to_string());
        format!("locations at {}, orientations at {}", word(location), word(orientation))
    };
    Some(Finding {
        ours: active.0.zip(active.1).map(|(location, orientation)| orientation as f64 - location as f64),
        text: format!("active: {}; random: {}", words(active), words(random)),
        agrees: Agreement::of_two(earlier(active), earlier(random)),
        why: format!(
            "learned: the median error stays below {} of its start; it must hold for active and for random",
            percent(LEFT)
        ),
    })
}

fn gradient_corrects_the_ends(evidence: &Evidence<'_>) -> Option<Finding> {
    let start = errors(evidence, evidence.learner("gradient")?.curve.first()?)?;
    let end = errors(evidence, evidence.end("gradient")?)?;
    let corrected: Vec<f64> = start.iter().zip(&end).map(|((_, start), (_, end))| 1.0 - end / start).collect();
    let [first, middle @ .., last] = corrected.as_slice() else { return None };
    let middle_mean = mean(middle.iter().copied())?;
    let most = middle.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ends = 0.5 * (first + last);
    let agrees = match () {
        () if first.min(*last) > most => Agreement::Yes,
        () if ends > middle_mean => Agreement::Partly,
        () => Agreement::No,
    };
    let list: Vec<String> =
        start.iter().zip(&corrected).map(|((name, _), share)| format!("{name} {}", percent(*share))).collect();
    Some(Finding {
        ours: Some((ends - middle_mean) * 100.0),
        text: format!("corrected after {} movements: {}", evidence.steps, list.join(", ")),
        agrees,
        why: format!(
            "agrees if the first and the last joint are corrected most, in part if they are corrected more than the others \
             on average; corrected: the fall of the median error, orientation and location each in units of its \
             threshold, added.{}",
            if agrees != Agreement::Yes && first > last {
                " Steepest descent moves each parameter as far as it moves the marker: joints at the base, with the \
                 longest lever, are corrected first"
            } else {
                ""
            }
        ),
    })
}

/// Movements after which the signal of the wrist is judged.
const LATE: u64 = 100;

/// The signal of a joint is how far its error moves the marker; the noise is the sensor's.
fn wrist_signal(evidence: &Evidence<'_>) -> Option<Finding> {
    // Means over the wrist's joints and over all others.
    let at = |movements: u64| -> Option<[f64; 2]> {
        let point = evidence.curve_at("active", movements)?;
        let of = |wrist: bool| {
            let joints = evidence.outcome.joints().iter().filter(|joint| joint.name.contains("wrist") == wrist);
            mean(joints.filter_map(|joint| point.joints.get(joint.index)?.signal_to_noise))
        };
        Some([of(true)?, of(false)?])
    };
    let [[wrist_0, others_0], [wrist, others]] = [at(0)?, at(LATE)?];
    Some(Finding {
        ours: Some(wrist),
        text: format!(
            "wrist {} at the start and {} after {LATE} movements of active; the other joints {} and {}",
            short(wrist_0),
            short(wrist),
            short(others_0),
            short(others)
        ),
        agrees: match wrist {
            _ if (1.0 / 1.5..=1.5).contains(&wrist) => Agreement::Yes,
            _ if (1.0 / 3.0..=3.0).contains(&wrist) => Agreement::Partly,
            _ => Agreement::No,
        },
        why: format!(
            "root mean square displacement of the marker by the error of one joint, over the noise's standard deviation, \
             judged after {LATE} movements; the paper does not define its ratio"
        ),
    })
}
