//! A panel with a page that is played by the test.
#![allow(dead_code, reason = "each test uses a part")]

use body_schema_panel::{
    Panel,
    host::{Command, Event},
};
use egui::{Vec2, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use serde_json::{Value, json};

/// A panel on a screen of its own.
pub struct Page {
    pub harness: Harness<'static, Panel>,
    /// What the panel asked for and the test has not looked at.
    asked: Vec<Command>,
    step: u64,
    /// How many learners are compared.
    learners: usize,
}

impl Page {
    /// A page that has just been opened.
    pub fn open(query: &str) -> Self {
        Self::of_size(query, vec2(460.0, 1400.0))
    }

    pub fn of_size(query: &str, size: Vec2) -> Self {
        let harness = Harness::builder()
            .with_size(size)
            .with_max_steps(50)
            .build_ui_state(|ui, panel: &mut Panel| panel.ui(ui), Panel::default());
        harness.ctx.set_theme(egui::Theme::Light);
        let mut page = Self { harness, asked: Vec::new(), step: 0, learners: 3 };
        page.tell(json!({ "is": "begin", "query": query, "known": true }));
        page
    }

    /// A page whose session stands, at step 0.
    pub fn with_session(query: &str) -> Self {
        let mut page = Self::open(query);
        page.tell(scenarios());
        page.open_session();
        page
    }

    /// Answers the request for a session.
    pub fn open_session(&mut self) {
        let opened = self.commands().into_iter().find_map(|command| match command {
            Command::Open { scenario, seed, learners, .. } => Some((scenario, seed, learners)),
            _ => None,
        });
        let (scenario, seed, learners) = opened.expect("the panel opens a session");
        self.step = 0;
        let session = session(&scenario, seed, learners);
        self.learners = session["description"]["learners"].as_array().expect("learners").len();
        self.tell(json!({ "is": "session", "session": session }));
        self.tell(json!({ "is": "connected" }));
        self.report(|_, _| {});
    }

    pub fn tell(&mut self, event: Value) {
        let event: Event = serde_json::from_value(event).expect("an event");
        self.harness.state_mut().receive(event);
        self.run();
    }

    /// Draws until nothing moves, or for a while where something always does.
    pub fn run(&mut self) {
        self.harness.run_steps(4);
        let commands = self.harness.state_mut().take_commands();
        self.asked.extend(commands);
    }

    /// What the panel asked for since the last look, the mirror aside.
    pub fn commands(&mut self) -> Vec<Command> {
        self.run();
        let asked = std::mem::take(&mut self.asked);
        asked.into_iter().filter(|command| !matches!(command, Command::Say(_))).collect()
    }

    /// The next step's report, changed by `change` per learner.
    pub fn report(&mut self, change: impl Fn(usize, &mut Value)) {
        let report = report(self.step, self.learners, change);
        self.step += 1;
        self.tell(json!({ "is": "live", "message": { "type": "step", "data": report } }));
    }

    /// Answers requests for steps until nothing more is asked for, or `most` were made; how many.
    pub fn make_steps(&mut self, most: u64, change: impl Fn(u64, usize, &mut Value)) -> u64 {
        let mut made = 0;
        for _ in 0..2000 {
            let asked = self.commands().into_iter().find_map(|command| match command {
                Command::Step { count, expected_step, session } => Some((count, expected_step, session)),
                _ => None,
            });
            let Some((count, expected, session)) = asked else {
                if !self.harness.state().playing || made >= most {
                    return made;
                }
                continue;
            };
            assert_eq!(expected, self.step - 1, "the panel knows where the session is");
            for _ in 0..count {
                let step = self.step;
                self.report(|learner, value| change(step, learner, value));
                made += 1;
            }
            let step = self.step - 1;
            self.tell(json!({ "is": "stepped", "session": session, "step": step }));
            self.tell(json!({ "is": "shown", "step": step }));
            if made >= most {
                return made;
            }
        }
        made
    }

    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.run();
    }

    pub fn toggle(&mut self, label: &str) {
        self.harness.get_by_role_and_label(egui::accesskit::Role::CheckBox, label).click();
        self.run();
    }

    pub fn has(&self, label: &str) -> bool {
        self.harness.query_all_by_label_contains(label).next().is_some()
    }

    pub fn press(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.run();
    }
}

pub fn scenarios() -> Value {
    json!({ "is": "scenarios", "scenarios": [scenario("arm-6dof", 1000), scenario("head-fov", 2000)] })
}

fn learners() -> Value {
    json!([
        { "name": "active", "estimator": "rls", "policy": "active" },
        { "name": "random", "estimator": "rls", "policy": "random" },
        { "name": "gradient", "estimator": "gradient", "policy": "random" },
    ])
}

fn compositions() -> Value {
    json!([{ "name": "smoother:random", "estimator": "smoother", "policy": "random" }])
}

fn joints() -> Value {
    json!([
        { "name": "shoulder", "kind": "revolute", "learned": true, "limits": [-1.5, 1.5] },
        { "name": "elbow", "kind": "revolute", "learned": true, "limits": [0.0, 2.0] },
    ])
}

fn scenario(name: &str, steps: u64) -> Value {
    json!({
        "name": name, "title": format!("The arm of {name}"), "world": "simulated", "joints": joints(), "parameters": 8,
        "steps": steps, "learners": learners(), "compositions": compositions(), "thresholds": { "orientation_deg": 5.0, "location_m": 0.02 },
    })
}

pub fn session(scenario: &str, seed: u64, chosen: Option<Vec<String>>) -> Value {
    let all = [learners(), compositions()];
    let own = chosen.is_none();
    let all = all.iter().take(if own { 1 } else { 2 }).flat_map(|list| list.as_array().expect("learners"));
    let chosen: Vec<&Value> =
        all.filter(|one| chosen.as_ref().is_none_or(|names| names.iter().any(|name| one["name"] == *name))).collect();
    json!({
        "id": format!("{scenario}-{seed}"), "step": 0, "remaining": null,
        "description": {
            "scenario": scenario, "title": "An arm", "seed": seed, "joints": joints(), "learners": chosen,
            "thresholds": { "orientation_deg": 5.0, "location_m": 0.02 }, "truth": { "joints": [] },
        },
    })
}

pub fn report(step: u64, learners: usize, change: impl Fn(usize, &mut Value)) -> Value {
    let learners: Vec<Value> = (0..learners)
        .map(|index| {
            let error = 40.0 / (1.0 + step as f64 * [0.4, 0.1, 0.02][index]);
            let mut learner = json!({
                "movement": { "gain": 0.1, "selection_ms": 0.3 },
                "metrics": {
                    "orientation_deg": error, "location_m": error / 200.0, "prediction_mean_m": error / 100.0,
                    "trace": if index == 2 { Value::Null } else { json!(error / 10.0) },
                    "movements": step, "misses": 0, "settled": false,
                },
                "failure": null,
            });
            change(index, &mut learner);
            learner
        })
        .collect();
    json!({ "step": step, "learners": learners })
}

/// A selection as the server sends it: two joints, three iterations of DIRECT-l.
pub fn selection(step: u64) -> Value {
    let one =
        |centre: [f64; 2], value: f64, shapes: Value| json!({ "centre": centre, "value": value, "shapes": shapes });
    let (third, sixth) = (1.0 / 3.0, 1.0 / 6.0);
    json!({
        "step": step, "learner": "active", "variant": "direct-l", "epsilon": 1e-4, "trace": 2.0, "evaluations": 7,
        "joints": [{ "name": "shoulder", "limits": [-1.5, 1.5] }, { "name": "elbow", "limits": [0.0, 2.0] }],
        "chosen": { "box": 2, "configuration": [1.0, 1.0], "point": [5.0 * sixth, 0.5], "criterion": 1.4,
            "predicted_gain": 0.6, "realised_gain": 0.5 },
        "boxes": [
            one([0.5, 0.5], 1.9, json!([{ "iteration": 0, "levels": [0, 0] }, { "iteration": 1, "levels": [1, 1] }])),
            one([sixth, 0.5], 1.8, json!([{ "iteration": 1, "levels": [1, 0] }])),
            one([5.0 * sixth, 0.5], 1.4,
                json!([{ "iteration": 1, "levels": [1, 0] }, { "iteration": 2, "levels": [1, 1] }])),
            one([0.5, sixth], 1.95, json!([{ "iteration": 1, "levels": [1, 1] }])),
            one([0.5, 5.0 * sixth], 1.7, json!([{ "iteration": 1, "levels": [1, 1] }])),
            one([5.0 * sixth, sixth], 1.5, json!([{ "iteration": 2, "levels": [1, 1] }])),
            json!({ "centre": [5.0 * sixth, 0.5 + third], "value": null, "shapes": [{ "iteration": 2, "levels": [1, 1] }] }),
        ],
        "iterations": [
            { "iteration": 0, "evaluations": 1, "best": 1.9, "best_box": 0, "hull": [0] },
            { "iteration": 1, "evaluations": 5, "best": 1.4, "best_box": 2, "hull": [2] },
            { "iteration": 2, "evaluations": 7, "best": 1.4, "best_box": 2, "hull": [2, 1] },
        ],
    })
}
