//! The verdict: whether the result should be used.

use serde::{Deserialize, Serialize};

use super::{HeldOut, MoreRows, Unit};
use body_schema_diagnostics::{Diagnostic, DiagnosticKind};
use body_schema_engine::model::listed;

/// The answer to the reader's first question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Use {
    /// Use it.
    Yes,
    /// Use it within the stated limits.
    Limited,
    /// Do not use it.
    No,
}

/// The answer, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The answer.
    pub r#use: Use,
    /// Why, in words.
    pub because: String,
}

/// The share by which held-out errors must fall for a gain.
const GAINED: f64 = 0.02;
/// What is less is not seen in the digits that are told.
const LEAST_GAIN: f64 = 1e-3;
/// The largest share of rows that may be outliers.
const OUTLIERS: f64 = 0.1;

/// The grounds of a verdict.
pub(super) struct Grounds<'a> {
    pub doubts: &'a [Diagnostic],
    pub held_out: Option<&'a HeldOut>,
    pub more_rows: &'a MoreRows,
    /// The number of rows that are likelier outliers than not, and of all rows.
    pub outliers: (usize, usize),
    pub unit: Unit,
    /// The standard deviation of a span of 1 m, millimetres, for a robot of which no measurement tells how large it is.
    pub unsized_mm: Option<f64>,
}

impl Verdict {
    /// Judges a report: first whether the table means what it says, then held-out rows, then what they do not tell.
    pub(super) fn of(grounds: &Grounds<'_>) -> Self {
        let Grounds { doubts, held_out, more_rows, outliers, unit, unsized_mm } = grounds;
        let answer = |r#use: Use, because: String| Self { r#use, because };
        if let Some(doubt) = doubts.iter().find(|doubt| is_grave(doubt.kind)) {
            let column = doubt.column.as_ref().map(|column| format!("`{column}`: ")).unwrap_or_default();
            return answer(Use::No, format!("of a doubt that is to be looked into first: {column}{}", doubt.what));
        }
        let means = held_out.map(|it| (it.before.told(*unit)[0], it.after.told(*unit)[0]));
        let Some((Some(before), Some(after))) = means else {
            let because = "no row was held out, or none that predicts: how good it is on new rows is not known";
            return answer(Use::Limited, because.to_owned());
        };
        let compared = format!(
            "on rows that it has not seen it misses by {after:.2} {unit} on average, the nominal robot by {before:.2} {unit}"
        );
        if after > before {
            return answer(Use::No, format!("{compared}: keep the description"));
        }
        if after > before * (1.0 - GAINED) || before - after < LEAST_GAIN {
            return answer(Use::No, format!("{compared}: nothing is gained, keep the description"));
        }
        let mut limits = Vec::new();
        if doubts.iter().any(|doubt| doubt.kind == DiagnosticKind::Leakage) {
            limits.push("some of these rows repeat postures that it has learned from".to_owned());
        }
        let constant = doubts.iter().filter(|doubt| doubt.kind == DiagnosticKind::Constant);
        let constant: Vec<String> = constant.filter_map(|it| Some(format!("`{}`", it.column.as_ref()?))).collect();
        if !constant.is_empty() {
            let moves = if constant.len() == 1 { "moves" } else { "move" };
            limits.push(format!(
                "these rows do not tell what {} {moves}: elsewhere than there it is as described",
                listed(constant)
            ));
        }
        if outliers.0 as f64 > OUTLIERS * outliers.1 as f64 {
            limits.push(format!("{} of {} rows are taken for outliers", outliers.0, outliers.1));
        }
        if more_rows.untold_mm > more_rows.wanted_mm {
            limits.push(format!(
                "nothing tells {:.2} mm of what is expected where the hand is: only what is measured is predicted as well",
                more_rows.untold_mm
            ));
        }
        limits.extend(unsized_mm.map(|mm| {
            format!(
                "nothing but the description tells how large it is, a span of 1 m to ± {mm:.1} mm: write `distance_m` of two sockets below \
                 [sockets]"
            )
        }));
        if *unit == Unit::Millimetres && after > more_rows.wanted_mm {
            limits.push(format!("{:.2} mm are wanted", more_rows.wanted_mm));
        }
        match limits.as_slice() {
            [] => answer(Use::Yes, compared),
            _ => answer(Use::Limited, format!("{compared}; but {}", limits.join(", and "))),
        }
    }

    /// The verdict in one line, about `of`.
    pub fn said(&self, of: &str) -> String {
        let answer = match self.r#use {
            Use::Yes => "yes",
            Use::Limited => "within limits",
            Use::No => "no",
        };
        format!("use {of}: {answer}, because {}", self.because)
    }
}

/// Whether a doubt of this kind means that a table may say something other than it seems to.
fn is_grave(kind: DiagnosticKind) -> bool {
    use DiagnosticKind::{Base, Lag, Mirror, Misfit, Order, Pose, Sign, Size, Still, Unit, Zero};
    matches!(kind, Base | Lag | Mirror | Misfit | Order | Pose | Sign | Size | Still | Unit | Zero)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Figures;

    fn of_sockets(before: f64, after: f64, untold_mm: f64, doubts: &[Diagnostic], unsized_mm: Option<f64>) -> Verdict {
        let figures = |mean| Figures { readings: 20, mean_mm: Some(mean), ..Figures::default() };
        let held_out =
            HeldOut { before: figures(before), after: figures(after), full_model: figures(after), folds: Vec::new() };
        let more_rows = MoreRows {
            rows: 20,
            expected_mm: None,
            from_parameters_mm: None,
            model_error_mm: 0.0,
            untold_mm,
            held_out_mm: None,
            wanted_mm: 1.0,
            rows_needed: None,
            rows_needed_if_noise: None,
            said: String::new(),
        };
        let grounds = Grounds {
            doubts,
            held_out: Some(&held_out),
            more_rows: &more_rows,
            outliers: (1, 20),
            unit: Unit::Millimetres,
            unsized_mm,
        };
        Verdict::of(&grounds)
    }

    fn verdict(before: f64, after: f64, untold_mm: f64, doubts: &[Diagnostic]) -> Verdict {
        of_sockets(before, after, untold_mm, doubts, None)
    }

    /// A ball that meets itself says nothing of lengths: without a distance of two sockets the file is good for no more than that.
    #[test]
    fn a_robot_of_unknown_size_is_used_within_limits() {
        let verdict = of_sockets(5.0, 0.5, 0.1, &[], Some(9.8));
        assert!(
            verdict.r#use == Use::Limited && verdict.because.contains("± 9.8 mm: write `distance_m`"),
            "{verdict:?}"
        );
    }

    #[test]
    fn a_file_is_used_where_it_is_better_and_nothing_speaks_against_it() {
        assert_eq!(verdict(5.0, 0.5, 0.1, &[]).r#use, Use::Yes);
        assert_eq!(verdict(0.5, 0.6, 0.1, &[]).r#use, Use::No);
        assert_eq!(verdict(0.5, 0.495, 0.1, &[]).r#use, Use::No);
        assert_eq!(verdict(5.0, 1.5, 0.1, &[]).r#use, Use::Limited);
        assert_eq!(verdict(5.0, 0.5, 3.0, &[]).r#use, Use::Limited);
        let doubt = |kind| Diagnostic {
            kind,
            column: Some("elbow".to_owned()),
            lines: Vec::new(),
            what: "its sign is reversed".to_owned(),
            evidence: String::new(),
            hint: String::new(),
        };
        let reversed = verdict(5.0, 0.5, 0.1, &[doubt(DiagnosticKind::Sign)]);
        assert_eq!(
            reversed.said("calibrated.urdf"),
            "use calibrated.urdf: no, because of a doubt that is to be looked into first: `elbow`: its sign is reversed"
        );
        assert_eq!(verdict(5.0, 0.5, 0.1, &[doubt(DiagnosticKind::Limits)]).r#use, Use::Yes);
        assert_eq!(verdict(5.0, 0.5, 0.1, &[doubt(DiagnosticKind::Still)]).r#use, Use::No);
        assert_eq!(verdict(3e-9, 1e-9, 0.1, &[]).r#use, Use::No);
        let constant = verdict(5.0, 0.5, 0.1, &[doubt(DiagnosticKind::Constant)]);
        assert_eq!(constant.r#use, Use::Limited);
        assert!(constant.because.ends_with("do not tell what `elbow` moves: elsewhere than there it is as described"));
    }
}
