//! The page of a watch: what stands, the evidence for it, and what would tell more.

use body_schema_chart::{Axis, Chart, Layer, Marker, Panel, Style};
use body_schema_palette::learner_color;
use body_schema_report::{Document, Part, Table, page as html};
use body_schema_watch::{Amount, Explanation, Kind};

use super::{
    Settled,
    standing::{LATEST, NamedMovements, Shown, Standing, UNLIKELY, alone, apart, drifting, shown_in},
};

/// The most sightings that are drawn, and the most events and lines that are listed, the latest of each.
const DRAWN: usize = 500;
const LISTED: usize = 20;
/// What the evidence of an alarm is drawn between, as a share of what an alarm needs.
const LEAST: f64 = 1e-4;
const MOST: f64 = 1e4;
/// From this probability on a sighting is drawn as one that is wild by itself.
const WILD: f64 = 0.5;

/// The page as HTML.
pub fn page(state: &Standing, settled: &Settled) -> String {
    let mut document = Document {
        title: match (state.watch.is_changed(), state.heard.is_empty()) {
            (true, _) => format!("⚠ {} has changed", state.scenario),
            (false, false) => format!("✓ {} is as calibrated", state.scenario),
            (false, true) => format!("Watch of {}", state.scenario),
        },
        subtitle: subtitle(state, settled),
        parts: vec![Part::Lead(lead(state))],
    };
    evidence(&mut document, state);
    if state.watch.is_changed() {
        suspects(&mut document, state);
        movements(&mut document, state);
    }
    sees(&mut document, state);
    told(&mut document, state);
    html(&document)
}

fn subtitle(state: &Standing, settled: &Settled) -> String {
    let last =
        state.heard.last().map_or_else(String::new, |it| format!(", the last {}", place(it.time.as_deref(), it.line)));
    let timeless = state.heard.iter().any(|it| it.time.is_none());
    let rate = match timeless {
        true => format!(" Without a time {:.0} a year are assumed.", 1.0 / state.clock.step),
        false => String::new(),
    };
    format!(
        "{}{last}.{rate} Calibrated by {} rows; {} false alarms a year are allowed. body-schema {}",
        count(state.heard.len(), "sighting"),
        settled.learned_rows,
        settled.false_alarms_per_year,
        env!("CARGO_PKG_VERSION")
    )
}

/// What stands, in a sentence.
fn lead(state: &Standing) -> String {
    let evidence = 100.0 * state.watch.evidence();
    match state.said() {
        Some(said) => format!("A change stands: {said}."),
        None if state.heard.is_empty() => "Nothing has been seen yet: add rows to the table, or send them.".to_owned(),
        None => {
            let strays = state.strays().map_or_else(String::new, |strays| format!(" But {strays}."));
            format!(
                "It is as it was calibrated: the evidence of a change is {evidence:.1} % of what an alarm needs.{strays}"
            )
        }
    }
}

fn evidence(document: &mut Document, state: &Standing) {
    let drawn = &state.heard[state.heard.len().saturating_sub(DRAWN)..];
    if drawn.is_empty() {
        return;
    }
    document.heading("The evidence");
    let x = || Axis::linear("sighting", drawn.iter().map(|it| it.sighting as f64));
    let line = drawn.iter().map(|it| [it.sighting as f64, it.evidence.clamp(LEAST, MOST)]).collect();
    let curve =
        Layer::Curve { points: line, style: Style { colour: learner_color(0), dashes: "", marker: Some(Marker::Dot) } };
    let first = drawn[0].sighting;
    let events = state.told.iter().filter(|it| it.sighting >= first && it.kind != Kind::Renamed).map(|it| {
        let (label, colour) = match it.kind {
            Kind::Recovered => ("as before", learner_color(2)),
            _ => ("alarm", learner_color(8)),
        };
        Layer::Event { x: it.sighting as f64, label: label.to_owned(), colour, dashes: "3 3" }
    });
    let level = Layer::Level { y: 1.0, label: "an alarm needs".to_owned() };
    let share = Panel {
        title: "How much speaks for a change".to_owned(),
        x: x(),
        y: Axis::log("evidence, alarm = 1", drawn.iter().map(|it| it.evidence.clamp(LEAST, MOST)).chain([0.1, 1.0])),
        layers: [level, curve].into_iter().chain(events).collect(),
    };
    let points = |is_wild: bool| {
        let of = drawn.iter().filter(|it| (it.wild >= WILD) == is_wild);
        of.map(|it| [it.sighting as f64, it.residual_sds]).collect::<Vec<_>>()
    };
    let wild = points(true);
    let mut layers = vec![Layer::Points { points: points(false), marker: Marker::Dot, colour: learner_color(0) }];
    let mut legend = Vec::new();
    if !wild.is_empty() {
        legend.push(("a sighting".to_owned(), Style::points(Marker::Dot, learner_color(0))));
        legend.push((
            "one that is likelier wild by itself than not".to_owned(),
            Style::points(Marker::Square, learner_color(8)),
        ));
        layers.push(Layer::Points { points: wild, marker: Marker::Square, colour: learner_color(8) });
    }
    let residuals = Panel {
        title: "How far each is from what was predicted".to_owned(),
        x: x(),
        y: Axis::linear("residual, standard deviations", drawn.iter().map(|it| it.residual_sds).chain([0.0])),
        layers,
    };
    let chart = Chart {
        title: "Sightings against the calibrated robot".to_owned(),
        subtitle: "left: the mixture Shiryaev-Roberts statistic; right: the whitened residual of each sighting"
            .to_owned(),
        legend,
        rows: vec![vec![share, residuals]],
        notes: Vec::new(),
    };
    let mut caption =
        "After an alarm the evidence begins anew: it is that of another change, or of everything being as before."
            .to_owned();
    if drawn.iter().any(|it| !(LEAST..=MOST).contains(&it.evidence)) {
        caption.push_str(&format!(" It is drawn between {LEAST} and {MOST} times what an alarm needs."));
    }
    if drawn.len() < state.heard.len() {
        caption.push_str(&format!(" The latest {DRAWN} of {} sightings.", state.heard.len()));
    }
    document.parts.push(Part::Figure { name: "evidence".to_owned(), svg: chart.svg(), caption });
}

fn suspects(document: &mut Document, state: &Standing) {
    document.heading("What has changed");
    let explanations = state.watch.explanations();
    let likely = explanations.iter().enumerate().filter(|(index, it)| *index == 0 || it.probability >= UNLIKELY);
    let row = |(_, it): (usize, &Explanation)| {
        [
            alone(&it.name).to_owned(),
            if it.amounts.is_empty() { "–".to_owned() } else { sizes(&it.amounts, true) },
            state.since(it),
            format!("{:.0}", (100.0 * it.probability).clamp(1.0, 99.0)),
        ]
    };
    let rows: Vec<_> = likely.map(row).collect();
    document.table(3, ["suspect", "by how much", "since", "probability, %"], rows);
}

/// Sizes with their deviations, or these alone.
fn sizes(amounts: &[Amount], with_values: bool) -> String {
    let size = |it: &Amount| {
        let what = if amounts.len() > 1 { format!("{} ", it.what) } else { String::new() };
        let value = if with_values { format!("{:+.3} ", it.value) } else { String::new() };
        format!("{what}{value}± {:.3} {}", it.sd, it.unit)
    };
    amounts.iter().map(size).collect::<Vec<_>>().join(", ")
}

/// The movements of the last event that has any.
fn movements(document: &mut Document, state: &Standing) {
    let Some(NamedMovements { joints, movements }) = state.told.iter().rev().find_map(|it| it.movements.as_ref())
    else {
        return;
    };
    document.heading("Movements that would tell best, and mend it");
    document.text(
        "Move the robot there, and add what is seen to the table like any other row. They are chosen by how much their readings tell of \
         what has changed, each given those before it.",
    );
    let axes = &state.watch.body().state.joints;
    let head = ["joint", "unit"].map(str::to_owned).into_iter();
    let numbers = (1..=movements.positions.len()).map(|number| format!("movement {number}"));
    let rows = joints.iter().zip(axes).enumerate().map(|(joint, (name, axis))| {
        let (factor, unit) = shown_in(axis);
        let cells = movements.positions.iter().map(|positions| format!("{:.1}", factor * positions[joint]));
        [name.clone(), unit.to_owned()].into_iter().chain(cells).collect()
    });
    document.parts.push(Part::Table(Table { words: 2, head: head.chain(numbers).collect(), rows: rows.collect() }));
    let leaves = movements.leaves.iter().filter(|it| it.probability >= UNLIKELY);
    let said = leaves.map(|it| {
        format!("If it is {}: its size will be known to {}{}.", alone(&it.name), sizes(&it.amounts, false), apart(it))
    });
    document.parts.push(Part::List(said.collect()));
}

fn sees(document: &mut Document, state: &Standing) {
    let shows = state.shows();
    let drifts = state.watch.drifts();
    if shows.is_empty() && drifts.is_empty() {
        return;
    }
    document.heading("What can be seen at all");
    if !shows.is_empty() {
        document.text(format!(
            "How well the latest {LATEST} sightings show the zero of each joint. An error of six deviations is found soon; one of three \
             mostly is not."
        ));
        document.table(1, ["joint", "one deviation", "found soon from"], shows.iter().map(Shown::cells));
    }
    if !drifts.is_empty() {
        document.parts.push(Part::List(drifts.iter().map(|it| drifting(it) + ".").collect()));
    }
}

/// Events and lines that were left out, the latest first.
fn told(document: &mut Document, state: &Standing) {
    if !state.told.is_empty() {
        document.heading("What was told");
        let said = state.told.iter().rev().take(LISTED);
        document
            .parts
            .push(Part::List(said.map(|it| format!("{}: {}", place(it.time.as_deref(), it.line), it.said)).collect()));
    }
    if !state.left_out.is_empty() {
        document.heading("What was left out");
        document.text(count(state.left_out.len(), "line"));
        let said = state.left_out.iter().rev().take(LISTED);
        document.parts.push(Part::List(said.map(|it| format!("line {}: {}", it.line, it.why)).collect()));
    }
}

fn place(time: Option<&str>, line: usize) -> String {
    time.map_or_else(|| format!("in line {line}"), |time| format!("{time} (line {line})"))
}

fn count(of: usize, what: &str) -> String {
    if of == 1 { format!("1 {what}") } else { format!("{of} {what}s") }
}
