//! What a page asks of experiments, answered: the same bytes by a server and by the visitor's own browser.
//!
//! [`Steps`] is an experiment with its recording, without threads, clocks or connections. A server has one in a thread of its own;
//! [`Local`] has some and answers for them as the server's routes would; it has scenarios of one's own, and sessions with robots
//! elsewhere as they were written down. [`Workbench`] answers what a page asks about a robot of the visitor's own. [`Problem`] is
//! what is answered where something is wrong.

mod kept;
mod local;
mod problem;
mod query;
mod requests;
mod scenarios;
mod steps;
mod watched;
mod workbench;

pub use body_schema_calibration::Progress;
pub use kept::{Kept, table_head};
pub use local::{Answer, Asked, Job, Local};
pub use problem::{Beside, Kind, Problem};
pub use query::{arrangement, parameters, word};
pub use requests::{
    Configuration, ConfigurationRequest, EvaluationRequest, MadeSteps, NewSession, ScenarioList, ScenarioResource,
    SessionResource, StepRequest, parse, read,
};
pub use scenarios::Scenarios;
pub use steps::{Steps, recording_failed, world};
pub use watched::draw_next;
pub use workbench::{Meshes, Workbench, Worked};
