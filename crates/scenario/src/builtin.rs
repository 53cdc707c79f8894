//! The scenarios that are built into the program.

use super::{Scenario, ScenarioError, error::suggest};

/// A scenario file that is part of the program.
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// Its name.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
}

macro_rules! builtins {
    ($($name:literal),* $(,)?) => {
        &[$(Builtin { name: $name, text: include_str!(concat!("../../../scenarios/", $name, ".toml")) }),*]
    };
}

/// All built-in scenarios, simplest first.
pub const BUILTIN: &[Builtin] = builtins![
    "arm-6dof",
    "arm-6dof-doubled-error",
    "arm-6dof-no-prior",
    "arm-6dof-selectors",
    "arm-6dof-table",
    "arm-6dof-outliers",
    "arm-6dof-camera",
    "hand-eye-6dof",
    "humanoid-eyes",
    "humanoid-eyes-paper-error",
    "humanoid-two-arms",
    "two-arms",
    "hobby-arm-webcam",
    "arm-6dof-pose-gears",
    "arm-7dof-eccentric",
    "arm-7dof-socket",
    "panda-calibration",
    "arm-12dof",
    "arm-12dof-no-prior",
    "magnetic-tracker",
    "arm-20dof",
    "head-fov",
    "head-fov-excursion",
    "head-fov-doubled-error",
    "head-fov-doubled-error-up-to",
    "body-change",
    "tiago-mocap",
    "tiago-mocap-3",
    "talos-contact",
    "ur10-camera",
    "fr3-hand-eye",
    "positioner",
    "panda-sockets",
    "kinova-sockets",
];

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../scenarios/", $name)))),*]
    };
}

/// The files that they name: tables of measurements, and descriptions of robots.
const DATA: &[(&str, &str)] = files![
    "tiago-mocap.csv",
    "tiago-mocap-1504.csv",
    "tiago.urdf",
    "talos-contact.csv",
    "talos.urdf",
    "ur10-camera.csv",
    "ur10.urdf",
    "fr3-hand-eye.csv",
    "positioner.csv",
    "positioner.urdf",
    "panda-sockets.csv",
    "panda.urdf",
    "kinova-sockets.csv",
    "gen3lite.urdf",
];

/// Whether a file with this text is among those that built-in scenarios name.
pub fn ships(text: &str) -> bool {
    DATA.iter().any(|(_, known)| *known == text)
}

/// The built-in scenario of that name.
///
/// # Errors
///
/// [`ScenarioError::UnknownScenario`] if no built-in scenario has that name.
pub fn builtin(name: &str) -> Result<Scenario, ScenarioError> {
    let names = || BUILTIN.iter().map(|builtin| builtin.name);
    let Some(found) = BUILTIN.iter().find(|builtin| builtin.name == name) else {
        return Err(ScenarioError::UnknownScenario {
            name: name.to_owned(),
            suggested: suggest(name, names()).map(str::to_owned),
            known: names().map(str::to_owned).collect(),
        });
    };
    Scenario::parse(&format!("scenarios/{name}.toml"), found.text, &|file| {
        DATA.iter()
            .find(|(name, _)| *name == file)
            .map(|(_, text)| (*text).to_owned())
            .ok_or_else(|| "is not among the built-in data".to_owned())
    })
}
