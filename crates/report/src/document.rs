//! A document in parts, whatever it is written as.

/// A part of a document.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// A heading of a section.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// What comes first and counts most.
    Lead(String),
    /// Points in a list.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A drawing as SVG, with what it shows.
    Figure {
        /// The name of its file, without an end.
        name: String,
        /// The drawing.
        svg: String,
        /// What it shows.
        caption: String,
    },
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// How many columns are aligned to the left, as words are; the others to the right, as numbers.
    pub words: usize,
    /// Titles of the columns.
    pub head: Vec<String>,
    /// Cells by row.
    pub rows: Vec<Vec<String>>,
}

/// A document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// One line below it.
    pub subtitle: String,
    /// What follows.
    pub parts: Vec<Part>,
}

impl Document {
    pub(super) fn heading(&mut self, text: &str) {
        self.parts.push(Part::Heading(text.to_owned()));
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.parts.push(Part::Text(text.into()));
    }

    /// A table whose first `words` columns hold words.
    pub(super) fn table<const N: usize>(
        &mut self,
        words: usize,
        head: [&str; N],
        rows: impl IntoIterator<Item = [String; N]>,
    ) {
        let head = head.map(str::to_owned).to_vec();
        self.parts.push(Part::Table(Table { words, head, rows: rows.into_iter().map(|row| row.to_vec()).collect() }));
    }
}
