//! The paper's remarks.

use super::{
    Claim, Test,
    evidence::{Evidence, Finding, percent, short},
};
use crate::{outcome::Trial, report::Agreement};
use body_schema_engine::optimize::least;
use body_schema_scenario::EstimatorKind;
use body_schema_wire::Summary;

pub const CLAIMS: &[Claim] = &[
    Claim {
        id: "fewer-observations",
        figure: "text",
        what: "active beside the other learners",
        paper: "less than 10 % of their observations (its own 80 of 600 are 13 %)",
        paper_value: Some(10.0),
        unit: "% of random's movements",
        test: Test::By("head-fov", tenth),
    },
    Claim {
        id: "smaller-orientation-error",
        figure: "Figs. 6, 7",
        what: "orientation error at the end, active beside random",
        paper: "active ends with a smaller one than random",
        paper_value: None,
        unit: "times random's",
        test: Test::By("head-fov", smaller_orientation_error),
    },
    Claim {
        id: "misses",
        figure: "Figs. 6, 7",
        what: "head's field of view",
        paper: "the marker leaves the image at about ±20 deg; the head servos to keep it inside",
        paper_value: None,
        unit: "% of active's movements missed",
        test: Test::By("head-fov", misses),
    },
    Claim {
        id: "learning-rates",
        figure: "text",
        what: "gradient: learning rate",
        paper: "several learning rates were tried",
        paper_value: None,
        unit: "runs converged at the best rate",
        test: Test::By("learning-rates", learning_rates),
    },
    Claim {
        id: "epsilon",
        figure: "text",
        what: "DIRECT's ε",
        paper: "any reasonable ε will do",
        paper_value: None,
        unit: "times, slowest beside fastest",
        test: Test::By("epsilon", epsilon),
    },
    Claim {
        id: "adaptability",
        figure: "text",
        what: "stabilising noise: a body that changes",
        paper: "gives some adaptability",
        paper_value: None,
        unit: "runs recovered",
        test: Test::By("body-change", adaptability),
    },
    Claim {
        id: "accuracy-limit",
        figure: "text",
        what: "stabilising noise: final accuracy",
        paper: "limits it",
        paper_value: None,
        unit: "times the location error, most beside least noise",
        test: Test::By("stabilising-noise", accuracy_limit),
    },
    Claim {
        id: "camera-parameters",
        figure: "text",
        what: "camera parameters",
        paper: "could be estimated along",
        paper_value: None,
        unit: "",
        test: Test::Missing("the camera is known here; a suggestion of the paper's, not an experiment"),
    },
    Claim {
        id: "intermediate-joints",
        figure: "text",
        what: "positions of intermediate joints",
        paper: "also carry information",
        paper_value: None,
        unit: "",
        test: Test::Missing("only the marker on the hand is seen here; a suggestion of the paper's, not an experiment"),
    },
];

fn tenth(evidence: &Evidence<'_>) -> Option<Finding> {
    let (active, random) = (evidence.learner("active")?, evidence.learner("random")?);
    let text = format!("active: {}; random: {}", evidence.convergence(active), evidence.convergence(random));
    let share = match (active.summary.median_converged_at, random.summary.median_converged_at) {
        (Some(active), Some(random)) => Some(active / random),
        // Random's median lies beyond the last movement: this share is an upper bound.
        (Some(active), None) => Some(active / evidence.steps as f64),
        _ => None,
    };
    let agrees = match share {
        Some(share) if share <= 0.1 => Agreement::Yes,
        Some(share) if share <= 0.25 => Agreement::Partly,
        _ => Agreement::No,
    };
    let why = match share {
        Some(share) => {
            format!("active needs {} of random's movements (by the paper's own numbers: 13 %)", percent(share))
        }
        None => "active's median run does not converge".to_owned(),
    };
    Some(Finding { ours: share.map(|share| share * 100.0), text, agrees, why })
}

fn smaller_orientation_error(evidence: &Evidence<'_>) -> Option<Finding> {
    let median = |learner: &str| Some(evidence.end(learner)?.orientation_deg?.median);
    let (active, random) = (median("active")?, median("random")?);
    Some(Finding {
        ours: Some(active / random),
        text: format!("after {} movements active {} deg, random {} deg", evidence.steps, short(active), short(random)),
        agrees: if active < random { Agreement::Yes } else { Agreement::No },
        why: "medians over the runs".to_owned(),
    })
}

fn misses(evidence: &Evidence<'_>) -> Option<Finding> {
    let share = |learner: &str| {
        let runs = &evidence.learner(learner)?.runs;
        let total = |count: fn(&body_schema_wire::SeedRun) -> u64| runs.iter().map(count).sum::<u64>() as f64;
        Some(total(|run| run.misses) / total(|run| run.movements).max(1.0))
    };
    let (active, random) = (share("active")?, share("random")?);
    Some(Finding {
        ours: Some(active * 100.0),
        text: format!("out of sight: {} of active's movements, {} of random's", percent(active), percent(random)),
        agrees: if active < 0.1 { Agreement::Yes } else { Agreement::No },
        why: "agrees if less than a tenth of active's movements are misses".to_owned(),
    })
}

fn learning_rates(evidence: &Evidence<'_>) -> Option<Finding> {
    let trials = evidence.outcome.trials();
    let converged = |trial: &Trial| trial.comparison.learners.first().map(|learner| learner.summary.converged);
    let best = trials.iter().filter_map(converged).max()?;
    let list: Vec<String> = trials
        .iter()
        .filter_map(|trial| {
            let location = trial.comparison.learners.first()?.curve.last()?.location_m?.median;
            Some(format!("{}: {} converged, {} cm", trial.value?, converged(trial)?, short(location * 100.0)))
        })
        .collect();
    let runs = trials.first()?.comparison.learners.first()?.summary.runs;
    Some(Finding {
        ours: Some(best as f64),
        text: format!("rate: runs converged of {runs}, location error at the end: {}", list.join("; ")),
        agrees: if best as f64 <= 0.1 * runs as f64 { Agreement::Yes } else { Agreement::No },
        why: "agrees if no rate makes more than a tenth of the runs converge: the baseline is slow at every rate, not \
              badly tuned"
            .to_owned(),
    })
}

fn epsilon(evidence: &Evidence<'_>) -> Option<Finding> {
    let medians: Vec<(f64, Option<f64>)> = evidence
        .outcome
        .trials()
        .iter()
        .filter_map(|trial| Some((trial.value?, trial.comparison.learners.first()?.summary.median_converged_at)))
        .collect();
    let word = |median: &Option<f64>| median.map_or_else(|| "no median".to_owned(), |median| median.to_string());
    let list: Vec<String> = medians.iter().map(|(value, median)| format!("{value:e}: {}", word(median))).collect();
    // Jones, Perttunen and Stuckman found their results insensitive to ε in this range.
    let reasonable: Vec<Option<f64>> =
        medians.iter().filter(|(value, _)| (1e-7..=1e-3).contains(value)).map(|(_, median)| *median).collect();
    let finite: Vec<f64> = reasonable.iter().copied().flatten().collect();
    let low = finite.iter().copied().fold(f64::INFINITY, f64::min);
    let high = finite.iter().copied().fold(0.0, f64::max);
    let all = !reasonable.is_empty() && finite.len() == reasonable.len();
    let agrees = match high / low {
        ratio if all && ratio <= 1.25 => Agreement::Yes,
        ratio if all && ratio <= 2.0 => Agreement::Partly,
        _ => Agreement::No,
    };
    Some(Finding {
        ours: all.then_some(high / low),
        text: format!("median movements by ε: {}", list.join("; ")),
        agrees,
        why: format!(
            "agrees if, for ε from 1e-7 to 1e-3, which Jones et al. call reasonable, the slowest median is at most 1.25 \
             times the fastest.{}",
            if agrees == Agreement::Yes {
                ""
            } else {
                " ε is a share of |C|, and most of C is variance that one movement cannot remove: a large ε hides gains \
                 that are small beside C and yet worth having"
            }
        ),
    })
}

fn adaptability(evidence: &Evidence<'_>) -> Option<Finding> {
    let learners = &evidence.outcome.trials().first()?.comparison.learners;
    let stabilised = |name: &str| {
        evidence
            .scenario
            .learners
            .iter()
            .any(|spec| spec.name == name && spec.stabilising && spec.estimator == EstimatorKind::Rls)
    };
    let (mut with, mut without, mut list) = (None, None, Vec::new());
    for learner in learners {
        let recovered = learner.runs.iter().filter(|run| run.recovered_at.is_some()).count();
        let best = if stabilised(&learner.name) { &mut with } else { &mut without };
        *best = (*best).max(Some(recovered));
        let median = Summary::of(learner.runs.iter().map(|run| run.recovered_at)).median_converged_at;
        let when = median.map_or_else(String::new, |median| format!(" (median after {median})"));
        list.push(format!("{} {recovered} of {}{when}", learner.name, learner.runs.len()));
    }
    let runs = learners.first()?.runs.len();
    let (with, without) = (with?, without.unwrap_or(0));
    Some(Finding {
        ours: Some(with as f64),
        text: format!("back within the thresholds after the change: {}", list.join(", ")),
        agrees: Agreement::of_two(2 * with > runs, 2 * without < runs),
        why: "agrees if most runs with stabilising noise recover, and most of those without do not".to_owned(),
    })
}

fn accuracy_limit(evidence: &Evidence<'_>) -> Option<Finding> {
    let errors: Vec<(f64, f64)> = evidence
        .outcome
        .trials()
        .iter()
        .filter_map(|trial| Some((trial.value?, trial.comparison.learners.first()?.curve.last()?.location_m?.median)))
        .collect();
    let list: Vec<String> =
        errors.iter().map(|(value, error)| format!("{value:e}: {} mm", short(error * 1e3))).collect();
    let lowest = least(errors.iter().copied())?;
    let most = errors.last()?;
    // Little noise leaves runs stuck; from the best value on, more noise must cost accuracy.
    let rises = errors.iter().filter(|(value, _)| *value >= lowest.0).is_sorted_by(|a, b| a.1 <= b.1);
    let ratio = most.1 / lowest.1;
    let agrees = match ratio {
        _ if rises && ratio >= 1.5 => Agreement::Yes,
        _ if ratio >= 1.1 => Agreement::Partly,
        _ => Agreement::No,
    };
    Some(Finding {
        ours: Some(ratio),
        text: format!("variance: median location error after {} movements: {}", evidence.steps, list.join("; ")),
        agrees,
        why: format!(
            "agrees if from its least (at variance {:e}) the error rises with the variance, by half or more; with less \
             noise than that, runs get stuck",
            lowest.0
        ),
    })
}
