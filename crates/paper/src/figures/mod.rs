//! The paper's figures, drawn from outcomes.

mod curves;
mod designs;
mod joints;
mod partition;
mod sweep;

use super::{
    Plan,
    experiments::{Kind, PaperExperiment},
    outcome::Outcome,
};
use body_schema_chart::Chart;
use body_schema_scenario::Scenario;

/// A figure: its name, its caption, and the drawing.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Its name in files.
    pub id: String,
    /// What it shows.
    pub caption: String,
    /// The drawing.
    pub chart: Chart,
}

/// What a figure is drawn from.
#[derive(Clone, Copy)]
struct Source<'a> {
    experiment: &'static PaperExperiment,
    scenario: &'a Scenario,
    plan: &'a Plan,
    outcome: &'a Outcome,
}

impl Source<'_> {
    /// "scenario arm-6dof · seeds 1 to 20 · body-schema 0.1.0".
    fn provenance(&self) -> String {
        let seeds = self.plan.seeds_of(self.experiment);
        let seeds = if seeds.start() == seeds.end() {
            format!("seed {}", seeds.start())
        } else {
            format!("seeds {} to {}", seeds.start(), seeds.end())
        };
        let quick = if self.plan.quick { " · quick: no finding" } else { "" };
        format!("scenario {} · {seeds} · body-schema {}{quick}", self.experiment.scenario, env!("CARGO_PKG_VERSION"))
    }

    fn title(&self) -> String {
        let figure = if self.experiment.figure == "text" { "From the text" } else { self.experiment.figure };
        format!("{figure}: {}", self.experiment.title)
    }
}

/// The figures of an experiment.
pub fn figures(
    experiment: &'static PaperExperiment,
    scenario: &Scenario,
    plan: &Plan,
    outcome: &Outcome,
) -> Vec<Figure> {
    let source = Source { experiment, scenario, plan, outcome };
    match experiment.kind {
        Kind::Comparison { .. } => [curves::figure(source), joints::figure(source)].into_iter().flatten().collect(),
        Kind::Sweep { .. } => sweep::figure(source).into_iter().collect(),
        Kind::Selection { .. } => partition::figure(source).into_iter().collect(),
        Kind::Timing { .. } => Vec::new(),
    }
}
