//! Writing tables in which no spreadsheet takes text for a formula.
//!
//! Text that begins like a formula gets an apostrophe before it, as spreadsheets write it themselves; [`Table`](super::Table)
//! takes it away again.

use std::{borrow::Cow, io};

/// A writer of tables in CSV.
#[derive(Debug)]
pub struct Writer<W: io::Write>(csv::Writer<W>);

impl<W: io::Write> Writer<W> {
    /// A writer to `output`, which begins with the line of titles.
    pub fn new(output: W) -> Self {
        Self(csv::Writer::from_writer(output))
    }

    /// Writes a line.
    ///
    /// # Errors
    ///
    /// The output's error, or that the line has not as many cells as the first.
    pub fn write(&mut self, cells: impl IntoIterator<Item = impl AsRef<str>>) -> csv::Result<()> {
        for cell in cells {
            self.0.write_field(guarded(cell.as_ref()).as_bytes())?;
        }
        self.0.write_record(None::<&[u8]>)
    }

    /// Passes everything on to the output.
    ///
    /// # Errors
    ///
    /// The output's error.
    pub fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }

    /// The output, with everything written to it.
    ///
    /// # Errors
    ///
    /// The output's error.
    pub fn into_inner(self) -> io::Result<W> {
        self.0.into_inner().map_err(csv::IntoInnerError::into_error)
    }
}

/// Whether a spreadsheet would take a text for a formula. A number is none.
fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err()
}

fn guarded(text: &str) -> Cow<'_, str> {
    if is_formula(text) { format!("'{text}").into() } else { text.into() }
}

/// The cell as it was before it was guarded against formulas.
pub(super) fn unguarded(cell: &str) -> &str {
    cell.strip_prefix('\'').filter(|text| is_formula(text)).unwrap_or(cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Columns, Table};

    #[test]
    fn what_looks_like_a_formula_is_written_as_text_and_read_as_it_was() {
        let cells = ["=1+2", "+a", "-a", "@a", "-1.5", "+2", "-1e-3", "a=1", "'a", "", "-", "-inf"];
        let mut writer = Writer::new(Vec::new());
        writer.write(cells).and_then(|()| writer.write(cells)).expect("written");
        let text = String::from_utf8(writer.into_inner().expect("written")).expect("text");
        let line = "'=1+2,'+a,'-a,'@a,-1.5,+2,-1e-3,a=1,'a,,'-,-inf\n";
        assert_eq!(text, line.repeat(2));
        let table = Table::open(text.as_bytes()).expect("a table");
        assert_eq!(table.titles().all(), cells);
        let columns = Columns { labels: (0..cells.len()).collect(), ..Columns::default() };
        assert_eq!(table.rows(columns).next().expect("a row").expect("sound").labels, cells);
    }

    #[test]
    fn lines_are_as_long_as_the_first() {
        let mut writer = Writer::new(Vec::new());
        writer.write(["a", "b"]).expect("written");
        writer.write(["a"]).expect_err("short");
    }
}
