//! Descriptions from Denavit–Hartenberg parameters.
//!
//! Row i of a table holds θᵢ (the offset of the reading of a joint that turns), dᵢ, aᵢ and αᵢ, and takes frame i − 1 to frame i by
//!
//! ```text
//! standard   Rz(q + θᵢ) Tz(dᵢ) Tx(aᵢ) Rx(αᵢ)           J. Denavit and R. S. Hartenberg, 1955
//! modified   Rx(αᵢ) Tx(aᵢ) Rz(q + θᵢ) Tz(dᵢ)           J. J. Craig, Introduction to Robotics: his αᵢ₋₁ and aᵢ₋₁ stand in row i
//! ```
//!
//! with q the reading; a joint that slides has Tz(q + dᵢ) and Rz(θᵢ) in their places. In a URDF a joint's origin stands before its motion, so
//! that the fixed part of one row is spread over two joints.

use std::f64::consts::{PI, TAU};

use csv::{ReaderBuilder, StringRecord, Trim};

use body_schema_engine::{
    elementary::{cos, sin},
    numeric_range::is_usable,
    suggest::did_you_mean,
};

/// Which of the two conventions a table is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// That of Denavit and Hartenberg.
    Standard,
    /// That of Craig.
    Modified,
}

/// Why a table makes no description.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}; {hint}")]
pub struct DhError {
    /// The line, counted from 1.
    pub line: u64,
    /// What was found.
    pub what: String,
    /// What to do about it.
    pub hint: String,
}

fn refused(line: u64, what: impl Into<String>, hint: impl Into<String>) -> DhError {
    DhError { line, what: what.into(), hint: hint.into() }
}

/// A quantity of a row: its title without a unit, the units that it may have, and whether it must be there.
struct Quantity {
    title: &'static str,
    units: &'static [(&'static str, f64)],
}

const DEGREE: f64 = PI / 180.0;
const ANGLE: &[(&str, f64)] = &[("", 1.0), ("_rad", 1.0), ("_deg", DEGREE)];
const LENGTH: &[(&str, f64)] = &[("", 1.0), ("_m", 1.0), ("_mm", 1e-3)];
const THETA: Quantity = Quantity { title: "theta", units: ANGLE };
const D: Quantity = Quantity { title: "d", units: LENGTH };
const A: Quantity = Quantity { title: "a", units: LENGTH };
const ALPHA: Quantity = Quantity { title: "alpha", units: ANGLE };
const LIMITS: [&str; 2] = ["lower", "upper"];

/// The joint between the last link and the tool.
const FIXED: &str = "tool0_fixed";
/// The longest length, metres: beyond it a number is in millimetres.
const MOST_M: f64 = 20.0;
/// The most rows: more than any robot has joints.
const MOST_ROWS: usize = 100;

/// One row, rad and m.
struct Row {
    name: String,
    slides: bool,
    theta: f64,
    d: f64,
    a: f64,
    alpha: f64,
    limits: Option<(f64, f64)>,
}

/// The URDF of a table of Denavit–Hartenberg parameters, whose first link is `base_link` and whose last is `tool0`.
///
/// The table is CSV with a line of titles: `theta`, `d`, `a` and `alpha`, in rad and m or with `_deg` and `_mm` at their ends. Of these an
/// absent one is 0 everywhere, and so is an empty cell. `joint` names each joint (`joint_1`, … without it), `type` is `revolute` (the default)
/// or `prismatic`, and `lower` and `upper` (rad or m, or with `_deg` for joints that turn and `_mm` for those that slide) are its limits. A
/// joint that turns without limits is continuous.
///
/// # Errors
///
/// [`DhError`] names the line: titles that are not known or there twice, cells that are no numbers, limits that are missing or reversed, names
/// that are there twice, no row.
pub fn urdf_of_dh(name: &str, text: &str, convention: Convention) -> Result<String, DhError> {
    let rows = rows(text)?;
    let mut urdf =
        format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"base_link\"/>\n", escaped(name));
    // What the row before leaves for the next joint: θ, d, a, α.
    let mut left = [0.0; 4];
    for (index, row) in rows.iter().enumerate() {
        let Row { theta, d, a, alpha, .. } = *row;
        let origin = match convention {
            Convention::Standard => std::mem::replace(&mut left, [theta, d, a, alpha]),
            Convention::Modified => {
                let [theta_before, d_before, ..] = std::mem::replace(&mut left, [theta, d, 0.0, 0.0]);
                [theta_before, d_before, a, alpha]
            }
        };
        let parent = if index == 0 { "base_link".to_owned() } else { format!("link_{index}") };
        let child = format!("link_{}", index + 1);
        urdf.push_str(&format!("  <link name=\"{child}\"/>\n"));
        let kind = match (row.slides, row.limits) {
            (true, _) => "prismatic",
            (false, Some(_)) => "revolute",
            (false, None) => "continuous",
        };
        let limit = row.limits.map_or_else(String::new, |(lower, upper)| {
            format!("    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"0\" velocity=\"0\"/>\n")
        });
        urdf.push_str(&joint(
            &row.name,
            kind,
            (&parent, &child),
            origin,
            &format!("    <axis xyz=\"0 0 1\"/>\n{limit}"),
        ));
    }
    urdf.push_str("  <link name=\"tool0\"/>\n");
    urdf.push_str(&joint(FIXED, "fixed", (&format!("link_{}", rows.len()), "tool0"), left, ""));
    urdf.push_str("</robot>\n");
    Ok(urdf)
}

/// A joint whose origin is Rz(θ) Tz(d) Tx(a) Rx(α).
fn joint(name: &str, kind: &str, (parent, child): (&str, &str), [theta, d, a, alpha]: [f64; 4], more: &str) -> String {
    // The cosine of a quarter turn is 0 but for the rounding of π.
    let product = |cosine: f64| if cosine.abs() < 1e-15 { 0.0 } else { a * cosine };
    let (x, y) = (product(cos(theta)), product(sin(theta)));
    format!(
        "  <joint name=\"{}\" type=\"{kind}\">\n    <origin xyz=\"{x} {y} {d}\" rpy=\"{alpha} 0 {theta}\"/>\n    <parent \
         link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n{more}  </joint>\n",
        escaped(name)
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

fn rows(text: &str) -> Result<Vec<Row>, DhError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader =
        ReaderBuilder::new().trim(Trim::All).comment(Some(b'#')).flexible(true).from_reader(text.as_bytes());
    let broken = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        refused(line, error.to_string(), "write CSV: a line of titles, then one line per joint")
    };
    let titles: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_lowercase).collect();
    check_titles(&titles)?;
    let mut rows: Vec<Row> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() > titles.len() {
            let what = format!("{} cells stand below {} titles", record.len(), titles.len());
            return Err(refused(line, what, "give every cell a title"));
        }
        let row = Cells { titles: &titles, record: &record, line }.row(rows.len() + 1)?;
        if row.name == FIXED {
            return Err(refused(
                line,
                format!("`{FIXED}` is the fixed joint before tool0"),
                "name this joint otherwise",
            ));
        }
        if rows.iter().any(|other| other.name == row.name) {
            return Err(refused(line, format!("there are two joints `{}`", row.name), "give each a name of its own"));
        }
        if rows.len() == MOST_ROWS {
            return Err(refused(line, format!("there are more than {MOST_ROWS} rows"), "write one row per joint"));
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(refused(1, "there is no row", "write one line per joint below the titles"));
    }
    Ok(rows)
}

/// Refuses titles that are not known, and quantities that are there twice.
fn check_titles(titles: &[String]) -> Result<(), DhError> {
    let quantities = [THETA, D, A, ALPHA];
    let measured = quantities.iter().map(|it| it.titles());
    let limits = LIMITS.map(|limit| Quantity { title: limit, units: ANGLE }.titles());
    let lengths = LIMITS.map(|limit| Quantity { title: limit, units: &LENGTH[1..] }.titles());
    let limits = limits.into_iter().zip(lengths).map(|(angle, length)| [angle, length].concat());
    let single = [vec!["joint".to_owned()], vec!["type".to_owned()]];
    let known: Vec<String> = measured.clone().chain(limits).chain(single.clone()).flatten().collect();
    for (index, title) in titles.iter().enumerate() {
        if !known.contains(title) {
            let known = || known.iter().map(String::as_str);
            let hint = did_you_mean(title, known(), || {
                "the titles are joint, type, theta, d, a, alpha, lower, upper, with _deg or _mm for degrees and millimetres"
                    .to_owned()
            });
            return Err(refused(1, format!("`{title}` is no Denavit–Hartenberg parameter"), hint));
        }
        if titles[..index].contains(title) {
            return Err(refused(1, format!("`{title}` is there twice"), "leave one of them"));
        }
    }
    for group in measured {
        let mut there = titles.iter().filter(|title| group.contains(title));
        if let (Some(one), Some(other)) = (there.next(), there.next()) {
            return Err(refused(1, format!("`{one}` and `{other}` are the same"), "leave one of them"));
        }
    }
    if !titles.iter().any(|title| quantities.iter().any(|it| it.titles().contains(title))) {
        return Err(refused(1, "none of theta, d, a, alpha is there", "write a line of titles first"));
    }
    Ok(())
}

impl Quantity {
    fn titles(&self) -> Vec<String> {
        self.units.iter().map(|(unit, _)| format!("{}{unit}", self.title)).collect()
    }
}

/// The cells of one line.
struct Cells<'a> {
    titles: &'a [String],
    record: &'a StringRecord,
    line: u64,
}

impl Cells<'_> {
    fn row(&self, number: usize) -> Result<Row, DhError> {
        let name = self.text("joint").map_or_else(|| format!("joint_{number}"), str::to_owned);
        let slides = match self.text("type").map(str::to_lowercase).as_deref() {
            None | Some("revolute" | "r" | "continuous") => false,
            Some("prismatic" | "p") => true,
            Some(other) => {
                return Err(refused(
                    self.line,
                    format!("`{other}` is no type of joint"),
                    "write revolute or prismatic",
                ));
            }
        };
        let number = |quantity: &Quantity| Ok(self.number(quantity)?.unwrap_or(0.0));
        let (units, others) = if slides { (LENGTH, ["_deg", "_rad"]) } else { (ANGLE, ["_mm", "_m"]) };
        for title in LIMITS.iter().flat_map(|limit| others.map(|unit| format!("{limit}{unit}"))) {
            if self.text(&title).is_some() {
                let (what, does) = (format!("`{title}` is none of `{name}`"), if slides { "slides" } else { "turns" });
                return Err(refused(self.line, what, format!("leave the cell empty: the joint {does}")));
            }
        }
        let [lower, upper] = LIMITS.map(|title| self.number(&Quantity { title, units }));
        let limits = match (lower?, upper?) {
            (Some(lower), Some(upper)) if lower < upper => Some((lower, upper)),
            (Some(_), Some(_)) => {
                let what = format!("the limits of `{name}` are reversed or equal");
                return Err(refused(self.line, what, "write the lower one as lower"));
            }
            (None, None) if !slides => None,
            (lower, _) => {
                let missing = LIMITS[usize::from(lower.is_some())];
                let what = format!("`{name}` has no {missing} limit");
                let unit = if slides { "m, or _mm" } else { "rad, or _deg" };
                return Err(refused(self.line, what, format!("write it as {missing} ({unit} at the title's end)")));
            }
        };
        let (theta, d, a, alpha) = (number(&THETA)?, number(&D)?, number(&A)?, number(&ALPHA)?);
        Ok(Row { name, slides, theta, d, a, alpha, limits })
    }

    fn text(&self, title: &str) -> Option<&str> {
        let index = self.titles.iter().position(|known| known == title)?;
        self.record.get(index).filter(|cell| !cell.is_empty())
    }

    fn number(&self, quantity: &Quantity) -> Result<Option<f64>, DhError> {
        let written = quantity.units.iter().map(|(unit, factor)| (format!("{}{unit}", quantity.title), factor));
        let mut there = written.filter_map(|(title, factor)| Some((self.text(&title)?, title, factor)));
        let first = there.next();
        if let (Some((_, one, _)), Some((_, other, _))) = (&first, there.next()) {
            let what = format!("`{one}` and `{other}` are both there");
            return Err(refused(self.line, what, "leave one of the two cells empty"));
        }
        let Some((cell, title, factor)) = first else { return Ok(None) };
        let number = cell.parse::<f64>().ok().map(|number| number * factor).filter(|number| is_usable(*number));
        let number = number.ok_or_else(|| {
            refused(self.line, format!("`{cell}` in `{title}` is no number"), "write a number, as 0.25 or -90")
        })?;
        let (most, unit, other) = if quantity.units == ANGLE { (TAU, "rad", "_deg") } else { (MOST_M, "m", "_mm") };
        // Degrees and millimetres without their unit are the usual mistake.
        if number.abs() > most {
            let what = format!("`{cell}` in `{title}` is {number:.3} {unit}, more than any robot has");
            return Err(refused(self.line, what, format!("title it `{}{other}` if that is its unit", quantity.title)));
        }
        Ok(Some(number))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

    use super::*;
    use crate::Urdf;

    /// The UR5e as its maker prints it.
    const UR5E: &str = "joint,theta_deg,d_mm,a_mm,alpha_deg\n\
        shoulder_pan,0,162.5,0,90\nshoulder_lift,0,0,-425,0\nelbow,0,0,-392.2,0\n\
        wrist_1,0,133.3,0,90\nwrist_2,0,99.7,0,-90\nwrist_3,0,99.6,0,0\n";

    fn turn(axis: Vector3<f64>, angle: f64) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_scaled_axis(axis * angle))
    }

    fn shift(axis: Vector3<f64>, length: f64) -> Isometry3<f64> {
        Translation3::from(axis * length).into()
    }

    /// The product of the rows, as the conventions are written down.
    fn product(rows: &[[f64; 4]], slides: &[bool], q: &[f64], convention: Convention) -> Isometry3<f64> {
        let (x, z) = (Vector3::x(), Vector3::z());
        let mut pose = Isometry3::identity();
        for ((&[theta, d, a, alpha], slides), q) in rows.iter().zip(slides).zip(q) {
            let (turned, shifted) = if *slides { (theta, d + q) } else { (theta + q, d) };
            pose *= match convention {
                Convention::Standard => turn(z, turned) * shift(z, shifted) * shift(x, a) * turn(x, alpha),
                Convention::Modified => turn(x, alpha) * shift(x, a) * turn(z, turned) * shift(z, shifted),
            };
        }
        pose
    }

    #[test]
    fn the_description_is_the_product_of_the_rows() {
        let rows = [[0.3, 0.2, -0.4, 1.1], [-1.2, 0.05, 0.3, -0.7], [0.9, -0.3, 0.02, 2.0], [0.1, 0.4, 0.0, -1.5]];
        let slides = [false, true, false, false];
        let q = [0.7, 0.12, -1.9, 2.8];
        let mut text = "type,theta,d,a,alpha,lower,upper\n".to_owned();
        for ([theta, d, a, alpha], slides) in rows.iter().zip(slides) {
            let kind = if slides { "prismatic" } else { "revolute" };
            text.push_str(&format!("{kind},{theta},{d},{a},{alpha},-3,3\n"));
        }
        for convention in [Convention::Standard, Convention::Modified] {
            let urdf = Urdf::parse(&urdf_of_dh("robot", &text, convention).unwrap()).unwrap();
            let chain = urdf.chain("base_link", "tool0").unwrap();
            let (found, wanted) = (chain.tip_at(&q), product(&rows, &slides, &q, convention));
            let off = (found.inverse() * wanted).to_homogeneous() - nalgebra::Matrix4::identity();
            assert!(off.abs().max() < 1e-14, "{convention:?}: {off}");
        }
    }

    #[test]
    fn a_ur5e_stands_where_its_maker_says() {
        // At zero the arm is stretched out along -x; the flange is 0.8172 m out, 0.2329 m to the side and 0.0628 m high.
        let urdf = Urdf::parse(&urdf_of_dh("ur5e", UR5E, Convention::Standard).unwrap()).unwrap();
        let chain = urdf.chain("base_link", "tool0").unwrap();
        assert_eq!(chain.names()[..2], ["shoulder_pan", "shoulder_lift"]);
        let tip = chain.tip_at(&[0.0; 6]).translation.vector;
        let expected = Vector3::new(-0.8172, -0.2329, 0.0628);
        assert!((tip - expected).norm() < 1e-12, "{tip}");
    }

    #[test]
    fn what_is_no_table_is_refused() {
        let wrong = [
            ("", 1, "theta"),
            ("d,a\n", 1, "no row"),
            ("theta_degrees,d\n0,0\n", 1, "no Denavit"),
            ("theta,theta_deg\n0,0\n", 1, "are the same"),
            ("d,d\n0,0\n", 1, "twice"),
            ("joint,type\na,revolute\n", 1, "none of theta"),
            ("d,a\n0,1\n0,x\n", 3, "`x` in `a`"),
            ("d,a\n0,1e300\n", 2, "`1e300` in `a`"),
            ("d,a\n0,1,2\n", 2, "3 cells"),
            ("type,d\nspherical,0\n", 2, "no type"),
            ("type,d\nprismatic,0\n", 2, "no lower limit"),
            ("d,lower,upper\n0,1,-1\n", 2, "reversed"),
            ("d,lower_deg,upper\n0,1,\n", 2, "no upper limit"),
            ("joint,d\none,0\none,0\n", 3, "two joints"),
            ("alpha,d\n90,0\n", 2, "title it `alpha_deg`"),
            ("d\n300\n", 2, "title it `d_mm`"),
            ("d,lower,upper\n0,-170,170\n", 2, "title it `lower_deg`"),
            ("d,lower,lower_deg,upper\n0,-1,-90,1\n", 2, "are both there"),
            ("d,lower_mm,upper_mm\n0,-100,100\n", 2, "the joint turns"),
            ("joint,d\ntool0_fixed,0\n", 2, "name this joint otherwise"),
        ];
        for (text, line, says) in wrong {
            let refused = urdf_of_dh("robot", text, Convention::Standard).expect_err(text);
            assert!(refused.line == line && refused.to_string().contains(says), "{text:?}: {refused}");
        }
        assert!(urdf_of_dh("robot", "Theta_Deg;d\n0;0\n", Convention::Standard).is_err());
    }
}
