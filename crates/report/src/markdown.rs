//! A document as Markdown, with its drawings in files beside it.

use std::fmt::Write;

use super::document::{Document, Part, Table};

/// The text of `report.md`.
pub fn text(document: &Document) -> String {
    let mut text = format!("# {}\n\n{}\n", escaped(&document.title), escaped(&document.subtitle));
    for part in &document.parts {
        text.push('\n');
        // Writing to a string does not fail.
        let _ = match part {
            Part::Heading(heading) => writeln!(text, "## {}", escaped(heading)),
            Part::Text(said) => writeln!(text, "{}", escaped(said)),
            Part::Lead(said) => writeln!(text, "**{}**", escaped(said)),
            Part::List(points) => points.iter().try_for_each(|point| writeln!(text, "- {}", escaped(point))),
            Part::Table(table) => write!(text, "{}", rows(table)),
            Part::Figure { name, caption, .. } => {
                let caption = escaped(caption);
                writeln!(text, "![{caption}]({name}.svg)\n\n*{caption}*")
            }
        };
    }
    text
}

fn rows(table: &Table) -> String {
    let line =
        |cells: &[String]| format!("| {} |\n", cells.iter().map(|cell| escaped(cell)).collect::<Vec<_>>().join(" | "));
    let rule: Vec<&str> =
        (0..table.head.len()).map(|column| if column < table.words { "---" } else { "---:" }).collect();
    let rows: String = table.rows.iter().map(|row| line(row)).collect();
    format!("{}| {} |\n{rows}", line(&table.head), rule.join(" | "))
}

/// Text with the characters escaped that Markdown would interpret: names come from files.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' | '*' | '_' | '[' | ']' | '<' | '>' | '|' => escaped.extend(['\\', c]),
            '\n' | '\r' => escaped.push(' '),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out() {
        let mut document = Document { title: "a|b".into(), subtitle: "*x*".into(), parts: Vec::new() };
        document.table(1, ["joint", "mm"], [["arm_1\n|<b>".to_owned(), "1.0".to_owned()]]);
        let expected = "# a\\|b\n\n\\*x\\*\n\n| joint | mm |\n| --- | ---: |\n| arm\\_1 \\|\\<b\\> | 1.0 |\n";
        assert_eq!(text(&document), expected);
    }
}
