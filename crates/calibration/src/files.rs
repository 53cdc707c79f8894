//! The output files: URDF, YAML and JSON.

use std::fmt::Write;

use super::{
    Calibration, CalibrationError, Case, Extra, Fit, Progress,
    learned::{axis, fitted_part},
};
use body_schema_engine::model::{Correction, State};
use nalgebra::Isometry3;

/// An output file, with its path below the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Its path, with `/`.
    pub path: String,
    /// Its text.
    pub text: String,
}

impl File {
    /// A file.
    pub fn new(path: impl Into<String>, text: String) -> Self {
        Self { path: path.into(), text }
    }
}

impl Case<'_> {
    /// The URDF with the axes and offsets of a state, as `calibrated.urdf` has them; `None` without a URDF.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Unwritable`] if an axis is farther from the description than a URDF's gauge reaches.
    pub fn urdf_of(&self, state: &State) -> Result<Option<String>, CalibrationError> {
        self.urdf_with(state, &[])
    }

    /// The same where links have moved rigidly since, see [`Chain::fitted_with`](body_schema_robot::Chain::fitted_with).
    ///
    /// # Errors
    ///
    /// Those of [`urdf_of`](Self::urdf_of).
    pub fn urdf_with(
        &self,
        state: &State,
        moved_links: &[(usize, Isometry3<f64>)],
    ) -> Result<Option<String>, CalibrationError> {
        let Some(description) = &self.described else { return Ok(None) };
        let fitted = description.chain.fitted_with(&fitted_part(state), moved_links)?;
        Ok(Some(description.urdf.written(&fitted.chain)))
    }
}

impl Calibration {
    /// All files but those for readers: `calibrated.urdf` and `kinematics.yaml` where there is a URDF, those of the folds,
    /// `readings.yaml` and `report.json`.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Unwritable`] if an axis is farther from the description than a URDF's gauge reaches.
    pub fn files(&self, case: &Case<'_>) -> Result<Vec<File>, CalibrationError> {
        let mut files = described("", case, &self.fit)?;
        for (fold, fit) in self.folds.iter().enumerate() {
            files.extend(described(&format!("folds/{fold}/"), case, fit)?);
        }
        files.push(File::new("readings.yaml", self.readings_yaml(case)?));
        files.push(self.report_json());
        Ok(files)
    }

    /// `report.json`, also of a fit that no URDF can hold.
    pub fn report_json(&self) -> File {
        // What is serialised holds numbers, names and lists alone.
        let json = serde_json::to_string_pretty(&self.report).unwrap_or_default();
        File::new("report.json", json + "\n")
    }

    /// `calibrated.urdf` and `kinematics.yaml` alone, equal to those of [`files`](Self::files), without judging them: no folds,
    /// and nothing that a URDF cannot hold. Empty without a URDF.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`] if the table has no rows or the fit fails, and [`CalibrationError::Unwritable`] if an axis is
    /// farther from the description than a URDF's gauge reaches.
    pub fn description(case: &Case<'_>, progress: &dyn Progress) -> Result<Vec<File>, CalibrationError> {
        let splits = case.splits(None)?;
        let Some(first) = splits.first() else { return Err(CalibrationError::NoRows) };
        let mut training = first.training.clone();
        if splits.len() > 1 {
            training.extend(&first.held_out);
            training.sort_unstable();
        }
        if training.is_empty() {
            return Err(CalibrationError::NoRows);
        }
        progress.stage("all training rows", 2);
        let nominal = case.nominal(&training)?;
        progress.advance()?;
        let fit = case.fit(&case.writable(), &training, Some(nominal.state()))?;
        progress.advance()?;
        described("", case, &fit)
    }

    /// The extended model as YAML: the corrections of readings, and the axes that belong to them.
    fn readings_yaml(&self, case: &Case<'_>) -> Result<String, CalibrationError> {
        let loads = self.extended.state().loads.as_deref().filter(|_| self.extras.contains(&Extra::Compliance));
        let bent = if loads.is_some() { " + compliance·τ" } else { "" };
        let mut text = format!(
            "# What a URDF cannot hold: θ = offset + ratio q + sine sin q + cosine cos q{bent}, with q what a joint reports \
             (rad, m).\n# These axes and corrections belong together: they are not those of calibrated.urdf.\n"
        );
        if loads.is_some() {
            text.push_str(
                "# τ are the torques about the joint of the loads at the target and at the elbow; compliance is in rad per N·m of 1 kg.\n",
            );
        }
        if self.extras.is_empty() {
            text.push_str("# Nothing was kept: with ratios, eccentricity or compliance the training rows did not predict each other better.\n");
        }
        text.push_str("readings:\n");
        for (name, correction) in case.names.joints.iter().zip(&self.extended.state().corrections) {
            let Correction { offset, ratio, sine, cosine, compliance: [target, elbow] } = correction;
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {}:\n    offset: {offset:?}\n    ratio: {ratio:?}", quoted(name));
            let _ = writeln!(text, "    sine: {sine:?}\n    cosine: {cosine:?}");
            if loads.is_some() {
                let _ = writeln!(text, "    compliance: [{target:?}, {elbow:?}]");
            }
        }
        if let Some(loads) = loads {
            text.push_str(&case.loads_yaml(loads));
        }
        match &case.described {
            Some(description) => {
                let chain = description.chain.fitted(&without_corrections(self.extended.state()))?.chain;
                text.push_str(&chain.kinematics_yaml());
            }
            None => text.push_str(&axes_yaml(case, self.extended.state())),
        }
        Ok(text)
    }
}

fn described(folder: &str, case: &Case<'_>, fit: &Fit) -> Result<Vec<File>, CalibrationError> {
    let Some(description) = &case.described else { return Ok(Vec::new()) };
    let chain = description.chain.fitted(&fitted_part(fit.state()))?.chain;
    Ok(vec![
        File::new(format!("{folder}calibrated.urdf"), description.urdf.written(&chain)),
        File::new(format!("{folder}kinematics.yaml"), chain.kinematics_yaml()),
    ])
}

/// The axes at θ = 0 in the base's frame, metres.
fn axes_yaml(case: &Case<'_>, state: &State) -> String {
    let mut text = "axes:\n".to_owned();
    let list = |numbers: nalgebra::Vector3<f64>| format!("[{:?}, {:?}, {:?}]", numbers.x, numbers.y, numbers.z);
    for (name, joint) in case.names.joints.iter().zip(&state.slid_towards(case.guess()).joints) {
        let (direction, point) = axis(joint);
        let _ = writeln!(text, "  {}:\n    axis: {}", quoted(name), list(direction));
        if let Some(point) = point {
            let _ = writeln!(text, "    point_m: {}", list(point));
        }
    }
    text
}

/// A name as a key of YAML; JSON's strings are YAML's.
fn quoted(name: &str) -> String {
    serde_json::Value::from(name).to_string()
}

fn without_corrections(state: &State) -> State {
    let mut state = state.clone();
    state.corrections.fill(Correction::default());
    state
}
