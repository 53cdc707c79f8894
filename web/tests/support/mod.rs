//! A panel with a page that is played by the test, and a server that is the engine.

pub mod robot;
mod server;

use body_schema_panel::{
    Panel,
    host::{Command, Event, Mirror},
};
use egui::{Modifiers, PointerButton, Pos2, Rect, TouchDeviceId, TouchId, TouchPhase, Vec2, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use serde_json::{Value, json};

pub use server::Server;

/// A panel on a screen of its own.
pub struct Page {
    pub harness: Harness<'static, Panel>,
    pub server: Server,
    /// What the panel said of itself last.
    pub mirror: Mirror,
    /// What the panel asked for and the test has not looked at.
    asked: Vec<Command>,
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
        let mut page = Self { harness, server: Server::default(), mirror: Mirror::default(), asked: Vec::new() };
        page.tell(json!({ "is": "begin", "query": query, "known": true }));
        page
    }

    /// A page whose session stands and has made its first step.
    pub fn with_session(query: &str) -> Self {
        let mut page = Self::open(query);
        page.begin();
        page
    }

    /// Tells the scenarios, opens the session that is asked for and makes its first step.
    pub fn begin(&mut self) {
        self.tell(Server::scenarios());
        self.open_session();
        self.make_steps(1);
    }

    /// Answers the request for a session.
    pub fn open_session(&mut self) {
        let opened = self.commands().into_iter().find_map(|command| match command {
            Command::Open { scenario, seed, learners, set, .. } => Some((scenario, seed, learners, set)),
            _ => None,
        });
        let (scenario, seed, learners, set) = opened.expect("the panel opens a session");
        self.server.replace(&set);
        self.server.open(&scenario, seed, learners.as_deref());
        self.follow();
    }

    /// Tells the session as it stands, from its first report on.
    pub fn follow(&mut self) {
        self.tell(self.server.session());
        self.tell(json!({ "is": "connected" }));
        self.catch_up();
    }

    /// Tells the reports that are new.
    pub fn catch_up(&mut self) {
        for report in self.server.news() {
            self.tell(json!({ "is": "live", "message": { "type": "step", "data": report } }));
        }
    }

    pub fn tell(&mut self, event: Value) {
        let event: Event = serde_json::from_value(event).expect("an event");
        self.harness.state_mut().receive(event);
        self.run();
    }

    /// Draws until nothing moves, or for a while where something always does.
    pub fn run(&mut self) {
        self.harness.run_steps(4);
        for command in self.harness.state_mut().take_commands() {
            match command {
                Command::Say(mirror) => self.mirror = *mirror,
                command => self.asked.push(command),
            }
        }
    }

    /// What the panel asked for since the last look, the mirror aside.
    pub fn commands(&mut self) -> Vec<Command> {
        self.run();
        std::mem::take(&mut self.asked)
    }

    /// Answers requests for steps until nothing more is asked for, or `most` were made; how many.
    pub fn make_steps(&mut self, most: u64) -> u64 {
        let mut made = 0;
        for _ in 0..2000 {
            let asked = self.commands().into_iter().find_map(|command| match command {
                Command::Step { count, expected_step, session, .. } => Some((count, expected_step, session)),
                _ => None,
            });
            let Some((count, expected, session)) = asked else {
                if !self.harness.state().playing || made >= most {
                    return made;
                }
                continue;
            };
            assert_eq!(expected, self.server.experiment().latest().step, "the panel knows where the session is");
            self.server.step(count);
            self.catch_up();
            made += count;
            let step = expected + count;
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

    /// Answers what the panel asks about a posture of the visitor's; whether it asked.
    pub fn answer_posture(&mut self) -> bool {
        self.harness.run_steps(20);
        let commands = self.commands();
        let asked = commands.iter().find_map(|command| match command {
            Command::Configure { learner, configuration, .. } => Some((learner.clone(), configuration.clone())),
            _ => None,
        });
        let Some((learner, configuration)) = asked else { return false };
        let answer = self.server.configure(&learner, &configuration);
        self.tell(answer);
        true
    }

    /// Answers all that the panel asks about the visitor's postures, its sliders' whole degrees and the map of the slice too.
    pub fn answer_postures(&mut self) {
        for _ in 0..8 {
            self.harness.run_steps(20);
            let answers: Vec<Value> = (self.commands().into_iter())
                .filter_map(|command| match command {
                    Command::Configure { learner, configuration, .. } => {
                        Some(self.server.configure(&learner, &configuration))
                    }
                    Command::Survey { session, learner, configurations } => {
                        let gain = |posture: &Vec<f64>| {
                            self.server.experiment().appraise(&learner, posture).expect("an appraisal").appraisal.gain
                        };
                        let gains: Vec<f64> = configurations.iter().map(gain).collect();
                        Some(json!({ "is": "surveyed", "session": session, "gains": gains }))
                    }
                    _ => None,
                })
                .collect();
            if answers.is_empty() {
                return;
            }
            answers.into_iter().for_each(|answer| self.tell(answer));
        }
    }

    /// Clicks on a point of the panel, whatever is there.
    pub fn click_at(&mut self, pos: Pos2) {
        self.harness.event(egui::Event::PointerMoved(pos));
        for pressed in [true, false] {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            self.harness.event(egui::Event::PointerButton { pos, button, pressed, modifiers });
            self.harness.run_steps(1);
        }
        self.run();
    }

    /// Swipes with a finger from a point upwards.
    pub fn swipe_up(&mut self, from: Pos2, by: f32) {
        let steps = 8;
        let mut touch = |phase, moved: f32| {
            let pos = from - vec2(0.0, moved);
            let (device_id, id) = (TouchDeviceId(0), TouchId(1));
            self.harness.event(egui::Event::Touch { device_id, id, phase, pos, force: None });
            match phase {
                TouchPhase::Move => self.harness.event(egui::Event::PointerMoved(pos)),
                TouchPhase::Start | TouchPhase::End | TouchPhase::Cancel => {
                    let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
                    self.harness.event(egui::Event::PointerMoved(pos));
                    let pressed = phase == TouchPhase::Start;
                    self.harness.event(egui::Event::PointerButton { pos, button, pressed, modifiers });
                }
            }
            self.harness.run_steps(1);
        };
        touch(TouchPhase::Start, 0.0);
        (1..=steps).for_each(|step| touch(TouchPhase::Move, by * step as f32 / steps as f32));
        touch(TouchPhase::End, by);
        self.harness.run_steps(40);
    }

    /// Where something is.
    pub fn place(&self, label: &str) -> Rect {
        self.harness.get_by_label(label).rect()
    }

    /// Brings what stands further down in a list into view.
    pub fn scroll_to(&mut self, label: &str) {
        self.harness.get_by_label(label).scroll_to_me();
        // The list moves smoothly.
        self.harness.run_steps(30);
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
