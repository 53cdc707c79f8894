//! The report for readers: Markdown, and one HTML file that prints well. Other pages that look like it are made from a [`Document`].

mod certificate;
mod contents;
mod document;
mod extras;
mod html;
mod markdown;
mod plots;

use body_schema_calibration::{Calibration, Case, File};
pub use certificate::{certificate_files, certificate_of_page, certificate_page};
pub use document::{Document, Part, Table};
pub use html::page;

/// The report in Markdown without drawings, to stand beside other drawings.
pub fn markdown(calibration: &Calibration, case: &Case<'_>) -> String {
    let mut document = contents::document(&calibration.report, case);
    document.parts.retain(|part| !matches!(part, Part::Figure { .. }));
    markdown::text(&document)
}

/// `report.md`, its drawings, and `report.html`.
pub fn files(calibration: &Calibration, case: &Case<'_>) -> Vec<File> {
    let document = contents::document(&calibration.report, case);
    let mut files = vec![File::new("report.md", markdown::text(&document)), File::new("report.html", page(&document))];
    for part in document.parts {
        if let Part::Figure { name, svg, .. } = part {
            files.push(File::new(format!("{name}.svg"), svg));
        }
    }
    files
}
