//! Going through a story, and what its cards do.

use crate::{
    host::Command,
    panel::Panel,
    settings::{StopWhen, Tab},
    stories::{Act, Card, STORIES, Spot, Story},
};

impl Panel {
    /// The card that is open, its story and its place.
    pub fn card(&self) -> Option<(&'static Story, usize, &'static Card)> {
        let story = STORIES.get(self.story)?;
        let place = self.tour?;
        Some((story, place, story.cards.get(place)?))
    }

    /// The stories that can be told here.
    pub fn stories(&self) -> impl Iterator<Item = (usize, &'static Story)> {
        let there = |story: &Story| self.scenarios.iter().any(|scenario| scenario.name == story.scenario);
        STORIES.iter().enumerate().filter(move |(_, story)| there(story))
    }

    /// Begins a story with its first card.
    pub fn tell(&mut self, index: usize) {
        let Some(story) = STORIES.get(index) else { return };
        self.unfold();
        (self.story, self.tour) = (index, Some(0));
        story.scenario.clone_into(&mut self.settings.scenario);
        let settings = &mut self.settings;
        settings.learners = story.learners.iter().map(|name| (*name).to_owned()).collect();
        (settings.seed, settings.stop, settings.tab) = (story.seed, StopWhen::Told, Tab::Charts);
        (settings.joints, settings.learner, settings.run_to) = (None, None, None);
        settings.set.clear();
        self.seed_text = story.seed.to_string();
        self.notices.clear();
        self.choose_usual_learners();
        self.open(story.step);
    }

    /// Whether what is shown is what the open card speaks of.
    pub(crate) fn is_on_story(&self) -> bool {
        let plain = self.description().filter(|description| description.set.is_empty());
        let shown = plain.map(|description| description.scenario.as_str());
        self.card().is_some_and(|(story, ..)| shown == Some(story.scenario)) && self.human().is_none()
    }

    /// Opens the cards of the story that is shown.
    pub fn open_tour(&mut self) {
        self.unfold();
        self.tour = Some(0);
    }

    /// What a card's action comes to by now: what has been done already is shown again.
    pub(crate) fn due(&self, act: Act) -> Act {
        match act {
            Act::PlayTo(step, _) if self.history.latest() >= step => Act::Go(step),
            Act::PlayOn(_) if self.ending().is_some() => Act::GoToEnd,
            act => act,
        }
    }

    /// Does what a card offers.
    pub fn act(&mut self, act: Act) {
        match act {
            Act::PlayTo(step, speed) => {
                self.settings.speed = speed;
                self.play_to(step);
            }
            Act::PlayOn(speed) => {
                self.settings.speed = speed;
                self.settings.tab = Tab::Charts;
                if self.description().is_some_and(|description| description.truth.is_some()) {
                    self.chart = "Location error";
                }
                self.play();
            }
            Act::Go(step) => self.scrub(step),
            Act::GoToEnd => self.scrub(self.history.latest()),
            Act::Show(tab) => self.settings.tab = tab,
            Act::Chart(title) => self.chart = title,
            Act::Seeds => self.run_seeds(),
            Act::Game => self.begin_contest(),
            Act::Story(title) => {
                if let Some(index) = STORIES.iter().position(|story| story.title == title) {
                    self.tell(index);
                }
            }
        }
    }

    /// Marks what the open card speaks of in the legend of the scene.
    pub(crate) fn point_at_scene(&mut self) {
        let at = self.card().filter(|(.., card)| card.spot == Spot::Ellipsoids).map(|_| "ellipsoids");
        if self.pointed != at {
            self.pointed = at;
            self.ask(Command::Point { at });
        }
    }

    /// Whoever has closed the cards need not be offered them again.
    pub(crate) fn close_tour(&mut self) {
        if self.tour.take().is_some() {
            self.ask(Command::Known);
        }
    }
}
