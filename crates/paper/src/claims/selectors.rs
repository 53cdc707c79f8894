//! Claims on other ways to choose a movement, and to parameterise a joint.

use super::{
    Claim, Test,
    evidence::{Evidence, Finding, short},
};
use crate::report::Agreement;
use body_schema_wire::LearnerComparison;

pub const CLAIMS: &[Claim] = &[
    Claim {
        id: "direct-l",
        figure: "text",
        what: "DIRECT in its locally biased form",
        paper: "DIRECT-l (Gablonsky 2001) rather than original DIRECT",
        paper_value: None,
        unit: "times original DIRECT's movements",
        test: Test::By("selectors", locally_biased),
    },
    Claim {
        id: "bayesian-optimisation",
        figure: "text",
        what: "selection by Bayesian optimisation instead of DIRECT",
        paper: "the gain is not worth its cost",
        paper_value: None,
        unit: "times DIRECT's time per choice",
        test: Test::By("selectors", bayesian_optimisation),
    },
    Claim {
        id: "search-floor",
        figure: "text",
        what: "the best of as many random postures instead of DIRECT (our floor, not the paper's)",
        paper: "–",
        paper_value: None,
        unit: "times DIRECT's movements",
        test: Test::By("selectors", search_floor),
    },
    Claim {
        id: "monte-carlo",
        figure: "text",
        what: "criterion averaged over the posterior by Monte Carlo",
        paper: "simulating at the current estimate is better where the Gaussian holds",
        paper_value: None,
        unit: "times the movements of the criterion at the estimate",
        test: Test::By("selectors", monte_carlo),
    },
    Claim {
        id: "six-numbers",
        figure: "text",
        what: "six numbers per joint beside our four",
        paper: "each joint is a direction and a point: six numbers",
        paper_value: None,
        unit: "times the movements that six numbers need",
        test: Test::By("selectors", six_numbers),
    },
];

/// Two learners side by side: the ratio of their median movements, and both in words.
struct Pair<'a> {
    ours: &'a LearnerComparison,
    other: &'a LearnerComparison,
    ratio: Option<f64>,
    text: String,
}

fn pair<'a>(evidence: &Evidence<'a>, ours: &str, other: &str) -> Option<Pair<'a>> {
    let learner = |name: &str| evidence.outcome.learner(name);
    let (ours, other) = (learner(ours)?, learner(other)?);
    let ratio = ours.summary.median_converged_at.zip(other.summary.median_converged_at).map(|(a, b)| a / b);
    let words = |learner: &LearnerComparison| {
        let time = learner.selection_ms.median.map(|ms| format!(", {} ms per choice", short(ms))).unwrap_or_default();
        format!("{}: {}{time}", learner.name, evidence.convergence(learner))
    };
    Some(Pair { ours, other, ratio, text: format!("{}; {}", words(ours), words(other)) })
}

/// Medians over 20 seeds scatter by about a tenth: within this factor two learners count as equal.
const EQUAL: f64 = 1.15;

fn locally_biased(evidence: &Evidence<'_>) -> Option<Finding> {
    let Pair { ratio, text, .. } = pair(evidence, "active", "active-direct")?;
    let agrees = match ratio {
        Some(ratio) if ratio <= EQUAL => Agreement::Yes,
        Some(ratio) if ratio <= 1.5 => Agreement::Partly,
        _ => Agreement::No,
    };
    let why = format!("agrees if DIRECT-l needs at most {EQUAL} times original DIRECT's movements, at equal budgets");
    Some(Finding { ours: ratio, text, agrees, why })
}

fn bayesian_optimisation(evidence: &Evidence<'_>) -> Option<Finding> {
    let Pair { ours, other, ratio, text } = pair(evidence, "active", "active-bayesian")?;
    let cost = other.selection_ms.median? / ours.selection_ms.median?;
    let gains_little = ratio.is_some_and(|ratio| ratio <= EQUAL);
    Some(Finding {
        ours: Some(cost),
        text,
        agrees: Agreement::of_two(gains_little, cost >= 10.0),
        why: format!(
            "agrees if it saves no movements to speak of (DIRECT needs at most {EQUAL} times as many) and costs at least \
             ten times the time, both with {} evaluations of the criterion",
            evidence.scenario.selection.search.max_evaluations
        ),
    })
}

fn search_floor(evidence: &Evidence<'_>) -> Option<Finding> {
    let Pair { ratio, text, .. } = pair(evidence, "active-random-search", "active")?;
    let agrees = match ratio {
        Some(ratio) if ratio < 1.0 / EQUAL => Agreement::No,
        Some(ratio) if ratio <= EQUAL => Agreement::Partly,
        _ => Agreement::Yes,
    };
    let why = format!(
        "agrees if DIRECT saves movements beside the floor (more than {EQUAL} times as many there), in part if they are \
         equal: then the criterion does the work, and any search with this budget serves"
    );
    Some(Finding { ours: ratio, text, agrees, why })
}

fn monte_carlo(evidence: &Evidence<'_>) -> Option<Finding> {
    let Pair { ratio, text, .. } = pair(evidence, "active-monte-carlo", "active")?;
    let agrees = match ratio {
        Some(ratio) if ratio < 1.0 / EQUAL => Agreement::No,
        Some(ratio) if ratio < 1.0 => Agreement::Partly,
        _ => Agreement::Yes,
    };
    let why =
        "agrees if Monte Carlo over 16 chains drawn from the posterior needs at least as many movements; or if its \
               median run does not converge within the movements made"
            .to_owned();
    Some(Finding { ours: ratio, text, agrees, why })
}

fn six_numbers(evidence: &Evidence<'_>) -> Option<Finding> {
    let Pair { ratio, text, .. } = pair(evidence, "random", "random-six-numbers")?;
    let agrees = match ratio {
        Some(ratio) if ratio <= EQUAL => Agreement::Yes,
        Some(ratio) if ratio <= 1.5 => Agreement::Partly,
        _ => Agreement::No,
    };
    let why = format!(
        "agrees if minimal coordinates lose nothing: random movements with four numbers per joint need at most {EQUAL} \
         times those with six"
    );
    Some(Finding { ours: ratio, text, agrees, why })
}
