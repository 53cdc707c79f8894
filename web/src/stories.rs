//! What the page can tell: stories, each on a scenario of its own, told by cards that do things.
//!
//! A story is data. What its cards say is true of what is on screen; numbers that a run decides stand at its ending,
//! not here.

use egui::Rect;

use crate::settings::Tab;

/// A story.
pub struct Story {
    /// Its title.
    pub title: &'static str,
    /// One line that makes curious.
    pub teaser: &'static str,
    /// The scenario.
    pub scenario: &'static str,
    /// The seed: of 1 to 20 the one on which the learners end nearest to their medians over these, so that what is seen is
    /// no stroke of luck. A test measures it:
    /// `cargo test -p body-schema-panel --test stories -- --ignored --nocapture`; for those in simulated worlds see also
    /// `body-schema compare SCENARIO --learner NAMES --seeds 20`.
    pub seed: u64,
    /// The learners; empty for those that the scenario shows usually.
    pub learners: &'static [&'static str],
    /// The step at which it begins.
    pub step: u64,
    /// Its cards.
    pub cards: &'static [Card],
}

/// A card.
pub struct Card {
    /// Its title.
    pub title: &'static str,
    /// Its text.
    pub text: &'static str,
    /// The spot that it points at.
    pub spot: Spot,
    /// The actions that it offers; the story goes on with the first.
    pub acts: &'static [Act],
}

/// Something on the page that a card can point at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spot {
    /// The controls at the top.
    Transport,
    /// The chart beneath them.
    Chart,
    /// The table of learners.
    Learners,
    /// The ellipsoids in the scene, which is not the panel's.
    Ellipsoids,
    /// What can be seen of the run: charts, reasons, links.
    Tabs,
    /// How the run ended.
    Ending,
}

/// Where these are at the moment, as far as they are seen.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spots([Option<Rect>; 6]);

impl Spots {
    pub(crate) fn set(&mut self, spot: Spot, rect: Rect) {
        self.0[spot as usize] = Some(rect);
    }

    pub(crate) fn get(&self, spot: Spot) -> Option<Rect> {
        self.0[spot as usize]
    }
}

/// An action of a card.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    /// Play to a step at so many steps a second, and pause.
    PlayTo(u64, f64),
    /// Play to the end, at so many steps a second.
    PlayOn(f64),
    /// Show a step that was made.
    Go(u64),
    /// Show the last step that was made.
    GoToEnd,
    /// Show a part of the panel.
    Show(Tab),
    /// Keep a chart in sight, by its title.
    Chart(&'static str),
    /// Run other seeds.
    Seeds,
    /// Let the visitor choose the movements.
    Game,
    /// Tell another story, by its title.
    Story(&'static str),
}

impl Act {
    /// The label of its button.
    pub fn label(self) -> String {
        match self {
            Self::PlayTo(step, _) => format!("Play to movement {step}"),
            Self::PlayOn(_) => "Play to the end".to_owned(),
            Self::Go(step) => format!("Show movement {step}"),
            Self::GoToEnd => "Show the end".to_owned(),
            Self::Show(Tab::Why) => "Show the search".to_owned(),
            Self::Show(_) => "Show it".to_owned(),
            Self::Chart(title) => format!("Show “{title}”"),
            Self::Seeds => "Run ten more seeds".to_owned(),
            Self::Game => "Beat the algorithm".to_owned(),
            Self::Story(_) => "Next story".to_owned(),
        }
    }
}

const EYES: &str = "A body learns itself with its own eyes";
const ELBOW: &str = "The elbow breaks";
const OWN: &str = "Your own robot";

/// All stories; the first is told to those who come for the first time.
pub const STORIES: [Story; 7] = [
    Story {
        title: "Ten movements are enough",
        teaser: "Three learners, one arm: who asks needs fewer movements",
        scenario: "arm-6dof",
        seed: 4,
        learners: &[],
        step: 1,
        cards: &[
            Card {
                title: "What is learned",
                text: "A robot moves its arm and sees a marker on its hand. From that alone it learns where its joints \
                       are. In the scene, grey is the true arm and a colour what one learner believes. Look at the \
                       first ten movements.",
                spot: Spot::Transport,
                acts: &[Act::PlayTo(10, 2.0)],
            },
            Card {
                title: "What the ellipsoids mean",
                text: "Look at the scene: each translucent ellipsoid holds where a learner thinks a joint may be. Those \
                       of global shrink, since it weighs all movements together. Those of active and random stay large: \
                       noise is added to them on purpose, so that they can still adapt. The cores within them are \
                       what their data allow.",
                spot: Spot::Ellipsoids,
                acts: &[Act::Chart("Uncertainty")],
            },
            Card {
                title: "Why this posture?",
                text: "Before it moves, active tries many postures in its mind and takes the one that should teach it \
                       most. Below is the search for its latest movement. Bright places teach much: click one, and see \
                       whether you could do better.",
                spot: Spot::Tabs,
                acts: &[Act::Show(Tab::Why)],
            },
            Card {
                title: "Who needs fewer movements?",
                text: "A learner has learned the arm once its errors stay below the dashed lines for twenty movements \
                       more. Play to the end: while only one is left, time runs faster.",
                spot: Spot::Chart,
                acts: &[Act::PlayOn(10.0)],
            },
            Card {
                title: "Was it luck?",
                text: "The result stands below the chart. Run ten more seeds to see whether it was luck, choose the \
                       movements yourself, or see a robot look at its own hand.",
                spot: Spot::Ending,
                acts: &[Act::Seeds, Act::Game, Act::Story(EYES)],
            },
        ],
    },
    Story {
        title: EYES,
        teaser: "An eye on a neck, a tag on the hand, and nothing else",
        scenario: "humanoid-eyes",
        seed: 1,
        learners: &[],
        step: 1,
        cards: &[
            Card {
                title: "Nobody measures anything from outside",
                text: "This robot has an eye on its neck and a tagged cube on its hand. All that it knows is where the tags \
                       are in the picture. Neck, arm, eye and cube are all uncertain. Beside the scene is what the \
                       eye sees, and what each learner expected to see.",
                spot: Spot::Transport,
                acts: &[Act::PlayTo(10, 1.0)],
            },
            Card {
                title: "Where does the eye see the hand?",
                text: "The neck turns so that the hand stays in the middle of the picture; often it is hidden all the same, \
                       and the movement teaches nothing. Nothing tells where the robot stands in the world, so the \
                       chart shows what it can know: where the hand is for the eye.",
                spot: Spot::Chart,
                acts: &[Act::PlayOn(5.0)],
            },
            Card {
                title: "Chosen or random",
                text: "Both learners explain all pictures at once. One chooses its movements, the other moves at random. \
                       Run ten more seeds, or go on: a robot's elbow breaks, and nobody tells.",
                spot: Spot::Ending,
                acts: &[Act::Seeds, Act::Story(ELBOW)],
            },
        ],
    },
    Story {
        title: ELBOW,
        teaser: "What was learned is suddenly wrong: who notices?",
        scenario: "body-change",
        seed: 17,
        learners: &[],
        step: 295,
        cards: &[
            Card {
                title: "Something is about to happen",
                text: "For 295 movements the learners have got to know this arm. After movement 300, the upright line \
                       in the chart, the forearm sits 5 cm further along, and nobody tells them.",
                spot: Spot::Chart,
                acts: &[Act::PlayTo(305, 2.0)],
            },
            Card {
                title: "Who recovers?",
                text: "What they knew is wrong now. Diagnostic helps: a filter whose uncertainty is kept large believes what \
                       it sees. The state says how many movements each learner needs to recover.",
                spot: Spot::Learners,
                acts: &[Act::PlayOn(10.0)],
            },
        ],
    },
    Story {
        title: "Out of sight",
        teaser: "A head watches the hand: what it does not see teaches nothing",
        scenario: "head-fov",
        seed: 2,
        learners: &["active", "random", "naive"],
        step: 1,
        cards: &[
            Card {
                title: "A head that cannot see everywhere",
                text: "Here a head follows the marker with its eyes, and its neck has limits. A movement out of sight is \
                       a miss: it counts, and teaches nothing. Watch the misses of naive, which forgets about them when \
                       it chooses.",
                spot: Spot::Learners,
                acts: &[Act::PlayTo(30, 5.0)],
            },
            Card {
                title: "Ask for what can be seen",
                text: "active weighs what a posture would teach by the chance of seeing it. Play to the end to see what \
                       that saves.",
                spot: Spot::Chart,
                acts: &[Act::PlayOn(10.0)],
            },
        ],
    },
    Story {
        title: "A real TIAGo",
        teaser: "Measured movements of a real robot",
        scenario: "tiago-mocap",
        seed: 1,
        learners: &["active", "nominal"],
        step: 1,
        cards: &[
            Card {
                title: "Measured, not simulated",
                text: "These movements were made by a real robot and recorded with cameras. No truth is known: the error \
                       is that of predicting 59 postures of another session, which nobody learns from.",
                spot: Spot::Chart,
                acts: &[Act::PlayOn(2.0)],
            },
            Card {
                title: "What learning the axes brings",
                text: "nominal keeps the axes as they are described and learns where the robot stands; active learns the \
                       axes too, and in the end misses by a third less. Ten other seeds take the rows in other orders.",
                spot: Spot::Ending,
                acts: &[Act::Seeds],
            },
        ],
    },
    Story {
        title: "A real Franka without a camera",
        teaser: "A ball in two sockets, and nothing measured but the joints",
        scenario: "panda-sockets",
        seed: 10,
        learners: &["global", "random", "nominal"],
        step: 1,
        cards: &[
            Card {
                title: "Nothing is measured but the joints",
                text: "A ball on the hand of a real Franka was put back into two sockets, 50 mm apart, again and again, \
                       each time in another posture. Each time the model says where the ball is. If the model were right, it would be \
                       where it was before. That is all there is to learn from.",
                spot: Spot::Chart,
                acts: &[Act::PlayTo(12, 2.0)],
            },
            Card {
                title: "Judged where nobody has learned",
                text: "The chart shows how far the predicted ball strays from itself in the sockets at seven other places. \
                       nominal is the robot as its maker describes it, and strays by millimetres. global picks the rows \
                       that should teach most, random takes any.",
                spot: Spot::Chart,
                acts: &[Act::PlayOn(5.0)],
            },
            Card {
                title: "From here to a corrected robot",
                text: "In the end both have seen every row, so the curves meet. Was it luck that global was sooner? Or see \
                       how a robot of your own is calibrated.",
                spot: Spot::Ending,
                acts: &[Act::Seeds, Act::Story(OWN)],
            },
        ],
    },
    Story {
        title: OWN,
        teaser: "A URDF and a table are enough",
        scenario: "ur10-camera",
        seed: 16,
        learners: &["global", "random", "nominal"],
        step: 1,
        cards: &[
            Card {
                title: "Two files are enough",
                text: "A URDF says how the robot is meant to be, a table where its joints were and what was seen of its hand. \
                       Here it is a real UR10 with a tag, before a camera. Nobody says where the camera stands, or where on the \
                       hand the tag is: that is found first, by a few rows.",
                spot: Spot::Chart,
                acts: &[Act::PlayTo(6, 2.0)],
            },
            Card {
                title: "The axes come after",
                text: "nominal learns where camera and tag are and leaves the axes as described: it cannot get better than \
                       they are. The others correct the axes too. All are judged on rows that they never saw.",
                spot: Spot::Learners,
                acts: &[Act::PlayOn(2.0)],
            },
            Card {
                title: "Now yours",
                text: "In a terminal: “body-schema init robot.urdf table.csv” writes a file that says what it guessed; \
                       “body-schema calibrate” with that file writes the corrected URDF, and a report that says how good it is on \
                       rows that it has not seen. docs/your-robot.md tells how the table looks for your sensor.",
                spot: Spot::Ending,
                acts: &[Act::Seeds],
            },
        ],
    },
];

#[cfg(test)]
mod tests {
    use body_schema_scenario::builtin;

    use super::*;

    #[test]
    fn stories_are_of_scenarios_learners_and_titles_that_exist() {
        for story in &STORIES {
            let summary = builtin(story.scenario).expect("a built-in scenario").summary();
            for name in story.learners {
                assert!(summary.learners.iter().any(|learner| learner.name == *name), "{} {name}", story.title);
            }
            assert!(story.step < summary.steps);
            for act in story.cards.iter().flat_map(|card| card.acts) {
                if let Act::Story(title) = act {
                    assert!(STORIES.iter().any(|other| other.title == *title));
                }
            }
        }
        assert_eq!(STORIES[0].cards.len(), 5);
    }
}
