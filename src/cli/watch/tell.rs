//! Who is told of alarms and recoveries: standard output, a log, a webhook.

use std::{
    collections::HashSet,
    fs::{File, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use serde_json::Value;

use body_schema_sightings::{NamedMovements, Told, UNLIKELY, alone, apart};

use super::{BadInput, shown};
use crate::cli::{input::read_text, output};

/// The most bytes of a log that are read again.
const MOST_LOG: u64 = 256 << 20;
/// The most times that a webhook is tried, the first wait between two tries, and the longest.
const TRIES: u32 = 12;
const FIRST_WAIT: Duration = Duration::from_secs(1);
const LONGEST_WAIT: Duration = Duration::from_secs(600);
/// The time that an address has to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The time that the program waits for deliveries before it ends.
const AT_THE_END: Duration = Duration::from_secs(15);

pub struct Teller {
    log: Option<(File, PathBuf)>,
    /// What the log holds from before.
    logged: HashSet<Known>,
    /// Whether lines are those of a file: of what is sent every line may be the second.
    has_lines: bool,
    webhook: Option<Webhook>,
    is_quiet: bool,
}

struct Webhook {
    send: mpsc::Sender<String>,
    working: thread::JoinHandle<()>,
}

impl Teller {
    pub fn new(
        log: Option<&Path>,
        webhook: Option<String>,
        is_quiet: bool,
        has_lines: bool,
        inputs: &[PathBuf],
    ) -> Result<Self> {
        let mut logged = HashSet::new();
        let log = log.map(|path| -> Result<(File, PathBuf)> {
            if inputs.iter().any(|input| same_file::is_same_file(input, path).unwrap_or(false)) {
                let path = shown(path);
                return Err(BadInput(format!(
                    "--log {path} would be added to what this command reads; name another file with --log"
                ))
                .into());
            }
            if path.exists() {
                let text = read_text(path, MOST_LOG).map_err(|why| BadInput(format!("--log {} {why}", shown(path))))?;
                logged.extend(text.lines().filter_map(|line| known(&serde_json::from_str(line).ok()?)));
            }
            let cannot = || format!("cannot add to {}; name a file that may be written to with --log", shown(path));
            let file = OpenOptions::new().create(true).append(true).open(path).with_context(cannot)?;
            Ok((file, path.to_owned()))
        });
        Ok(Self { log: log.transpose()?, logged, has_lines, webhook: webhook.map(Webhook::new).transpose()?, is_quiet })
    }

    /// Tells of an event, but for one that the log holds from before.
    pub fn tell(&mut self, told: &Told) -> Result<()> {
        if !self.is_quiet {
            say(told)?;
        }
        let value = serde_json::to_value(told).context("cannot write JSON")?;
        let may_be_known = self.has_lines || told.time.is_some();
        if may_be_known && known(&value).is_some_and(|known| self.logged.contains(&known)) {
            return Ok(());
        }
        if let Some((file, path)) = &mut self.log {
            let cannot = || format!("cannot add to {}; is there room?", path.display());
            // One write for a line: another reader never sees half of it.
            file.write_all(format!("{value}\n").as_bytes()).with_context(cannot)?;
        }
        if let Some(webhook) = &self.webhook {
            drop(webhook.send.send(value.to_string()));
        }
        Ok(())
    }

    /// Waits for what is still to be delivered, for a while.
    pub fn end(&mut self) {
        let Some(Webhook { send, working }) = self.webhook.take() else { return };
        drop(send);
        let began = Instant::now();
        while !working.is_finished() && began.elapsed() < AT_THE_END {
            thread::sleep(Duration::from_millis(20));
        }
        if !working.is_finished() {
            output::tell(
                "warning: the webhook has not answered in time; what it was to be told is in the log, if there is one",
            );
        }
    }
}

/// What an event is known by in a log: kind, scenario, time and digest of the row, its line, and the suspect.
type Known = ([String; 4], u64, String);

fn known(value: &Value) -> Option<Known> {
    let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    let suspect = value.pointer("/explanations/0/suspect").map(Value::to_string).unwrap_or_default();
    Some((["kind", "scenario", "time", "row"].map(text), value.get("line")?.as_u64()?, suspect))
}

fn say(told: &Told) -> Result<()> {
    let place = told.time.as_ref().map_or_else(String::new, |time| format!(", {time}"));
    output::say(format!("line {}{place}: {}", told.line, told.said))?;
    for other in told.explanations.iter().skip(1).filter(|it| it.probability >= UNLIKELY) {
        output::say(format!("  or {} ({:.0} %)", alone(&other.name), 100.0 * other.probability))?;
    }
    let Some(NamedMovements { joints, movements }) = &told.movements else { return Ok(()) };
    output::say("  movements that would tell best, rad or m:")?;
    for (number, positions) in movements.positions.iter().enumerate() {
        let named = joints.iter().zip(positions).map(|(joint, q)| format!("{joint} {q:.3}"));
        output::say(format!("  {}. {}", number + 1, named.collect::<Vec<_>>().join(", ")))?;
    }
    for it in movements.leaves.iter().filter(|it| it.probability >= UNLIKELY) {
        let sds: Vec<String> = it.amounts.iter().map(|amount| format!("{:.3} {}", amount.sd, amount.unit)).collect();
        output::say(format!("  if it is {}: its size to ± {}{}", alone(&it.name), sds.join(", "), apart(it)))?;
    }
    Ok(())
}

impl Webhook {
    fn new(url: String) -> Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("cannot start")?;
        let client = reqwest::Client::builder().timeout(PATIENCE).build().context("cannot start a client of HTTP")?;
        let (send, receive) = mpsc::channel::<String>();
        let work = move || {
            for body in receive {
                runtime.block_on(deliver(&client, &url, &body));
            }
        };
        let working = thread::Builder::new().name("webhook".to_owned()).spawn(work).context("cannot start")?;
        Ok(Self { send, working })
    }
}

/// Sends one event until it is taken: a refusal (4xx) is not sent again, but for 408 and 429.
async fn deliver(client: &reqwest::Client, url: &str, body: &str) {
    let mut wait = FIRST_WAIT;
    for attempt in 1..=TRIES {
        let sent = client.post(url).header("content-type", "application/json").body(body.to_owned()).send().await;
        let why = match sent {
            Ok(answer) if answer.status().is_success() => return,
            Ok(answer) => {
                let status = answer.status();
                if status.is_client_error() && ![408, 429].contains(&status.as_u16()) {
                    output::tell(format_args!("warning: the webhook refuses the event: {status}"));
                    return;
                }
                status.to_string()
            }
            Err(error) => error.without_url().to_string(),
        };
        if attempt == TRIES {
            output::tell(format_args!("warning: the webhook did not take the event in {TRIES} tries: {why}"));
            return;
        }
        if attempt == 1 {
            output::tell(format_args!("warning: the webhook did not take the event: {why}; it is tried again"));
        }
        tokio::time::sleep(wait).await;
        wait = (wait * 2).min(LONGEST_WAIT);
    }
}
