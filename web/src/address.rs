//! The visitor's choice in the page's address.
//!
//! An address may come from anywhere and from any version: unknown parts, and parts out of range, are replaced by their
//! defaults, with a notice; an address is never refused as a whole.

use crate::settings::{
    ELLIPSOIDS, ENLARGED, HUMAN, MAX_RESTORED, MAX_RUN, MAX_SEED, MAX_SPEED, MIN_SPEED, Settings, StopWhen, Tab, short,
};

/// The version of the address; raised when a name changes its meaning.
const VERSION: &str = "1";

impl Settings {
    /// Reads an address's query, with a notice for each part that could not be used.
    pub fn parse(query: &str) -> (Self, Vec<String>) {
        let (mut settings, mut notices) = (Self { robot: true, ..Self::default() }, Vec::new());
        for pair in query.trim_start_matches('?').split('&').filter(|pair| !pair.is_empty()) {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            let value = decode(value);
            if let Err(notice) = settings.set(name, &value) {
                notices.push(notice);
            }
            settings.robot &= name != "scenario";
        }
        settings.robot &= settings.session.is_some();
        (settings, notices)
    }

    fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let wrong = |range: &str, used: String| {
            let value: String = value.chars().take(40).collect();
            format!("The address says {name}={value}, which is not {range}; {used} is used instead.")
        };
        let number =
            |range: std::ops::RangeInclusive<u64>| value.parse::<u64>().ok().filter(|number| range.contains(number));
        match name {
            "v" if value == VERSION => {}
            "v" => return Err(format!("The address is of version {value}; this page reads version {VERSION}.")),
            "scenario" => value.clone_into(&mut self.scenario),
            "set" => match value.contains('=') {
                true => self.set.push(value.to_owned()),
                false => return Err(wrong("KEY=VALUE", "the scenario's own".to_owned())),
            },
            "seed" => {
                let range = format!("a whole number up to {MAX_SEED}");
                self.seed = number(0..=MAX_SEED).ok_or_else(|| wrong(&range, self.seed.to_string()))?;
            }
            "learners" => {
                self.learners = value.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
            }
            "step" => {
                let range = format!("a step up to {MAX_RESTORED}");
                let step = number(0..=MAX_RESTORED);
                self.step = Some(step.ok_or_else(|| wrong(&range, "the usual one".to_owned()))?);
            }
            "speed" => {
                let range = format!("from {MIN_SPEED} to {MAX_SPEED}");
                let speed = value.parse::<f64>().ok().filter(|speed| (MIN_SPEED..=MAX_SPEED).contains(speed));
                self.speed = speed.ok_or_else(|| wrong(&range, self.speed.to_string()))?;
            }
            "to" => {
                let range = format!("a step from 1 to {MAX_RUN}");
                let to = number(1..=MAX_RUN).ok_or_else(|| wrong(&range, "the scenario's last step".to_owned()))?;
                self.run_to = Some(to);
            }
            "stop" => {
                let found = StopWhen::ALL.iter().find(|(_, name, _)| *name == value);
                self.stop = found.ok_or_else(|| wrong("told, never, first or all", "told".to_owned()))?.0;
            }
            "tab" => {
                let found = Tab::ALL.iter().find(|(_, name, _)| *name == value);
                self.tab = found.ok_or_else(|| wrong("charts, why or share", "charts".to_owned()))?.0;
            }
            "chart" => self.chart = Some(value.to_owned()),
            "why" => self.learner = Some(value.to_owned()),
            "joints" => {
                let pair = value.split_once(',').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
                let pair: Option<(usize, usize)> = pair.filter(|(a, b)| a != b);
                self.joints = Some(pair.ok_or_else(|| wrong("two joints", "the first two".to_owned()))?);
            }
            "ellipsoids" => {
                let found = ELLIPSOIDS.iter().find(|(name, _)| *name == value);
                found
                    .ok_or_else(|| wrong("1-sigma, 2-sigma or 95-percent", "1-sigma".to_owned()))?
                    .0
                    .clone_into(&mut self.ellipsoids);
            }
            "enlarge" => {
                let found = value.parse().ok().filter(|times| ENLARGED.contains(times));
                self.enlarge = found.ok_or_else(|| wrong("a whole number from 1 to 50", "1".to_owned()))?;
            }
            "embed" => self.embed = yes(value).ok_or_else(|| wrong("0 or 1", "0".to_owned()))?,
            "brief" => self.brief = yes(value).ok_or_else(|| wrong("0 or 1", "0".to_owned()))?,
            "bands" => self.bands = yes(value).ok_or_else(|| wrong("0 or 1", "0".to_owned()))?,
            "play" if value == HUMAN => self.play = true,
            "play" => return Err(wrong(HUMAN, "no game".to_owned())),
            "session" => self.session = Some(value.to_owned()),
            // Browsers and those who pass links on add what they like.
            _ if name.starts_with("utm_") => {}
            _ => return Err(format!("The address names “{}”, which this page does not know.", short(name))),
        }
        Ok(())
    }

    /// The query of this choice as the page's own address, without a question mark.
    pub fn query(&self) -> String {
        let mut query = self.choice();
        let mut add = |name: &str, value: &str| query += &format!("&{name}={}", encode(value));
        if self.tab == Tab::Share {
            add("tab", "share");
        }
        if self.embed {
            add("embed", "1");
        }
        if self.brief {
            add("brief", "1");
        }
        if let Some(session) = &self.session {
            add("session", session);
        }
        query
    }

    /// The query of a link for others: it names what is shared rather than how to share it, and no session except that of
    /// a robot elsewhere, which cannot be run again.
    pub fn link(&self) -> String {
        let session = self.session.as_deref().filter(|_| self.robot);
        self.choice() + &session.map(|id| format!("&session={}", encode(id))).unwrap_or_default()
    }

    /// The query of a link to a game on the same seed.
    pub fn challenge(&self) -> String {
        let set: String = self.set.iter().map(|replacement| format!("&set={}", encode(replacement))).collect();
        format!("v={VERSION}&scenario={}{set}&seed={}&play={HUMAN}", encode(&self.scenario), self.seed)
    }

    fn choice(&self) -> String {
        let usual = Self::default();
        let mut query = format!("v={VERSION}");
        let mut add = |name: &str, value: &str| query += &format!("&{name}={}", encode(value));
        if !self.robot {
            add("scenario", &self.scenario);
            self.set.iter().for_each(|replacement| add("set", replacement));
            add("seed", &self.seed.to_string());
            if !self.learners.is_empty() {
                add("learners", &self.learners.join(","));
            }
        }
        if let Some(step) = self.step {
            add("step", &step.to_string());
        }
        if self.speed != usual.speed {
            add("speed", &self.speed.to_string());
        }
        if let Some(to) = self.run_to {
            add("to", &to.to_string());
        }
        let named = |stop| StopWhen::ALL.iter().find(|(known, ..)| *known == stop).map_or("", |(_, name, _)| name);
        if self.stop != usual.stop {
            add("stop", named(self.stop));
        }
        if self.tab != usual.tab && self.tab != Tab::Share {
            add("tab", Tab::ALL.iter().find(|(known, ..)| *known == self.tab).map_or("", |(_, name, _)| name));
        }
        if let Some(chart) = &self.chart {
            add("chart", chart);
        }
        if let Some(learner) = &self.learner {
            add("why", learner);
        }
        if let Some((a, b)) = self.joints {
            add("joints", &format!("{a},{b}"));
        }
        if self.bands {
            add("bands", "1");
        }
        if self.ellipsoids != usual.ellipsoids && !self.robot {
            add("ellipsoids", &self.ellipsoids);
        }
        if self.enlarge != usual.enlarge && !self.robot {
            add("enlarge", &self.enlarge.to_string());
        }
        query
    }
}

fn yes(value: &str) -> Option<bool> {
    match value {
        "1" => Some(true),
        "0" => Some(false),
        _ => None,
    }
}

/// Percent-decoding; malformed parts stay as they are.
fn decode(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut rest = bytes;
    while let Some((&first, tail)) = rest.split_first() {
        let hex = tail.get(..2).and_then(|two| u8::from_str_radix(std::str::from_utf8(two).ok()?, 16).ok());
        match (first, hex) {
            (b'%', Some(byte)) => {
                decoded.push(byte);
                rest = &tail[2..];
            }
            (b'+', _) => {
                decoded.push(b' ');
                rest = tail;
            }
            _ => {
                decoded.push(first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

fn encode(text: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.~,".contains(&byte);
    text.bytes().map(|byte| if plain(byte) { (byte as char).to_string() } else { format!("%{byte:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_back_as_it_was_written() {
        let settings = Settings {
            scenario: "head-fov".to_owned(),
            set: vec!["sensor.sigma_m=0.002".to_owned(), "change={ step = 20 }".to_owned()],
            seed: MAX_SEED,
            learners: vec!["active".to_owned(), "random".to_owned()],
            step: Some(57),
            speed: 2.5,
            run_to: Some(300),
            stop: StopWhen::First,
            tab: Tab::Why,
            chart: Some("location-error".to_owned()),
            learner: Some("active".to_owned()),
            joints: Some((0, 3)),
            ellipsoids: "95-percent".to_owned(),
            enlarge: 20,
            session: Some("3f2a".to_owned()),
            robot: false,
            embed: true,
            brief: true,
            bands: true,
            play: false,
        };
        assert_eq!(Settings::parse(&settings.query()), (settings.clone(), Vec::new()));
        assert_eq!(Settings::parse(&Settings::default().query()), (Settings::default(), Vec::new()));
    }

    #[test]
    fn a_link_to_give_away_says_nothing_of_the_session_or_of_sharing() {
        let settings = Settings { tab: Tab::Share, session: Some("3f2a".to_owned()), ..Settings::default() };
        assert!(settings.query().contains("&tab=share&session=3f2a"));
        let (read, notices) = Settings::parse(&format!("?{}", settings.link()));
        assert_eq!((read, notices.len()), (Settings::default(), 0));
        let (read, notices) = Settings::parse(&settings.challenge());
        assert!(read.play && notices.is_empty());
    }

    #[test]
    fn a_link_to_a_robot_elsewhere_names_its_session_and_no_scenario() {
        let session = Some("3f2a".to_owned());
        let mut settings = Settings { session, robot: true, ..Settings::default() };
        assert_eq!(settings.link(), "v=1&session=3f2a");
        settings.step = Some(4);
        assert_eq!(Settings::parse(&settings.query()), (settings, Vec::new()));
    }

    #[test]
    fn what_is_wrong_in_an_address_gives_a_notice_and_a_default() {
        for query in [
            "seed=-1",
            "seed=1.5",
            "seed=9007199254740993",
            "step=999999999",
            "speed=0",
            "speed=NaN",
            "speed=inf",
            "to=0",
            "stop=sometimes",
            "tab=secret",
            "joints=1",
            "joints=2,2",
            "joints=a,b",
            "ellipsoids=3",
            "enlarge=0",
            "enlarge=51",
            "embed=yes",
            "play=robot",
            "v=2",
            "v=",
            "colour=blue",
            "%",
        ] {
            let (settings, notices) = Settings::parse(query);
            assert_eq!((settings, notices.len()), (Settings::default(), 1), "{query}");
        }
        assert_eq!(Settings::parse("?scenario=%E2%82%AC%zz%").0.scenario, "€%zz%");
        assert!(Settings::parse("utm_source=x&").1.is_empty());
    }
}
