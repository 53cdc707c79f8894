//! The present activity, in a sentence.

use crate::panel::{Link, Panel};

impl Panel {
    /// The sentence above the controls: the present activity, or what to do.
    pub fn status(&self) -> String {
        let latest = self.history.latest();
        match &self.link {
            Link::Unreachable(why) if !self.server => format!("Nothing can be computed here: {why}."),
            Link::Unreachable(why) => format!("The server cannot be used: {why}. Reset tries again."),
            Link::Lost(seconds) => format!("The connection is lost; trying again in {seconds} s. The run is kept."),
            Link::Expired if self.is_external() => "This session was deleted. Explorer leaves it.".to_owned(),
            Link::Expired => "This session has expired. Restore computes it again; Reset begins anew.".to_owned(),
            Link::Failed(why) => format!("The engine has failed: {why}. Reset begins anew."),
            _ if self.opening => "Opening a session…".to_owned(),
            Link::Loading => "Loading…".to_owned(),
            Link::Connected if self.restoring.is_some_and(|target| target > 1) => {
                format!("Computing the run up to step {}…", self.restoring.unwrap_or_default())
            }
            Link::Connected if self.playing => match self.fast_forward() {
                Some(what) if self.is_late() => format!("Fast-forward, {what}; computing movement {}…", latest + 1),
                Some(what) => format!("Fast-forward, {what}…"),
                None if self.is_late() => format!("Computing movement {}…", latest + 1),
                None => format!("Running, {} movements a second.", self.speed()),
            },
            Link::Connected if self.is_external() => self.robot_status(),
            Link::Connected if self.human().is_some() => self.game_status(),
            Link::Connected => match &self.stopped {
                Some(reason) => reason.clone(),
                None if self.cursor < latest => format!("Step {} of {latest}.", self.cursor),
                None if self.touch => "Tap Play.".to_owned(),
                None => "Press Play.".to_owned(),
            },
        }
    }
}
