//! Claims on the setup: what was run, beside what the paper ran.

use super::{
    Claim, Test,
    evidence::{Evidence, Finding, short},
};
use crate::report::Agreement;
use body_schema_scenario::{ErrorDraw, WorldSpec};

pub const CLAIMS: &[Claim] = &[
    Claim {
        id: "fig-3",
        figure: "Fig. 3",
        what: "potentially optimal rectangles, by (9) and (10)",
        paper: "they lie on the lower right convex hull of size and value",
        paper_value: None,
        unit: "",
        test: Test::By("fig-3", hull),
    },
    Claim {
        id: "fig-4-setup",
        figure: "Fig. 4",
        what: "set-up, 6 joints",
        paper: "6 dof; random initial parameters in a hypercube; 1000 observations; σR² = 1e-4 (σ = 1 cm); 20 runs",
        paper_value: None,
        unit: "",
        test: Test::By("fig-4", |evidence| simulated(evidence, 6)),
    },
    Claim {
        id: "fig-5-setup",
        figure: "Fig. 5",
        what: "set-up, 12 joints",
        paper: "12 dof; the same",
        paper_value: None,
        unit: "",
        test: Test::By("fig-5", |evidence| simulated(evidence, 12)),
    },
    Claim {
        id: "head-fov-setup",
        figure: "Figs. 6, 7",
        what: "set-up, real robot",
        paper: "4 joints learned of 6; 2000 random points; marker error about ±5 cm per dimension in 90 % of cases; \
                filter σR² = 0.01, σQ² = 0.005; initial error 45 deg per angle and 0.4 m per dimension",
        paper_value: None,
        unit: "",
        test: Test::By("head-fov", |evidence| real_robot(evidence, 45.0, 0.4)),
    },
    Claim {
        id: "head-fov-doubled-error-setup",
        figure: "text",
        what: "set-up, doubled initial error: exactly that size",
        paper: "as above, 90 deg and 0.8 m",
        paper_value: None,
        unit: "",
        test: Test::By("head-fov-doubled-error", |evidence| real_robot(evidence, 90.0, 0.8)),
    },
    Claim {
        id: "head-fov-doubled-error-up-to-setup",
        figure: "text",
        what: "set-up, doubled initial error: up to that size",
        paper: "as above, 90 deg and 0.8 m",
        paper_value: None,
        unit: "",
        test: Test::By("head-fov-doubled-error-up-to", |evidence| real_robot(evidence, 90.0, 0.8)),
    },
];

fn hull(evidence: &Evidence<'_>) -> Option<Finding> {
    let crate::outcome::Outcome::Searches(searches) = evidence.outcome else { return None };
    let mut all_on_hull = true;
    let mut parts = Vec::new();
    for search in searches {
        let points: Vec<(f64, f64)> = search
            .sizes
            .iter()
            .zip(&search.partition.leaves)
            .filter_map(|(size, leaf)| Some((*size, leaf.value?)))
            .collect();
        let chosen: Vec<_> = search.hull.iter().filter(|point| point.potentially_optimal).collect();
        // (9) by its definition, not by the hull: some K > 0 must put the rectangle below all others.
        let satisfied = chosen.iter().filter(|point| exists_rate(&points, (point.size, point.value))).count();
        all_on_hull &= satisfied == chosen.len() && !chosen.is_empty();
        let (name, rectangles) = (&search.variant, points.len());
        parts.push(format!("{name}: {satisfied} of {} chosen from {rectangles} rectangles satisfy (9)", chosen.len()));
    }
    Some(Finding {
        ours: None,
        text: parts.join("; "),
        agrees: if all_on_hull { Agreement::Yes } else { Agreement::No },
        why:
            "each rectangle that DIRECT chose from the hull was checked against (9) itself, over all rectangles of one \
              real selection"
                .to_owned(),
    })
}

/// Whether some K > 0 has f − K d ≤ fᵢ − K dᵢ for all points (dᵢ, fᵢ).
fn exists_rate(points: &[(f64, f64)], (size, value): (f64, f64)) -> bool {
    let (mut least, mut most) = (0.0_f64, f64::INFINITY);
    for &(other_size, other_value) in points {
        let tolerance = 1e-12 * value.abs();
        if other_size == size {
            if other_value < value - tolerance {
                return false;
            }
        } else if other_size < size {
            least = least.max((value - other_value) / (size - other_size));
        } else {
            most = most.min((other_value - value) / (other_size - size));
        }
    }
    most > 0.0 && least <= most * (1.0 + 1e-9)
}

fn simulated(evidence: &Evidence<'_>, joints: usize) -> Option<Finding> {
    let scenario = evidence.scenario;
    let WorldSpec::Simulated { initial_error, .. } = &scenario.world else { return None };
    let trial = evidence.outcome.trials().first()?;
    let runs = trial.comparison.learners.first()?.runs.len();
    let learned = trial.joints.len();
    let text = format!(
        "{learned} joints; each angle wrong by up to {:.0} deg and each coordinate by up to {} m; {} movements; σ = {} cm; \
         the filter assumes R = {} m²; {runs} runs",
        initial_error.angle_rad.to_degrees(),
        initial_error.point_m,
        evidence.steps,
        short(scenario.measurement_model.marker_sigma() * 100.0),
        scenario.filter.variance,
    );
    let same = learned == joints
        && initial_error.draw == ErrorDraw::UpTo
        && (scenario.measurement_model.marker_sigma() - 0.01).abs() < 1e-9
        && (evidence.steps, runs) == (1000, 20);
    Some(Finding {
        ours: None,
        text,
        agrees: if same { Agreement::Partly } else { Agreement::No },
        why: if same {
            "the same number of joints, noise, runs and movements; geometry, size of the hypercube and the filter's \
             values are ours, as the paper does not give them"
                .to_owned()
        } else {
            "not the paper's number of joints, noise, runs or movements".to_owned()
        },
    })
}

fn real_robot(evidence: &Evidence<'_>, angle_deg: f64, point_m: f64) -> Option<Finding> {
    let scenario = evidence.scenario;
    let WorldSpec::Simulated { initial_error, .. } = &scenario.world else { return None };
    let trial = evidence.outcome.trials().first()?;
    let (joints, learned) = (scenario.robot.names.len(), trial.joints.len());
    let stabilising = scenario.filter.stabilising.map(|noise| noise.variance);
    // 90 % of a normal distribution lie within 1.645 σ.
    let bound_cm = 1.645 * scenario.measurement_model.marker_sigma() * 100.0;
    let (size, reading) = match initial_error.draw {
        ErrorDraw::Exactly => (
            "exactly",
            "The paper's sizes are read as the error itself: every angle and every coordinate is wrong by all of it, with \
             random signs",
        ),
        ErrorDraw::UpTo => (
            "up to",
            "The paper's sizes are read as the most that the error can be: every angle and every coordinate is drawn \
             uniformly between minus and plus that, and is wrong by half of it on average",
        ),
        ErrorDraw::Anywhere => ("anything, points within", "There is no initial estimate"),
    };
    let text = format!(
        "{learned} joints learned of {joints}, simulated; {} movements; ±{} cm in 90 % of cases; R = {} m², σn² = {}; \
         initial error of {size} {:.0} deg and {} m",
        evidence.steps,
        short(bound_cm),
        scenario.filter.variance,
        stabilising.map_or_else(|| "0".to_owned(), |variance| variance.to_string()),
        initial_error.angle_rad.to_degrees(),
        initial_error.point_m,
    );
    let near = |a: f64, b: f64| (a - b).abs() < 0.03 * b;
    let differences: Vec<&str> = [
        (learned != 4, "the number of learned joints"),
        (!near(bound_cm, 5.0), "the marker's error"),
        (!near(scenario.filter.variance, 0.01), "the filter's R"),
        (!stabilising.is_some_and(|variance| near(variance, 0.005)), "the stabilising noise"),
        (!near(initial_error.angle_rad.to_degrees(), angle_deg), "the error of the angles"),
        (!near(initial_error.point_m, point_m), "the error of the points"),
        (evidence.steps < 2000, "the number of movements"),
    ]
    .into_iter()
    .filter_map(|(differs, what)| differs.then_some(what))
    .collect();
    let (agrees, why) = if differences.is_empty() {
        let why = "the paper's values; but the arm and the head are simulated, and their geometry is ours";
        (Agreement::Partly, format!("{why}. {reading}"))
    } else {
        (Agreement::No, format!("different: {}. {reading}", differences.join(", ")))
    };
    Some(Finding { ours: None, text, agrees, why })
}
