//! `verify`: a certificate computed anew from its data, and what differs.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use body_schema_calibration as calibration;
use body_schema_calibration::{CERTIFICATE, Case, Certificate, Difference, Issue, Options, hashes};
use body_schema_report as report;
use serde::Serialize;
use serde_json::Value;

use super::{
    BadInput,
    input::{files_of, load_scenario, read_data},
    output::{self, Outputs},
    progress::Bars,
    software,
};

/// Compute a certificate anew from its data, and say what differs.
///
/// The certificate is one of `body-schema calibrate --certificate`. The exit code is 0 if everything in it is found again, 1 if something is
/// not, and 2 if one of the two cannot be read.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A certificate: certificate.json, certificate.html, or the folder that holds them
    #[arg(value_name = "CERTIFICATE")]
    certificate: PathBuf,
    /// The path of the calibration file that it was issued for, or a built-in scenario with measured data
    #[arg(value_name = "DATA")]
    data: String,
    /// Write what was found as JSON to FILE as well, or to standard output for `-`
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What was found.
#[derive(Serialize)]
struct Found {
    /// Whether everything was found again.
    verified: bool,
    /// The program that issued it, and this one.
    issued_by: String,
    verified_by: String,
    differences: Vec<Difference>,
    /// What was not held against anything, in words; null where everything was.
    unchecked: Option<String>,
}

/// The most differences that are listed for people.
const LISTED: usize = 20;

pub fn verify(arguments: &Arguments) -> Result<()> {
    let Certified { path, certificate, differences: page, unchecked } = read(&arguments.certificate)?;
    if Path::new(&arguments.data).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        let what = format!("{} is a table; name the calibration file that names it, as measured.toml", arguments.data);
        return Err(BadInput(what).into());
    }
    let scenario = load_scenario(&arguments.data)?;
    scenario.check_prior()?;
    let case = Case::new(&scenario)?;
    let mut inputs = files_of(&arguments.data, &scenario);
    inputs.push(path.clone());
    Outputs::default().file("--json", arguments.json.as_deref()).check(&inputs)?;
    let mut differences = page;
    let others = rows(&certificate, &case);
    if others.is_empty() {
        let bars = Bars::default();
        let options = Options { folds: certificate.folds, active: None };
        let found = calibration::calibrate(&case, &options, &bars);
        bars.end();
        let issue = Issue {
            software: software(),
            file: arguments.data.clone(),
            folds: certificate.folds,
            at_s: certificate.issued_at_s,
        };
        differences.extend(certificate.differences(&Certificate::of(&found?, &case, &issue)));
    } else {
        differences.extend(others);
    }
    let verified = differences.is_empty();
    let (issued_by, verified_by) = (certificate.software.clone(), software());
    let found = Found { verified, issued_by, verified_by, differences, unchecked };
    if let Some(path) = &arguments.json {
        output::write_json(path, &found)?;
    }
    if !arguments.json.as_deref().is_some_and(output::is_stdout) {
        said(&found, &certificate)?;
    }
    match found.differences.len() {
        0 => Ok(()),
        1 => bail!("{}: 1 difference; it is not what this data gives", path.display()),
        count => bail!("{}: {count} differences; it is not what this data gives", path.display()),
    }
}

/// A certificate in a file or folder.
struct Certified {
    path: PathBuf,
    certificate: Certificate,
    /// What is in it that no certificate has: foreign fields, a page that shows something else than its JSON.
    differences: Vec<Difference>,
    /// What cannot be held against anything.
    unchecked: Option<String>,
}

fn read(path: &Path) -> Result<Certified> {
    let path = if path.is_dir() { path.join("certificate.json") } else { path.to_owned() };
    let bad = |what: String| BadInput(format!("{} {what}", path.display()));
    let text = read_data(&path).map_err(|error| bad(error.to_string()))?;
    let is_page = text.trim_start().starts_with('<');
    const NONE: &str = "is no certificate; name certificate.json or certificate.html of `calibrate --certificate`";
    let json = if is_page { report::certificate_of_page(&text).ok_or_else(|| bad(NONE.to_owned()))? } else { &text };
    let version = serde_json::from_str::<Value>(json)
        .map_err(|error| bad(format!("cannot be read: {error}; name a certificate that is whole")))?;
    match version.get("certificate").and_then(Value::as_u64) {
        None => return Err(bad(NONE.to_owned()).into()),
        Some(version) if version != u64::from(CERTIFICATE) => {
            let what = format!(
                "is of version {version}, and this program knows {CERTIFICATE}; use the program that issued it"
            );
            return Err(bad(what).into());
        }
        Some(_) => {}
    }
    let certificate: Certificate = serde_json::from_str(json)
        .map_err(|error| bad(format!("cannot be read: {error}; name a certificate that is whole")))?;
    let mut differences = certificate.foreign(&version);
    // Every number of the page is one of its JSON. Another version may lay it out in another way.
    let is_other = is_page && report::certificate_page(&certificate) != text.replace("\r\n", "\n");
    let is_same_program = certificate.software == software();
    if is_other && is_same_program {
        differences.push(Difference {
            field: "page".to_owned(),
            certified: Value::from("another text than its JSON makes"),
            found: Value::Null,
        });
    }
    let unchecked = (is_other && !is_same_program).then(|| {
        "what the page shows was not checked, since another version of the program laid it out: what is verified is the JSON in it; go by \
         certificate.json, or verify by the version that issued it"
            .to_owned()
    });
    Ok(Certified { path, certificate, differences, unchecked })
}

/// The rows of the data that are not those of the certificate.
fn rows(certificate: &Certificate, case: &Case<'_>) -> Vec<Difference> {
    let (certified, found) = (&certificate.data.rows, hashes(case));
    let of = |index: usize| {
        let found = match (found.get(index), case.rows.get(index)) {
            (Some(hash), Some(row)) => Value::from(format!("{hash}, {}", row.line)),
            _ => Value::Null,
        };
        let certified = certified.get(index).map_or(Value::Null, |hash| Value::from(hash.as_str()));
        Difference { field: format!("row {}", index + 1), certified, found }
    };
    let differ = |index: &usize| certified.get(*index) != found.get(*index);
    (0..certified.len().max(found.len())).filter(differ).map(of).collect()
}

fn said(found: &Found, certificate: &Certificate) -> Result<()> {
    if found.issued_by != found.verified_by {
        output::say(format!(
            "issued by {}, computed anew by {}: numbers are compared to a millionth, sentences and the page's layout are not",
            found.issued_by, found.verified_by
        ))?;
    }
    if let Some(unchecked) = &found.unchecked {
        output::say(unchecked)?;
    }
    if found.verified {
        return output::say(format!(
            "{}: verified: the same {} rows give all that it says, but for its date and command",
            certificate.name,
            certificate.data.rows.len()
        ));
    }
    if found.differences.iter().any(|it| it.field.starts_with("row ")) {
        output::say("the data is other than what was certified, and nothing was computed from it:")?;
    }
    let shown = |value: &Value| if value.is_null() { "nothing".to_owned() } else { value.to_string() };
    for Difference { field, certified, found } in found.differences.iter().take(LISTED) {
        output::say(format!("  {field}: certified {}, found {}", shown(certified), shown(found)))?;
    }
    match found.differences.len().saturating_sub(LISTED) {
        0 => Ok(()),
        more => output::say(format!("  and {more} more")),
    }
}
