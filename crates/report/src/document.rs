//! A document in parts, independent of the format it is written in.

/// A part of a document.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// A heading of a section.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// The lead paragraph, which matters most.
    Lead(String),
    /// Points in a list.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A drawing as SVG, with what it shows.
    Figure {
        /// The name of its file, without an extension.
        name: String,
        /// The drawing.
        svg: String,
        /// Its caption.
        caption: String,
    },
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The number of left-aligned columns, which hold words; the others hold numbers and are aligned to the right.
    pub words: usize,
    /// The titles of the columns.
    pub head: Vec<String>,
    /// The cells, row by row.
    pub rows: Vec<Vec<String>>,
}

/// A document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// One line below it.
    pub subtitle: String,
    /// Its parts.
    pub parts: Vec<Part>,
}

impl Document {
    /// Begins a section.
    pub fn heading(&mut self, text: &str) {
        self.parts.push(Part::Heading(text.to_owned()));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: impl Into<String>) {
        self.parts.push(Part::Text(text.into()));
    }

    /// Adds a table whose first `words` columns hold words.
    pub fn table<const N: usize>(
        &mut self,
        words: usize,
        head: [&str; N],
        rows: impl IntoIterator<Item = [String; N]>,
    ) {
        let head = head.map(str::to_owned).to_vec();
        self.parts.push(Part::Table(Table { words, head, rows: rows.into_iter().map(|row| row.to_vec()).collect() }));
    }
}

/// A number with two decimals, or a dash.
pub(super) fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"))
}

/// `said` as a sentence: with a capital and a full stop.
pub(super) fn sentence(said: &str) -> String {
    let mut letters = said.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}
