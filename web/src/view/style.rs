//! Colours of texts and grounds, chosen so that everybody can read them: WCAG 2.1 asks for a contrast of 4.5:1 for text
//! and of 3:1 for lines that mean something.

use egui::{Color32, Style, TextStyle, Theme, Ui, Visuals};

/// The colour of alarms, readable on light and dark grounds.
pub(crate) fn alarm(ui: &Ui) -> Color32 {
    if ui.visuals().dark_mode { Color32::from_rgb(0xFF, 0x9D, 0x66) } else { Color32::from_rgb(0xA6, 0x3D, 0) }
}

/// The colour of success.
pub(crate) fn good(ui: &Ui) -> Color32 {
    if ui.visuals().dark_mode { Color32::from_rgb(0x5F, 0xD3, 0xA8) } else { Color32::from_rgb(0, 0x66, 0x4A) }
}

/// What draws the eye: frames around what a card speaks of, and the optimal boxes of a search.
pub(crate) fn accent(dark: bool) -> Color32 {
    if dark { Color32::from_rgb(0xFF, 0x8A, 0x33) } else { Color32::from_rgb(0xC4, 0x4E, 0) }
}

/// Makes a style legible: egui's small print is too small and its quiet colours too weak to be read by everybody.
fn legible(style: &mut Style, dark: bool) {
    let visuals: &mut Visuals = &mut style.visuals;
    visuals.weak_text_alpha = 0.8;
    let text = if dark { Color32::from_gray(205) } else { Color32::from_gray(50) };
    visuals.widgets.noninteractive.fg_stroke.color = text;
    visuals.widgets.inactive.fg_stroke.color = text;
    visuals.hyperlink_color = if dark { Color32::from_rgb(120, 190, 255) } else { Color32::from_rgb(0, 90, 150) };
    if let Some(small) = style.text_styles.get_mut(&TextStyle::Small) {
        small.size = 11.5;
    }
}

/// Makes both themes legible, for windows and menus too.
pub(super) fn apply(ui: &mut Ui) {
    let ctx = ui.ctx().clone();
    let done = egui::Id::unique("legible");
    if !ctx.data(|data| data.get_temp::<bool>(done).unwrap_or(false)) {
        for theme in [Theme::Dark, Theme::Light] {
            ctx.style_mut_of(theme, |style| legible(style, theme == Theme::Dark));
        }
        ctx.data_mut(|data| data.insert_temp(done, true));
        ui.set_style(ctx.style_of(ctx.theme()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colours;

    fn luminance(colour: Color32) -> f64 {
        let linear = [colour.r(), colour.g(), colour.b()].map(|channel| {
            let value = f64::from(channel) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    fn contrast(a: Color32, b: Color32) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    /// What a translucent colour looks like on a ground.
    fn over(colour: Color32, alpha: f32, ground: Color32) -> Color32 {
        let mix = |a: u8, b: u8| (f32::from(a) * alpha + f32::from(b) * (1.0 - alpha)).round() as u8;
        Color32::from_rgb(mix(colour.r(), ground.r()), mix(colour.g(), ground.g()), mix(colour.b(), ground.b()))
    }

    #[test]
    fn texts_and_lines_stand_out_in_light_and_dark() {
        for theme in [Theme::Dark, Theme::Light] {
            let dark = theme == Theme::Dark;
            let mut style = theme.default_style();
            legible(&mut style, dark);
            let visuals = &style.visuals;
            let ctx = egui::Context::default();
            ctx.set_theme(theme);
            let mut named = Vec::new();
            let mut drawn = ctx.run_ui(egui::RawInput::default(), |ui| named = vec![alarm(ui), good(ui)]);
            drawn.textures_delta.clear();
            for ground in [visuals.panel_fill, visuals.window_fill, visuals.faint_bg_color] {
                // The faint ground is a tint upon the panel's.
                let ground = if ground.a() < 255 { visuals.panel_fill.blend(ground) } else { ground };
                let text = visuals.text_color();
                let mut texts = vec![text, over(text, visuals.weak_text_alpha, ground), visuals.hyperlink_color];
                texts.append(&mut named.clone());
                for colour in texts {
                    let found = contrast(colour, ground);
                    assert!(found >= 4.5, "text {colour:?} on {ground:?} ({theme:?}): {found:.2}");
                }
                for colour in (0..7).map(colours::learner).chain([accent(dark)]) {
                    let found = contrast(colour, ground);
                    assert!(found >= 3.0, "line {colour:?} on {ground:?} ({theme:?}): {found:.2}");
                }
            }
            let selected = contrast(visuals.selection.stroke.color, visuals.selection.bg_fill);
            assert!(selected >= 4.5, "selected text ({theme:?}): {selected:.2}");
            let button = contrast(visuals.widgets.inactive.fg_stroke.color, visuals.widgets.inactive.weak_bg_fill);
            assert!(button >= 4.5, "buttons ({theme:?}): {button:.2}");
        }
    }
}
