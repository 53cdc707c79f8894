//! A document as one HTML file for print, without scripts and without anything from the network.

use std::fmt::Write;

use super::document::{Document, Part, Table};

const STYLE: &str = include_str!("report.css");

/// The number of letters beyond which a cell has several lines.
const LONG: usize = 36;

/// The text of a page, such as `report.html`.
pub fn page(document: &Document) -> String {
    let mut body = String::new();
    let mut section = false;
    for part in &document.parts {
        // Writing to a string does not fail.
        let _ = match part {
            Part::Heading(heading) => {
                let end = if std::mem::replace(&mut section, true) { "</section>\n" } else { "" };
                writeln!(body, "{end}<section>\n<h2>{}</h2>", escaped(heading))
            }
            Part::Text(said) => writeln!(body, "<p>{}</p>", escaped(said)),
            Part::Lead(said) => writeln!(body, "<p class=\"lead\">{}</p>", escaped(said)),
            Part::List(points) => {
                let points: String = points.iter().map(|point| format!("<li>{}</li>\n", escaped(point))).collect();
                writeln!(body, "<ul>\n{points}</ul>")
            }
            Part::Table(table) => writeln!(body, "{}", rows(table)),
            Part::Figure { svg, caption, .. } => {
                let caption = escaped(caption);
                writeln!(body, "<figure>\n{svg}<figcaption>{caption}</figcaption>\n</figure>")
            }
        };
    }
    if section {
        body.push_str("</section>\n");
    }
    let (title, subtitle) = (escaped(&document.title), escaped(&document.subtitle));
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n<p>{subtitle}</p>\n</header>\n\
         {body}</main>\n</body>\n</html>\n"
    )
}

fn rows(table: &Table) -> String {
    let line = |cells: &[String], tag: &str| {
        let cell = |(column, cell): (usize, &String)| {
            // Six numbers of a pose are wider than a page has room for.
            let class = match (column < table.words, cell.len() > LONG) {
                (true, _) => " class=\"words\"",
                (false, true) => " class=\"long\"",
                (false, false) => "",
            };
            format!("<{tag}{class}>{}</{tag}>", escaped(cell))
        };
        let cells: String = cells.iter().enumerate().map(cell).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = table.rows.iter().map(|row| line(row, "td")).collect();
    format!(
        "<div class=\"table\"><table>\n<thead>\n{}</thead>\n<tbody>\n{rows}</tbody>\n</table></div>",
        line(&table.head, "th")
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out_and_sections_close() {
        let mut document = Document { title: "<script>".into(), subtitle: "a & b".into(), parts: Vec::new() };
        document.heading("one");
        document.text("</p>");
        document.heading("two");
        let page = page(&document);
        assert!(!page.contains("<script>") && page.contains("a &amp; b") && page.contains("<p>&lt;/p&gt;</p>"));
        assert_eq!((page.matches("<section>").count(), page.matches("</section>").count()), (2, 2));
    }
}
