//! The first steps of the first story, which a page shows for as long as the engine is on its way.

use std::path::Path;

use body_schema_backend::{Answer, Local};
use serde_json::{Value, json};

use super::{ExportError, Opening, write};
use crate::page::{self, gzip::Compressed};

/// The file.
const FIRST: &str = "first.json.gz";
/// So many steps are played at a newcomer's pace.
const STEPS: u64 = 14;
/// The id of the session in it, which the page knows the engine's by.
const ID: &str = "00000000-0000-4000-8000-000000000001";

/// What the page's panel opens for a newcomer: `STORIES[0]` of the panel, as its command `Open` says it.
fn story() -> Value {
    json!({ "scenario": "arm-6dof", "set": [], "seed": 4, "learners": ["active", "random", "global"],
        "ellipsoids": "1-sigma", "enlarge": 1 })
}

/// Writes them, where the page opens with the first story; the address of the file, with its version, as browsers keep it.
pub(super) fn write_steps(folder: &Path, opening: &Opening<'_>) -> Result<Option<String>, ExportError> {
    if !opening.query().is_empty() {
        return Ok(None);
    }
    let bytes = serde_json::to_vec(&steps()?)?;
    // What cannot be compressed is told by its first bytes.
    let packed = Compressed::default().of(&bytes).unwrap_or(bytes.into());
    write(&folder.join(FIRST), &packed)?;
    Ok(Some(format!("{FIRST}?v={}", page::version(&packed))))
}

/// The scenarios, the session as it is opened, and the messages of its steps.
fn steps() -> Result<Value, ExportError> {
    let mut local = Local::new(|| ID.to_owned());
    let scenarios = ask(&mut local, "GET", "/v1/scenarios", &Value::Null)?;
    let session = ask(&mut local, "POST", "/v1/sessions", &story())?;
    let count = json!({ "count": STEPS, "reports": false });
    ask(&mut local, "POST", &format!("/v1/sessions/{ID}/steps"), &count)?;
    let (_, messages) = local.news(ID, 0, 0).unwrap_or_default();
    let messages: Vec<String> = messages.iter().map(|message| without_times(message)).collect::<Result<_, _>>()?;
    Ok(json!({ "opening": story(), "scenarios": scenarios, "session": session, "messages": messages }))
}

/// What the backend answers.
fn ask(local: &mut Local, method: &str, path: &str, body: &Value) -> Result<Value, ExportError> {
    let Answer { status, body } = local.answered(method, path, body.to_string().as_bytes());
    if status >= 400 {
        return Err(ExportError::FirstSteps(String::from_utf8_lossy(&body).into_owned()));
    }
    Ok(serde_json::from_slice(&body)?)
}

/// A message without how long choices took here, so that an export is the same every time.
fn without_times(message: &str) -> Result<String, serde_json::Error> {
    let mut message: Value = serde_json::from_str(message)?;
    for learner in message["data"]["learners"].as_array_mut().into_iter().flatten() {
        if let Some(time) = learner.pointer_mut("/movement/selection_ms") {
            *time = json!(0.0);
        }
    }
    Ok(message.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_steps_are_few_bytes_and_the_same_every_time() {
        let [one, other] = [(); 2].map(|()| serde_json::to_vec(&steps().expect("steps")).expect("JSON"));
        assert!(one == other);
        let kept: Value = serde_json::from_slice(&one).expect("JSON");
        assert_eq!(kept["messages"].as_array().map(Vec::len), Some(STEPS as usize + 1));
        assert_eq!((&kept["session"]["id"], &kept["session"]["step"]), (&json!(ID), &json!(0)));
        let packed = Compressed::default().of(&one).expect("compressed");
        assert!(packed.len() < 300_000, "{} bytes", packed.len());
    }
}
