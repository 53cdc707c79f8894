//! Claims on how soon learners converge.

use super::{
    Claim, Test,
    evidence::{Evidence, Finding, percent, short},
};
use crate::{outcome::Outcome, report::Agreement};

/// Movements after which falling "fast" is judged.
const EARLY: u64 = 100;

pub const SIMULATED: &[Claim] = &[
    Claim {
        id: "fig-4-prediction",
        figure: "Fig. 4",
        what: "prediction error, 6 joints",
        paper: "falls fast for all learners",
        paper_value: None,
        unit: "% of the initial error after 100 movements, slowest learner",
        test: Test::By("fig-4", prediction_falls),
    },
    Claim {
        id: "fig-4-faster",
        figure: "Fig. 4",
        what: "active beside random, 6 joints: speed",
        paper: "active is faster in the parameters",
        paper_value: None,
        unit: "times random's movements",
        test: Test::By("fig-4", active_is_faster),
    },
    Claim {
        id: "fig-4-better",
        figure: "Fig. 4",
        what: "active beside random, 6 joints: errors at the end",
        paper: "active is better in the parameters",
        paper_value: None,
        unit: "times random's location error",
        test: Test::By("fig-4", active_is_better),
    },
    Claim {
        id: "fig-4-trapped",
        figure: "Fig. 4",
        what: "random movements, 6 joints: local minima",
        paper: "random is sometimes trapped in local minima",
        paper_value: None,
        unit: "runs",
        test: Test::By("fig-4", random_is_trapped),
    },
    Claim {
        id: "fig-5-gradient",
        figure: "Fig. 5",
        what: "gradient, 12 joints",
        paper: "very slow",
        paper_value: None,
        unit: "runs converged",
        test: Test::By("fig-5", gradient_fails),
    },
    Claim {
        id: "fig-5-random",
        figure: "Fig. 5",
        what: "random beside active, 12 joints",
        paper: "random needs far more observations than active",
        paper_value: None,
        unit: "times active's movements",
        test: Test::By("fig-5", random_needs_more),
    },
    Claim {
        id: "fig-5-selection-time",
        figure: "Fig. 5",
        what: "time to choose one configuration, 12 joints",
        paper: "0.3 s",
        paper_value: Some(0.3),
        unit: "s",
        test: Test::By("selection-time", selection_time),
    },
];

pub const HEAD: &[Claim] = &[
    Claim {
        id: "head-fov-random",
        figure: "Figs. 6, 7",
        what: "RLS, random movements, real robot's set-up",
        paper: "about 600 observations",
        paper_value: Some(600.0),
        unit: "movements",
        test: Test::By("head-fov", |evidence| {
            evidence.movements("random", 600.0, true, "Arm, head and thresholds are not the paper's.")
        }),
    },
    Claim {
        id: "head-fov-gradient",
        figure: "Figs. 6, 7",
        what: "gradient, real robot's set-up",
        paper: "not after 2000 observations",
        paper_value: None,
        unit: "runs converged",
        test: Test::By("head-fov", gradient_fails),
    },
    Claim {
        id: "head-fov-gradient-prediction",
        figure: "Figs. 6, 7",
        what: "gradient's prediction error, real robot's set-up",
        paper: "converges after about 1500 observations",
        paper_value: Some(1500.0),
        unit: "movements",
        test: Test::By("head-fov", gradient_prediction),
    },
    Claim {
        id: "head-fov-active",
        figure: "Figs. 6, 7",
        what: "RLS, active, real robot's set-up",
        paper: "under 80 observations",
        paper_value: Some(80.0),
        unit: "movements",
        test: Test::By("head-fov", |evidence| {
            evidence.movements("active", 80.0, false, "Arm, head and thresholds are not the paper's.")
        }),
    },
    Claim {
        id: "head-fov-excursion-active",
        figure: "Figs. 6, 7",
        what: "RLS, active, each joint moving over 40 deg only",
        paper: "each joint's excursion is 40 deg because of the head's field of view; under 80 observations",
        paper_value: Some(80.0),
        unit: "movements",
        test: Test::By("head-fov-excursion", |evidence| {
            evidence.movements(
                "active",
                80.0,
                false,
                "Small excursions tell a near axis from a far one only through noise.",
            )
        }),
    },
    Claim {
        id: "head-fov-excursion-random",
        figure: "Figs. 6, 7",
        what: "RLS, random, each joint moving over 40 deg only",
        paper: "each joint's excursion is 40 deg because of the head's field of view; about 600 observations",
        paper_value: Some(600.0),
        unit: "movements",
        test: Test::By("head-fov-excursion", |evidence| {
            evidence.movements(
                "random",
                600.0,
                true,
                "Small excursions tell a near axis from a far one only through noise.",
            )
        }),
    },
    Claim {
        id: "doubled-error-active",
        figure: "text",
        what: "RLS, active, doubled initial error: exactly 90 deg and 0.8 m",
        paper: "250 observations",
        paper_value: Some(250.0),
        unit: "movements",
        test: Test::By("head-fov-doubled-error", |evidence| doubled_error(evidence, "active", 250.0)),
    },
    Claim {
        id: "doubled-error-random",
        figure: "text",
        what: "RLS, random, doubled initial error: exactly 90 deg and 0.8 m",
        paper: "1400 observations",
        paper_value: Some(1400.0),
        unit: "movements",
        test: Test::By("head-fov-doubled-error", |evidence| doubled_error(evidence, "random", 1400.0)),
    },
    Claim {
        id: "doubled-error-up-to-active",
        figure: "text",
        what: "RLS, active, doubled initial error: up to 90 deg and 0.8 m",
        paper: "250 observations",
        paper_value: Some(250.0),
        unit: "movements",
        test: Test::By("head-fov-doubled-error-up-to", |evidence| doubled_error(evidence, "active", 250.0)),
    },
    Claim {
        id: "doubled-error-up-to-random",
        figure: "text",
        what: "RLS, random, doubled initial error: up to 90 deg and 0.8 m",
        paper: "1400 observations",
        paper_value: Some(1400.0),
        unit: "movements",
        test: Test::By("head-fov-doubled-error-up-to", |evidence| doubled_error(evidence, "random", 1400.0)),
    },
    Claim {
        id: "doubled-error-6dof-trapped",
        figure: "text",
        what: "random movements, 6 joints, doubled initial error: local minima",
        paper: "random is sometimes trapped in local minima",
        paper_value: None,
        unit: "runs",
        test: Test::By("arm-6dof-doubled-error", random_is_trapped),
    },
];

/// The paper's movements for a doubled initial error, under one reading of it.
fn doubled_error(evidence: &Evidence<'_>, learner: &str, paper: f64) -> Option<Finding> {
    evidence.movements(learner, paper, true, "Arm, head and thresholds are not the paper's.")
}

fn prediction_falls(evidence: &Evidence<'_>) -> Option<Finding> {
    let learners = &evidence.outcome.trials().first()?.comparison.learners;
    let mut shares = Vec::new();
    for learner in learners {
        let start = learner.curve.first()?.prediction_mean_m?.median;
        let early = evidence.curve_at(&learner.name, EARLY)?.prediction_mean_m?.median;
        shares.push((learner.name.as_str(), early / start));
    }
    let slowest = shares.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    let list: Vec<String> = shares.iter().map(|(name, share)| format!("{name} {}", percent(*share))).collect();
    let fast = shares.iter().filter(|(_, share)| *share <= 0.2).count();
    let agrees = match fast {
        _ if fast == shares.len() => Agreement::Yes,
        0 => Agreement::No,
        _ => Agreement::Partly,
    };
    Some(Finding {
        ours: Some(slowest * 100.0),
        text: format!("left of the initial error after {EARLY} movements: {}", list.join(", ")),
        agrees,
        why: "fast: at most 20 % of the median initial prediction error is left after 100 movements".to_owned(),
    })
}

fn active_is_faster(evidence: &Evidence<'_>) -> Option<Finding> {
    let (active, random) = (evidence.learner("active")?, evidence.learner("random")?);
    let text = format!("active: {}; random: {}", evidence.convergence(active), evidence.convergence(random));
    let medians = (active.summary.median_converged_at, random.summary.median_converged_at);
    let (ours, agrees) = match medians {
        (Some(active), Some(random)) => {
            let ratio = active / random;
            let agrees = if ratio <= 0.8 { Agreement::Yes } else { Agreement::of_two(false, ratio < 1.0) };
            (Some(ratio), agrees)
        }
        (Some(_), None) => (None, Agreement::Yes),
        _ => (None, Agreement::No),
    };
    let why = format!("faster: active's median is at most 0.8 of random's ({})", evidence.thresholds());
    Some(Finding { ours, text, agrees, why })
}

fn active_is_better(evidence: &Evidence<'_>) -> Option<Finding> {
    let (active, random) = (evidence.end("active")?, evidence.end("random")?);
    let (active_deg, random_deg) = (active.orientation_deg?.median, random.orientation_deg?.median);
    let (active_m, random_m) = (active.location_m?.median, random.location_m?.median);
    let agrees = Agreement::of_two(active_deg < random_deg, active_m < random_m);
    Some(Finding {
        ours: Some(active_m / random_m),
        text: format!(
            "after {} movements active {} deg and {} mm, random {} deg and {} mm",
            evidence.steps,
            short(active_deg),
            short(active_m * 1e3),
            short(random_deg),
            short(random_m * 1e3)
        ),
        agrees,
        why: match agrees {
            Agreement::Yes => "both median errors are smaller for active".to_owned(),
            _ => "better would be smaller median errors of orientation and of location; with enough movements the \
                  stabilising noise limits both learners alike"
                .to_owned(),
        },
    })
}

fn random_is_trapped(evidence: &Evidence<'_>) -> Option<Finding> {
    let learners = &evidence.outcome.trials().first()?.comparison.learners;
    let trapped = |summary: &body_schema_wire::Summary| summary.runs - summary.converged;
    let random = trapped(&evidence.learner("random")?.summary);
    let list: Vec<String> = learners
        .iter()
        .map(|learner| format!("{} {} of {}", learner.name, trapped(&learner.summary), learner.summary.runs))
        .collect();
    let agrees = if random > 0 { Agreement::Yes } else { Agreement::No };
    let why = match agrees {
        Agreement::Yes => format!("trapped: outside the {} after {} movements", evidence.thresholds(), evidence.steps),
        _ => "no random run is outside the thresholds at the end: with filter values swept for random's own benefit, \
              stabilising noise frees it"
            .to_owned(),
    };
    Some(Finding { ours: Some(random as f64), text: format!("not converged: {}", list.join(", ")), agrees, why })
}

fn gradient_fails(evidence: &Evidence<'_>) -> Option<Finding> {
    let gradient = evidence.learner("gradient")?;
    let summary = &gradient.summary;
    let share = summary.converged as f64 / summary.runs.max(1) as f64;
    let agrees = match share {
        _ if share <= 0.1 => Agreement::Yes,
        _ if share < 0.5 => Agreement::Partly,
        _ => Agreement::No,
    };
    Some(Finding {
        ours: Some(summary.converged as f64),
        text: evidence.convergence(gradient),
        agrees,
        why: "agrees if at most a tenth of the runs converge; the update is our own derivation, at the best of the rates \
              tried"
            .to_owned(),
    })
}

fn random_needs_more(evidence: &Evidence<'_>) -> Option<Finding> {
    let (active, random) = (evidence.learner("active")?, evidence.learner("random")?);
    let text = format!("active: {}; random: {}", evidence.convergence(active), evidence.convergence(random));
    let (ours, agrees) = match (active.summary.median_converged_at, random.summary.median_converged_at) {
        (Some(active), Some(random)) if random >= 2.0 * active => (Some(random / active), Agreement::Yes),
        (Some(active), Some(random)) if random > 1.2 * active => (Some(random / active), Agreement::Partly),
        (Some(active), Some(random)) => (Some(random / active), Agreement::No),
        (Some(_), None) => (None, Agreement::Yes),
        _ => (None, Agreement::No),
    };
    let why = match agrees {
        Agreement::Yes => "far more: at least twice as many movements",
        _ => {
            "far more would be at least twice as many. Both learners share the filter that suits random best, found by \
              a sweep; and nothing is out of sight here, so random movements teach more than on the robot"
        }
    };
    Some(Finding { ours, text, agrees, why: why.to_owned() })
}

fn selection_time(evidence: &Evidence<'_>) -> Option<Finding> {
    let Outcome::Timing(timing) = evidence.outcome else { return None };
    let seconds = timing.median_ms / 1e3;
    Some(Finding {
        ours: Some(seconds),
        text: format!(
            "median {} ms (95 %: {} ms) for {} evaluations of the criterion, one core, {} choices",
            short(timing.median_ms),
            short(timing.p95_ms),
            timing.evaluations,
            timing.choices
        ),
        agrees: if seconds <= 0.3 { Agreement::Yes } else { Agreement::No },
        why: format!(
            "{} times faster, on a machine more than ten years younger; the paper does not give its number of evaluations",
            short(0.3 / seconds)
        ),
    })
}

fn gradient_prediction(evidence: &Evidence<'_>) -> Option<Finding> {
    const PAPER: f64 = 1500.0;
    let end = evidence.end("gradient")?.prediction_mean_m?.median;
    let start = evidence.learner("gradient")?.curve.first()?.prediction_mean_m?.median;
    let at = evidence.falls_below("gradient", |point| point.prediction_mean_m, 1.1 * end)? as f64;
    let agrees = match at / PAPER {
        ratio if (1.0 / 1.5..=1.5).contains(&ratio) => Agreement::Yes,
        ratio if (1.0 / 3.0..=3.0).contains(&ratio) => Agreement::Partly,
        _ => Agreement::No,
    };
    Some(Finding {
        ours: Some(at),
        text: format!(
            "within 10 % of its last value from movement {at}: {} mm, {} at the start",
            short(end * 1e3),
            short(start * 1e3)
        ),
        agrees,
        why: format!("converged: the median stays within 10 % of its value after {} movements", evidence.steps),
    })
}
