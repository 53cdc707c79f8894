//! A robot elsewhere, of two joints, and the session that the server would have with it.

use std::collections::BTreeMap;

use body_schema_ask_tell::{Ask, Observation, Outcome, Session, Setup, Suggestion};
use body_schema_panel::host::Command;
use serde_json::{Value, json};

use super::{Page, Server};

const URDF: &str = r#"<robot name="two">
  <link name="base"/> <link name="upper"/> <link name="lower"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.2"/> <parent link="base"/> <child link="upper"/> <axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <origin xyz="0.3 0 0"/> <parent link="upper"/> <child link="lower"/> <axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
</robot>"#;

/// The session's id.
pub const ID: &str = "0c2d4a1e-7b52-4f5e-9a55-6f2f1f0e6a10";

/// The robot and its session.
pub struct Robot {
    session: Session,
    reports: Vec<Value>,
    /// How many of the reports the page has passed on.
    told: usize,
}

impl Default for Robot {
    fn default() -> Self {
        let calibration = json!({
            "name": "two-joints",
            "robot": { "urdf": URDF, "base": "base", "tip": "lower" },
            "sensor": { "channel": "position", "sigma_m": 0.001 },
        });
        let session = Session::open(Setup { calibration, agent: None, seed: 1 }).expect("a session");
        let mut robot = Self { session, reports: Vec::new(), told: 0 };
        robot.keep();
        robot
    }
}

impl Robot {
    fn keep(&mut self) {
        if self.session.latest().step == self.reports.len() as u64 {
            self.reports.push(super::server::written(self.session.report()));
        }
    }

    /// Has as many movements suggested as are asked for.
    pub fn suggest(&mut self, count: u64) {
        self.session.suggest(&Ask { count: Some(count), ..Ask::default() }, None).expect("suggestions");
    }

    /// Ends a suggestion.
    pub fn end(&mut self, suggestion: u64, state: Outcome) {
        self.session.outcome(suggestion, state, None, None).expect("it is pending");
    }

    /// Carries out the oldest pending suggestion, and tells what was seen: the marker, or nothing.
    pub fn carry_out(&mut self, sees: bool) {
        let next = Suggestion::clone(self.session.pending().next().expect("a pending suggestion"));
        let told = Observation {
            suggestion_id: Some(next.id),
            measurements: BTreeMap::from([(
                "marker".to_owned(),
                if sees { marker(&next.configuration) } else { Value::Null },
            )]),
            configuration: next.configuration,
        };
        self.session.observe(told, None).expect("an observation");
        self.keep();
    }

    /// The session, as the page passes it on.
    pub fn session(&mut self) -> Value {
        self.told = 0;
        json!({ "is": "session", "session": self.resource() })
    }

    /// The same in a list.
    pub fn resource(&self) -> Value {
        json!({ "id": ID, "world": "outside", "step": self.reports.len() - 1, "remaining": null,
            "description": self.session.description() })
    }

    /// How it stands.
    pub fn status(&self) -> Value {
        let last = self.session.observations().last().map(|told| told.answer.clone());
        let pending: Vec<_> = self.session.pending().map(AsRef::as_ref).collect();
        let standing = json!({ "status": self.session.status(), "pending": pending, "last": last });
        json!({ "is": "live", "message": { "type": "status", "data": standing } })
    }

    /// The reports that the page has not passed on yet.
    pub fn news(&mut self) -> Vec<Value> {
        let news = self.reports[self.told..].to_vec();
        self.told = self.reports.len();
        news
    }
}

/// A robot that has carried out so many suggestions, and waits with the next.
pub fn after(movements: u64) -> Robot {
    let mut robot = Robot::default();
    for _ in 0..movements {
        robot.suggest(1);
        robot.carry_out(true);
    }
    robot.suggest(1);
    robot
}

/// A page that has been opened by the address of the session.
pub fn opened(query: &str, robot: &mut Robot) -> Page {
    let mut page = Page::open(&address(query));
    follow(&mut page, robot);
    page
}

/// That address.
pub fn address(query: &str) -> String {
    format!("?v=1&session={ID}{query}")
}

/// Answers a page that has just been opened by it.
pub fn follow(page: &mut Page, robot: &mut Robot) {
    page.tell(Server::scenarios());
    assert!(page.commands().contains(&Command::Find { session: ID.to_owned() }));
    page.tell(robot.session());
    page.tell(json!({ "is": "connected" }));
    pass_on(page, robot);
    page.commands();
}

/// Tells the page all that is new.
pub fn pass_on(page: &mut Page, robot: &mut Robot) {
    for report in robot.news() {
        page.tell(json!({ "is": "live", "message": { "type": "step", "data": report } }));
    }
    page.tell(robot.status());
}

/// Where the true arm, a little other than described, has its marker, read to a millimetre.
fn marker(posture: &BTreeMap<String, f64>) -> Value {
    let [shoulder, elbow] = [posture["shoulder"], posture["elbow"]];
    let reach = 0.304 + 0.25 * elbow.cos();
    let place = [reach * shoulder.cos(), reach * shoulder.sin(), 0.202 - 0.25 * elbow.sin()];
    // As good as drawn from -1 to 1, and the same each time.
    let noise = |place: f64| ((place * 1e5).sin() * 1e4).fract();
    json!(place.map(|metres| metres + 0.001 * noise(metres)))
}
