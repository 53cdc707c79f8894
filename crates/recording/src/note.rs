//! The note of a recording: what it shows, and how to reproduce it.

use body_schema_palette::{hex, learner_color, learner_slots};
use std::fmt::Write as _;

use nalgebra::Point3;

use super::{
    EllipsoidSize, TRUTH_COLOR,
    colours::{label_in_file, labelled},
    rerun::{MediaType, Points3D, TextDocument},
    solid::single,
};
use body_schema_wire::{Description, JointKind};

const HEAD: &str = "- **Head**: in pale grey the cone of the lens at rest, and the square over which its axis can turn; in the \
                    learner's pale colour the cone after the head has followed the marker. A marker outside it is missed: red, where \
                    it truly was.\n";

const CAMERAS: &str = "- **Cameras** as an eye and the outline of its picture at a fixed distance, a notch where it is up: grey where they \
                       truly are, in the learner's colour where it takes them to be, if that is another place. Small balls: the \
                       known points of what they look at; yellow rays: to what they saw in the step's movement.\n";

const READINGS: &str = "- **Residual per reading**: how far the step's reading is from the updated estimate, as root mean square over \
                        its coordinates in standard deviations σ of the noise: about 1 where only noise is left. Nothing after a \
                        miss.\n";

const OUTLIERS: &str = "- **Outliers**: a red cross where a reading was that its learner rather takes for an outlier; its probability \
                        is a curve of its own.\n";

const LIMITS: &str = "- **Limits** beside the trace: `bound_trace`, pale, is the least that a learner's data allow; the best design, grey, \
                      the least that any so many movements allow, if it was computed (`run --limits`).\n";

const ALLOWED: &str = "- **Small, more solid clouds** within the pale ones: what the data allow. The learner's own covariance is \
                       kept larger by its stabilising noise.\n";

/// The key to the colours, as a label in the scene.
pub(super) fn key(description: &Description, enlarged: Option<f64>, place: Point3<f64>) -> Points3D {
    let truth = description.truth.as_ref().map(|_| "grey: the true arm");
    let learners = ["colour: the arm as believed", "cloud: how unsure", "yellow: the hand as seen"];
    let times = enlarged.map(|times| format!("differences from the description (grey) × {times}"));
    let words = truth.into_iter().chain(learners).map(str::to_owned);
    let text = words.chain(times).collect::<Vec<_>>().join("  ·  ");
    labelled([single(place.coords.into())], label_in_file(TRUTH_COLOR)).with_labels([text])
}

/// The note, in Markdown.
pub(super) fn note(description: &Description, ellipsoids: EllipsoidSize, enlarged: Option<f64>) -> TextDocument {
    TextDocument::new(markdown(description, ellipsoids, enlarged)).with_media_type(MediaType::markdown())
}

fn markdown(description: &Description, ellipsoids: EllipsoidSize, enlarged: Option<f64>) -> String {
    let Description { scenario, title, seed, version, parameters, thresholds, movements_by_counting, .. } = description;
    let mut text = format!(
        "# {title}\n\nScenario `{scenario}`, seed {seed}, {parameters} learned parameters (as many equations after \
         {movements_by_counting} movements), recorded by body-schema {version}.\n\n"
    );
    // Writing to a String does not fail.
    let _ = write!(
        text,
        "```\nbody-schema run {scenario} --seed {seed} --steps M{} --rrd FILE{}\n```\nmakes this recording again, but for \
         the times in `selection_ms`.\n\n## Learners\n\n| learner | estimator | policy | colour |\n|---|---|---|---|\n",
        description.learners.iter().map(|learner| format!(" --learner {}", learner.name)).collect::<String>(),
        (if ellipsoids == EllipsoidSize::default() {
            String::new()
        } else {
            format!(" --ellipsoids {}", ellipsoids.name())
        }) + &enlarged.map_or(String::new(), |times| format!(" --enlarge {times}"))
    );
    let slots = learner_slots(description.learners.iter().map(|learner| learner.name.as_str()));
    for (learner, slot) in description.learners.iter().zip(slots) {
        let colour = hex(learner_color(slot));
        let _ = writeln!(text, "| {} | {} | {} | `{colour}` |", learner.name, learner.estimator, learner.policy);
    }
    text.push_str("\n## What you see\n\n");
    if let Some(times) = enlarged {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "- **Differences × {times}**: the arm stands at its description (slim, grey) + {times} × what was learned of it, and \
             its clouds are {times} times as large."
        );
    }
    if description.truth.is_some() {
        text.push_str(
            "- **True arm** in grey, as it stood in the step's movement, with a pin along each joint's axis.\n",
        );
    } else {
        text.push_str("- The truth is not known: errors that need it are absent; prediction is judged over held-out measurements.\n");
    }
    if description.truth.is_some() && description.learners.iter().any(|learner| learner.stabilised) {
        text.push_str(ALLOWED);
    }
    if !description.cameras.is_empty() {
        text.push_str(CAMERAS);
    }
    text.push_str(READINGS);
    if description.learners.iter().any(|learner| learner.robust) {
        text.push_str(OUTLIERS);
    }
    let limits = description.truth.as_ref().map_or("", |_| LIMITS);
    let _ = write!(
        text,
        "{}- **Estimated arm** in the learner's colour around it, as believed after the step's measurement.\n\
         - **Clouds** {}: where the points on the joints' axes may be (flat along the axis, where a point means \
         nothing).\n\
         - **Marker**: in the learner's colour as predicted before the measurement, yellow as measured, a red line from \
         the one to the other with its length; red alone after a miss.\n\
         - **At θ = 0**, switched off at first (`zero` in the list of entities): the estimate as a line with one arrow per \
         axis (a sliding joint's stands at the next joint) and at the tips of the arrows how unsure the directions are; \
         the truth in grey.\n\
         - **Partition**: how DIRECT divided the joint box to choose the movement, as the slice through the chosen \
         configuration (vermillion) along two joints, each from limit to limit. Brighter is a lower criterion, so \
         better; thick outlines are what would be divided next; dots are centres outside the slice.\n\
         {limits}\n\
         Lengths in metres, in the frame of the measurements; `_deg` in degrees; joint values in radians or metres.\n\n\
         `converged_at` asks for an orientation error up to {}° and a location error up to {} m.\n\n",
        if description.head.is_some() { HEAD } else { "" },
        match ellipsoids {
            EllipsoidSize::OneSigma =>
                "reach 1σ along each principal axis (in two dimensions that holds 39 % of a normal distribution, in three 20 %)",
            EllipsoidSize::TwoSigma =>
                "reach 2σ along each principal axis (in two dimensions that holds 86 % of a normal distribution, in three 74 %)",
            EllipsoidSize::NinetyFivePercent => "hold 95 % of a normal distribution",
        },
        thresholds.orientation_deg,
        thresholds.location_m
    );
    text.push_str("## Joints\n\n| joint | kind | limits | learned |\n|---|---|---|---|\n");
    for joint in &description.joints {
        let learned = if joint.learned { "yes" } else { "no" };
        let _ = match (joint.kind, joint.limits) {
            (JointKind::Revolute, [lower, upper]) => {
                let (lower, upper) = (lower.to_degrees(), upper.to_degrees());
                writeln!(text, "| {} | revolute | {lower:.1}° … {upper:.1}° | {learned} |", joint.name)
            }
            (JointKind::Prismatic, [lower, upper]) => {
                writeln!(text, "| {} | prismatic | {lower:.3} m … {upper:.3} m | {learned} |", joint.name)
            }
        };
    }
    text
}
