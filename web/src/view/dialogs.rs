//! The help, above everything else.

use egui::{Align2, Context, Grid, RichText, Window, vec2};

use crate::{keys::SHORTCUTS, panel::Panel};

impl Panel {
    pub(super) fn dialogs(&mut self, ctx: &Context) {
        let width = (ctx.content_rect().width() - 40.0).min(360.0);
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
            ui.label("Learned (converged): both errors stay within the thresholds, confirmed by 20 more movements; known \
                      only with hindsight and the truth.");
            ui.label("Sure of itself (settled): the learner's own verdict, without the truth.");
            ui.label("Move the scene's time, or click a chart, to go to a step; both follow each other.");
        });
        self.help = open;
    }
}
