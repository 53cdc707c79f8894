//! A text turned into strict XML, with every byte that is kept at its place.
//!
//! Readers of URDFs are lenient: to them a prefix of an undeclared namespace is a part of a name, and text before the declaration
//! does not matter. Here a description becomes strict XML before it is parsed, and no byte moves, so that places reported by the
//! parser are places in the description.

use std::borrow::Cow;

/// The character that stands in names for the colon of a prefix: a name character that hardly any name has.
pub const COLON: char = '.';

/// The byte order mark.
const MARK: char = '\u{feff}';

/// The text with [`COLON`] for the colons in names of elements and attributes, with blanks for the declaration of XML, for a `<!DOCTYPE>`
/// without entities and for byte order marks behind the first, and without the hyphens in comments. Every byte of the rest is what and
/// where it was, and so are all ends of lines.
///
/// # Errors
///
/// The place (a byte) of a tag that has more than `most` attributes: a parser compares each with all others.
pub fn plain(text: &str, most: usize) -> Result<Cow<'_, str>, usize> {
    let mut plain = String::with_capacity(text.len());
    let (mut done, mut is_within) = (0, false);
    while let Some(at) = text[done..].find('<').map(|at| done + at) {
        if is_within {
            plain.push_str(&text[done..at]);
        } else {
            before_root(&text[done..at], done == 0, &mut plain);
        }
        let rest = &text[at..];
        let end = |start: &str, end: &str| {
            let found = rest.strip_prefix(start)?.find(end);
            Some(found.map_or(rest.len(), |found| start.len() + found + end.len()))
        };
        let length = if let Some(length) = end("<!--", "-->") {
            comment(&rest[..length], &mut plain);
            length
        } else if let Some(length) = end("<![CDATA[", "]]>") {
            plain.push_str(&rest[..length]);
            length
        } else if let Some(length) = end("<?", "?>") {
            let is_declaration =
                rest[2..].starts_with("xml") && rest[5..].starts_with(|c: char| c.is_ascii_whitespace() || c == '?');
            if is_declaration && !is_within {
                blanks(&rest[..length], &mut plain);
            } else {
                plain.push_str(&rest[..length]);
            }
            length
        } else if rest.starts_with("<!") {
            doctype(rest, &mut plain)
        } else {
            is_within = true;
            let (length, attributes) = tag(rest, &mut plain);
            if attributes > most {
                return Err(at);
            }
            length
        };
        done = at + length;
    }
    plain.push_str(&text[done..]);
    debug_assert_eq!(plain.len(), text.len());
    Ok(if plain == text { Cow::Borrowed(text) } else { Cow::Owned(plain) })
}

/// Cleans the text between markup before the first element. A byte order mark that begins the text is left to the
/// parser.
fn before_root(text: &str, is_start: bool, plain: &mut String) {
    for (at, c) in text.char_indices() {
        if c == MARK && !(is_start && at == 0) {
            (0..MARK.len_utf8()).for_each(|_| plain.push(' '));
        } else {
            plain.push(c);
        }
    }
}

/// Writes blanks for everything but the ends of lines.
fn blanks(text: &str, plain: &mut String) {
    text.bytes().for_each(|byte| plain.push(if matches!(byte, b'\n' | b'\r') { byte.into() } else { ' ' }));
}

/// Blanks out a <!DOCTYPE>, unless it defines entities, which the parser refuses; returns its length.
fn doctype(text: &str, plain: &mut String) -> usize {
    let end = text.find('>').map_or(text.len(), |end| end + 1);
    let (found, is_whole) = (&text[..end], text[..end].ends_with('>'));
    if is_whole && found.starts_with("<!DOCTYPE") && !found.contains('[') {
        blanks(found, plain);
    } else {
        plain.push_str(found);
    }
    end
}

/// Writes a comment without the hyphens inside it: two hyphens end a comment.
fn comment(text: &str, plain: &mut String) {
    match text.strip_prefix("<!--").and_then(|inner| inner.strip_suffix("-->")) {
        Some(inner) => {
            plain.push_str("<!--");
            plain.push_str(&inner.replace('-', " "));
            plain.push_str("-->");
        }
        None => plain.push_str(text),
    }
}

/// Writes a tag, up to the `>` that ends it; returns its length and the number of its attributes.
fn tag(text: &str, plain: &mut String) -> (usize, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (None, ':') => {
                plain.push(COLON);
                continue;
            }
            (None, '"' | '\'') => quote = Some(c),
            (None, '=') => attributes += 1,
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
        plain.push(c);
        if quote.is_none() && c == '>' {
            return (at + 1, attributes);
        }
    }
    (text.len(), attributes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_lose_their_colons_and_nothing_else_does() {
        for (text, wanted) in [
            ("<a:b c:d=\"e:f\" g='h:i>'>j:k</a:b>", "<a.b c.d=\"e:f\" g='h:i>'>j:k</a.b>"),
            ("<!-- a:b -- <c:d> --><e:f/>", "<!-- a:b    <c:d> --><e.f/>"),
            ("<r><![CDATA[<a:b>]]><?a:b c:d?></r>", "<r><![CDATA[<a:b>]]><?a:b c:d?></r>"),
            ("\n<?xml\nversion='1.0'?>\u{feff}<r/>", "\n     \n               \u{20}  <r/>"),
            ("\u{feff}<r>\u{feff}</r>", "\u{feff}<r>\u{feff}</r>"),
            ("<r><?xml version='1.0'?></r>", "<r><?xml version='1.0'?></r>"),
            ("<!DOCTYPE r SYSTEM\n'a'>\n<r/>", "                  \n    \n<r/>"),
            ("<!DOCTYPE r [<!ENTITY a 'b'>]><r/>", "<!DOCTYPE r [<!ENTITY a 'b'>]><r/>"),
            ("<r a:b='c", "<r a.b='c"),
            ("<!-- a--", "<!-- a--"),
        ] {
            assert_eq!(plain(text, 9).expect("few attributes"), wanted, "{text}");
        }
        assert!(matches!(plain("<robot name=\"a:b\"/>", 9), Ok(Cow::Borrowed(_))));
    }

    #[test]
    fn a_tag_of_many_attributes_is_found() {
        let many = |count: usize| (0..count).map(|k| format!(" a{k}='='")).collect::<String>();
        for (text, wanted) in [
            (format!("<r><a{}/></r>", many(3)), None),
            (format!("<r><a{}/></r>", many(4)), Some(3)),
            (format!("<r{}>", many(4)), Some(0)),
            (format!("<!-- <a{}/> --><r b='<a c=\"1\" d=\"2\" e=\"3\" f=\"4\"'/>", many(4)), None),
            (format!("<r{}", many(9)), Some(0)),
        ] {
            assert_eq!(plain(&text, 3).err(), wanted, "{text}");
        }
    }

    proptest! {
        #[test]
        fn no_byte_moves(text in "[<>!?\\-:'\"=a \n\u{feff}é\\[\\]]{0,60}|(<\\?xml|<!--|-->|<a:b |>|\\?>|\u{feff}|é){0,12}") {
            let plain = plain(&text, usize::MAX).expect("as many as there are");
            prop_assert_eq!(plain.len(), text.len());
            prop_assert_eq!(plain.matches('\n').count(), text.matches('\n').count());
        }
    }
}
