//! What an observation costs a robot of seven joints that tells it over HTTP: beside a server that keeps nothing, and early and late in
//! a session. Both servers take turns within one run, so that ratios count. Then what it takes a long session to come back to memory, and
//! to leave out an observation, early or late.
//!
//! `cargo bench --bench observations`

use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

use body_schema::{
    scenario::{Robot, builtin},
    server::{Options, serve},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use reqwest::{Client, RequestBuilder};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// So many are told.
const TOLD: usize = 1000;
/// And so many by the one that is kept.
const LONG: usize = 5000;
/// Medians are of those before these numbers, so many.
const AT: [usize; 2] = [200, TOLD];
const OF: usize = 100;
const SIGMA_M: f64 = 0.0005;

/// A session on a server of its own.
struct Kept {
    client: Client,
    session: String,
    observations: String,
    times: Vec<Duration>,
    shutdown: CancellationToken,
}

/// A server, its address, and what ends it.
async fn served(data_dir: Option<&Path>) -> (String, CancellationToken) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let options = Options { data_dir: data_dir.map(Into::into), ..Options::default() };
    let shutdown = CancellationToken::new();
    let serving = serve(listener, options, shutdown.clone());
    tokio::spawn(async { serving.await.expect("no error") });
    (address, shutdown)
}

/// How long it takes whoever asks as often as the server is busy.
async fn answered(asking: impl Fn() -> RequestBuilder) -> Duration {
    let began = Instant::now();
    loop {
        let answer = asking().send().await.expect("an answer");
        if answer.status() != 503 {
            assert_eq!(answer.status(), 200);
            return began.elapsed();
        }
    }
}

impl Kept {
    async fn open(data_dir: Option<&Path>) -> Self {
        let (address, shutdown) = served(data_dir).await;
        let client = Client::new();
        let calibration = json!({
            "robot": { "urdf": include_str!("../scenarios/panda.urdf"), "base": "panda_link0", "tip": "panda_link8" },
            "sensor": { "channel": "position", "sigma_m": SIGMA_M },
        });
        let opening = json!({ "world": "outside", "calibration": calibration });
        let opened = client.post(format!("http://{address}/v1/sessions")).json(&opening).send().await;
        let session: Value = opened.expect("an answer").json().await.expect("a session");
        let id = session["id"].as_str().expect("an id");
        let session = format!("/v1/sessions/{id}");
        let observations = format!("http://{address}{session}/observations");
        Self { client, session, observations, times: Vec::new(), shutdown }
    }

    /// How long the answer takes to whoever asks for a suggestion.
    async fn suggested(&self, address: &str) -> Duration {
        let suggestions = format!("http://{address}{}/suggestions", self.session);
        answered(|| self.client.post(&suggestions).json(&json!({}))).await
    }

    async fn tell(&mut self, told: &Value) {
        let began = Instant::now();
        let answered = self.client.post(&self.observations).json(told).send().await.expect("an answer");
        let status = answered.status();
        let answer = answered.bytes().await.expect("a body");
        self.times.push(began.elapsed());
        assert_eq!(status, 201, "{}", String::from_utf8_lossy(&answer));
    }

    fn median(&self, before: usize) -> Duration {
        median(&self.times[before - OF..before])
    }
}

fn median(times: &[Duration]) -> Duration {
    let mut times = times.to_vec();
    times.sort_unstable();
    times[times.len() / 2]
}

/// A posture drawn over the joint limits, and where the marker is seen there.
fn draw(robot: &Robot, rng: &mut ChaCha8Rng) -> Value {
    let limits = robot.limits.joints().iter();
    let posture: Vec<f64> = limits.map(|(lower, upper)| rng.random_range(*lower..*upper)).collect();
    let marker: [f64; 3] = robot.state.marker_at(&posture).coords.into();
    let noise = |rng: &mut ChaCha8Rng| -> f64 { SIGMA_M * Distribution::<f64>::sample(&StandardNormal, rng) };
    let seen = marker.map(|metres| metres + noise(rng));
    let configuration: BTreeMap<&String, f64> = robot.names.iter().zip(posture).collect();
    json!({ "configuration": configuration, "measurements": { "marker": seen } })
}

/// What one synchronised write of as many bytes costs in this folder.
fn write(folder: &Path, bytes: usize) -> Duration {
    let connection = rusqlite::Connection::open(folder.join("yardstick.sqlite")).expect("a database");
    connection.pragma_update(None, "journal_mode", "TRUNCATE").expect("set");
    connection.pragma_update(None, "synchronous", "FULL").expect("set");
    connection.execute("CREATE TABLE event (text TEXT)", []).expect("a table");
    let text = "x".repeat(bytes);
    let times = (0..OF).map(|_| {
        let began = Instant::now();
        connection.execute("INSERT INTO event VALUES (?1)", [&text]).expect("written");
        began.elapsed()
    });
    median(&times.collect::<Vec<_>>())
}

#[tokio::main]
async fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = builtin("panda-calibration").expect("built in").robot;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut sessions = [Kept::open(None).await, Kept::open(Some(folder.path())).await];
    let mut bytes = 0;
    for number in 0..TOLD {
        let told = draw(&robot, &mut rng);
        // The answer is kept too.
        bytes = 2 * told.to_string().len();
        for turn in 0..sessions.len() {
            sessions[(number + turn) % 2].tell(&told).await;
        }
    }
    let write = write(folder.path(), bytes);
    println!("one synchronised write of {bytes} bytes: {write:.1?}");
    let [ephemeral, kept] = &sessions;
    for before in AT {
        let (without, with) = (ephemeral.median(before), kept.median(before));
        let rest = with.saturating_sub(write).as_secs_f64() / without.as_secs_f64();
        println!(
            "observations up to {before}: {without:.1?} keeping nothing, {with:.1?} kept: {rest:.2} times that beside the write"
        );
    }
    let grown = kept.median(AT[1]).as_secs_f64() / kept.median(AT[0]).as_secs_f64();
    println!("observation {} costs {grown:.2} times observation {}", AT[1], AT[0]);
    let [_, mut kept] = sessions;
    while kept.times.len() < LONG {
        kept.tell(&draw(&robot, &mut rng)).await;
    }
    let grown = kept.median(LONG).as_secs_f64() / kept.median(AT[0]).as_secs_f64();
    println!("observation {LONG} costs {grown:.2} times observation {}", AT[0]);
    kept.shutdown.cancel();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let (address, _shutdown) = served(Some(folder.path())).await;
    let suggested = kept.suggested(&address).await;
    let again = kept.suggested(&address).await;
    println!("a session of {LONG} observations comes back to memory in {:.1?}", suggested.saturating_sub(again));
    for number in [LONG - 10, LONG / 2, 1] {
        let observation = format!("http://{address}{}/observations/{number}", kept.session);
        let excluded = answered(|| kept.client.delete(&observation)).await;
        println!("observation {number} of {LONG} is excluded in {excluded:.1?}");
    }
}
