//! `paper.md`: the comparison with the paper as a table, a function of [`Report`] alone.

use std::fmt::Write;

use super::report::{Agreement, Report, Row};

/// The report as Markdown.
pub fn markdown(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_markdown(&mut text, report);
    text
}

fn write_markdown(out: &mut String, report: &Report) -> std::fmt::Result {
    let [first, last] = report.seeds;
    writeln!(out, "# The paper's experiments, rerun\n")?;
    writeln!(
        out,
        "Martinez-Cantin, Lopes and Montesano, *Body Schema Acquisition through Active Learning*, ICRA 2010, beside \
         body-schema {}, seeds {first} to {last}. Written by `body-schema paper{}` from `paper.json`.\n",
        report.version,
        if report.quick { " --quick" } else { "" }
    )?;
    if report.quick {
        writeln!(
            out,
            "**Quick: few seeds and short runs.** This shows that everything runs; its verdicts are no findings.\n"
        )?;
    }
    writeln!(
        out,
        "The paper's robot and its thresholds of convergence are not public. Ours are in the scenario files; a learner \
         has converged at the first movement from which its orientation and location errors stay within them. What can \
         agree is behaviour and order of magnitude, not digits.\n"
    )?;
    summary(out, report)?;
    for figure in &report.figures {
        writeln!(out, "![{}]({}.svg)\n\n*{}*\n", figure.title, figure.id, figure.caption)?;
    }
    writeln!(out, "## The paper said, we measured\n")?;
    writeln!(out, "| where | what | the paper said | we measured | agrees | runs |")?;
    writeln!(out, "|---|---|---|---|---|---|")?;
    for row in &report.rows {
        let verdict = row.agrees.map_or("–", Agreement::name);
        let runs = row.runs.map_or_else(|| "–".to_owned(), |runs| runs.to_string());
        let cells = [&row.figure, &row.what, &row.paper, &row.ours_text].map(|cell| escaped(cell));
        writeln!(out, "| {} | {verdict} | {runs} |", cells.join(" | "))?;
    }
    reasons(out, report, "Where we disagree, and why", |row| {
        matches!(row.agrees, Some(Agreement::No | Agreement::Partly))
    })?;
    reasons(out, report, "Where we agree, and how we judge", |row| row.agrees == Some(Agreement::Yes))?;
    reasons(out, report, "What was not measured", |row| row.agrees.is_none())?;
    repeat(out, report)
}

fn summary(out: &mut String, report: &Report) -> std::fmt::Result {
    let count = |wanted: Option<Agreement>| report.rows.iter().filter(|row| row.agrees == wanted).count();
    writeln!(
        out,
        "Of {} numbers and remarks we agree with {}, in part with {}, and disagree with {}; {} are not measured.\n",
        report.rows.len(),
        count(Some(Agreement::Yes)),
        count(Some(Agreement::Partly)),
        count(Some(Agreement::No)),
        count(None)
    )
}

fn reasons(out: &mut String, report: &Report, title: &str, which: impl Fn(&Row) -> bool) -> std::fmt::Result {
    let mut rows = report.rows.iter().filter(|row| which(row)).peekable();
    if rows.peek().is_none() {
        return Ok(());
    }
    writeln!(out, "\n## {title}\n")?;
    for row in rows {
        let verdict = row.agrees.map_or_else(String::new, |agrees| format!(" ({})", agrees.name()));
        writeln!(out, "* **{}, {}**{verdict}: {}", row.figure, row.what, row.why)?;
    }
    Ok(())
}

fn repeat(out: &mut String, report: &Report) -> std::fmt::Result {
    let mut commands: Vec<(&str, Vec<&str>)> = Vec::new();
    for row in &report.rows {
        if let Some(command) = row.command.as_deref() {
            match commands.iter_mut().find(|(known, _)| *known == command) {
                Some((_, ids)) => ids.push(&row.id),
                None => commands.push((command, vec![&row.id])),
            }
        }
    }
    if commands.is_empty() {
        return Ok(());
    }
    writeln!(out, "\n## How to repeat it\n\n| command | rows |\n|---|---|")?;
    for (command, ids) in commands {
        writeln!(out, "| `{}` | {} |", escaped(command), ids.join(", "))?;
    }
    Ok(())
}

/// A bar would end the cell.
fn escaped(cell: &str) -> String {
    cell.replace('|', "\\|").replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FigureEntry;

    fn row(id: &str, agrees: Option<Agreement>) -> Row {
        Row {
            id: id.to_owned(),
            figure: "Fig. 4".into(),
            what: "|x| of ours".into(),
            paper: "80".into(),
            paper_value: Some(80.0),
            ours: None,
            ours_text: "median 70".into(),
            unit: "movements".into(),
            agrees,
            why: format!("because of {id}"),
            experiment: Some("fig-4".into()),
            scenario: Some("arm-6dof".into()),
            seeds: Some("1..20".into()),
            runs: Some(20),
            command: Some("body-schema compare arm-6dof".into()),
        }
    }

    #[test]
    fn the_table_is_a_function_of_the_json() {
        let report = Report {
            version: "9.8.7".into(),
            quick: false,
            seeds: [1, 20],
            figures: vec![FigureEntry { id: "fig-4".into(), title: "Fig. 4".into(), caption: "curves".into() }],
            rows: vec![row("good", Some(Agreement::Yes)), row("bad", Some(Agreement::No)), row("later", None)],
        };
        let json = serde_json::to_string(&report).expect("JSON");
        let read: Report = serde_json::from_str(&json).expect("the same JSON");
        assert_eq!(read, report);
        let text = markdown(&read);
        assert_eq!(text, markdown(&report));
        for part in ["9.8.7", "| Fig. 4 | \\|x\\| of ours | 80 | median 70 | yes | 20 |", "because of bad", "fig-4.svg"]
        {
            assert!(text.contains(part), "{part}:\n{text}");
        }
        assert!(text.contains("agree with 1, in part with 0, and disagree with 1; 1 are not measured"));
        assert!(text.contains("good, bad, later"), "one command, three rows");
    }
}
