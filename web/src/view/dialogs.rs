//! The tour and the help, above everything else.

use egui::{Align2, Context, Grid, RichText, Window, vec2};

use crate::{host::Command, keys::SHORTCUTS, panel::Panel};

/// The cards of the tour: title and text.
pub const TOUR: [(&str, &str); 5] = [
    (
        "What is learned",
        "A robot moves its arm and sees a marker on its hand. From that alone it works out where each of its joint axes \
         is and which way it points: its body schema. Grey in the scene is the true arm, a colour is what one learner \
         believes.",
    ),
    (
        "Why random is wasteful",
        "Most random postures show what is known already. The active learner (blue) asks first which posture would \
         shrink its uncertainty most, and needs about half the movements. Press Space and watch the blue curves pull \
         ahead.",
    ),
    (
        "What the ellipsoids mean",
        "Each ellipsoid around an axis or the marker holds where the learner thinks it is. Large: it hardly knows. \
         Watch them shrink, first across the line of sight of the movements made, then in all directions.",
    ),
    (
        "How DIRECT chooses",
        "There are infinitely many postures. DIRECT divides the box of joint limits, tries the middle of each part, and \
         divides again where the value is good or the part is large. “Why this posture?” shows every division. Click \
         there to try to do better.",
    ),
    (
        "What to try next",
        "Tick “global” above: it weighs all movements together, plans ahead and needs about ten. Press N for another \
         seed, or run ten in the charts to see that it is no luck. Choose head-fov, where the arm may leave the camera's \
         view, or tiago-mocap, a real robot. “Share” holds a link to exactly what you see.",
    ),
];

impl Panel {
    pub(super) fn dialogs(&mut self, ctx: &Context) {
        let width = (ctx.content_rect().width() - 40.0).min(360.0);
        self.tour_card(ctx, width);
        let mut open = self.help;
        Window::new("Help").open(&mut open).collapsible(false).resizable(false).default_width(width)
            .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ctx, |ui| {
            Grid::new("shortcuts").num_columns(2).spacing([14.0, 4.0]).show(ui, |ui| {
                for (keys, action) in SHORTCUTS {
                    ui.label(RichText::new(keys).monospace().strong());
                    ui.label(action);
                    ui.end_row();
                }
            });
            ui.separator();
            ui.label("Converged: both errors stay within the thresholds, confirmed by 20 more movements; known only with \
                      hindsight and the truth.");
            ui.label("Settled: the learner's own verdict, without truth.");
            ui.label("Move the scene's time, or click a chart, to go to a step; both follow each other.");
        });
        self.help = open;
    }

    fn tour_card(&mut self, ctx: &Context, width: f32) {
        let Some((card, (title, text))) = self.tour.and_then(|card| Some((card, TOUR.get(card)?))) else { return };
        let mut next = Some(card);
        Window::new(format!("{} of {}: {title}", card + 1, TOUR.len()))
            .id(egui::Id::unique("tour"))
            .collapsible(false)
            .resizable(false)
            .default_width(width)
            .anchor(Align2::CENTER_BOTTOM, vec2(0.0, -16.0))
            .show(ctx, |ui| {
                ui.set_max_width(width);
                ui.label(*text);
                ui.add_space(6.0);
                ui.horizontal(|ui| {
                    if ui.button("Skip the tour").clicked() {
                        next = None;
                    }
                    if card > 0 && ui.button("Previous").clicked() {
                        next = Some(card - 1);
                    }
                    let last = card + 1 == TOUR.len();
                    if ui.button(RichText::new(if last { "Done" } else { "Next" }).strong()).clicked() {
                        next = Some(card + 1).filter(|_| !last);
                    }
                });
            });
        match next {
            Some(_) => self.tour = next,
            None => self.close_tour(),
        }
    }

    /// Whoever has closed the tour need not be offered it again.
    pub(crate) fn close_tour(&mut self) {
        if self.tour.take().is_some() {
            self.ask(Command::Known);
        }
    }
}
