//! `paper`: the paper's experiments beside its numbers.

use std::path::PathBuf;

use anyhow::Result;
use body_schema_paper as paper;
use body_schema_paper::{Agreement, EXPERIMENTS, Ending, PaperExperiment, Plan, Progress};

use super::{
    Threads,
    output::{self, Failures, Outputs},
    progress::Bars,
};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// 4 seeds and short runs, to see that everything works
    #[arg(long)]
    quick: bool,
    /// Run only this experiment; repeat for several. Of the others, what DIR holds is shown [default: all]
    #[arg(long, value_name = "ID")]
    only: Vec<String>,
    /// Keep outcomes, figures and tables in DIR; outcomes kept there by this same program are not measured again
    /// [default: paper, with --quick paper/quick]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the table as JSON to FILE as well, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
}

/// One bar per experiment.
impl Progress for Bars {
    fn start(&self, experiment: &PaperExperiment, ticks: u64) {
        let place = EXPERIMENTS.iter().position(|other| other.id == experiment.id).map_or(0, |index| index + 1);
        self.begin(ticks, &format!("{place}/{} {}", EXPERIMENTS.len(), experiment.id));
    }

    fn tick(&self) {
        self.advance();
    }

    fn finish(&self, _experiment: &PaperExperiment, _how: Ending) {
        self.end();
    }
}

pub fn paper(arguments: &Arguments) -> Result<()> {
    let plan = Plan {
        quick: arguments.quick,
        only: arguments.only.clone(),
        out: arguments.out.clone().unwrap_or_else(|| paper::default_folder(arguments.quick)),
    };
    let outputs = Outputs::default().file("--json", arguments.json.as_deref());
    outputs.folder("--out", Some(&plan.out)).check(&[])?;
    let report = arguments.threads.run(|| Ok(paper::run(&plan, &Bars::default())?))?;
    let mut failures = Failures::default();
    if let Some(path) = &arguments.json {
        failures.keep(output::write_json(path, &report));
    }
    if arguments.json.as_deref().is_some_and(output::is_stdout) {
        return failures.end();
    }
    for row in &report.rows {
        let verdict = row.agrees.map_or("–", Agreement::name);
        output::say(format!("{verdict:7} {}: {}", row.figure, row.what))?;
        output::say(format!("        paper: {}\n        ours:  {}", row.paper, row.ours_text))?;
    }
    for name in ["paper.md", "paper.json"] {
        output::say(format!("wrote {}", plan.out.join(name).display()))?;
    }
    output::say(format!("wrote {} figures beside them, as SVG and PNG", report.figures.len()))?;
    failures.end()
}
